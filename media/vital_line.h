// Everything a line of a vitals segment can say. A line without "kind" is a sample (vital_sample.h). The
// others have a "kind". Like samples, they are written in one form and read in every form of JSON. Values;
// functions are pure and thread-safe.
//
//   {"time_ns":1,"kind":"text","device_time":T,"code":C,"mdc":N,"text":"Alert","source":S,"quality":Q}
//       a quantity whose value is words; device_time and mdc only if known; quality, here and of an alarm,
//       only if it is "questionable" or "invalid"
//   {"time_ns":1,"kind":"alarm","device_time":T,"code":C,"mdc":N,"text":"SpO2 low","about":C,"phase":"start",
//    "state":"active","priority":"PH","source":S,"quality":Q}
//       an alarm of a device, in its own words (IEEE 11073-10201, IHE PCD-04)
//   {"time_ns":1,"kind":"message","answer":"AA","text":"MSH|…","source":S}
//       what a device sent, byte for byte, before the samples that were read from it; "base64" instead of
//       "text" where the bytes are not UTF-8 or the line would become too long
//   {"time_ns":1,"kind":"device-clock","zero":T,"spread_ns":N,"messages":N,"source":S}
//       what a device's clock showed when the case clock was zero, as estimated so far
//   {"time_ns":1,"kind":"notice","notice":"segment-unknown","text":"…","source":S}
//       something a device sent that is not among the samples, or not as it was sent, and why
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <variant>

#include "base/utc_time.h"
#include "media/vital_sample.h"

namespace kiroku::media {

struct VitalText {
  std::int64_t time_ns = 0;
  std::optional<UtcTime> device_time;
  std::string code;       // as in VitalSample
  std::uint32_t mdc = 0;  // 0: unknown
  std::string text;
  std::string source;
  VitalQuality quality = VitalQuality::kGood;  // not kMissing
  bool operator==(const VitalText&) const = default;
};

/// `about` is the code of the quantity, phase "start", "continue", "end", …; state "active", "inactive",
/// "latched"; priority "PH", "PM", "PL", "PI": as the device said them, "" where it did not.
struct DeviceAlarm {
  std::int64_t time_ns = 0;
  std::optional<UtcTime> device_time;
  std::string code;
  std::uint32_t mdc = 0;
  std::string text, about, phase, state, priority;
  std::string source;
  VitalQuality quality = VitalQuality::kGood;  // not kMissing
  bool operator==(const DeviceAlarm&) const = default;
};

struct DeviceMessage {
  std::int64_t time_ns = 0;
  std::string bytes;   // any
  std::string answer;  // "AA", "AE", "AR" (HL7 table 0008), or "" where none is given
  std::string source;
  bool operator==(const DeviceMessage&) const = default;
};

/// A device's time t was, to the best estimate, case-clock time t - zero. `spread_ns`: how much later than
/// that the middle one of the recent messages arrived. `messages`: how many the estimate stands on.
struct DeviceClock {
  std::int64_t time_ns = 0;
  UtcTime zero{};
  std::int64_t spread_ns = 0;
  std::uint64_t messages = 0;
  std::string source;
  bool operator==(const DeviceClock&) const = default;
};

struct VitalNotice {
  std::int64_t time_ns = 0;
  std::string notice;  // lower-case words with hyphens
  std::string text;    // one sentence for people
  std::string source;
  bool operator==(const VitalNotice&) const = default;
};

using VitalLine = std::variant<VitalSample, VitalText, DeviceAlarm, DeviceMessage, DeviceClock, VitalNotice>;

/// Case-clock time of arrival.
std::int64_t time_ns_of(const VitalLine& line);
void set_time_ns(VitalLine& line, std::int64_t time_ns);

/// The line, without LF. Throws kiroku::Error where it would not be one: a time that is not from 0 to 2^53 -
/// 1, text that is not UTF-8, no code, more than kMaximumVitalLineBytes, a sample with a problem.
std::string to_json_line(const VitalLine& line);

/// The line's content, or one sentence saying what is wrong with it. Never throws for what a line holds.
struct VitalLineParse {
  std::optional<VitalLine> line;
  std::string problem;
};
VitalLineParse parse_vital_line_of_any_kind(std::string_view line);

}  // namespace kiroku::media

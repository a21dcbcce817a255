// One vital sign as it is recorded, and its line in a vitals segment; the other lines such a segment may hold
// are in vital_line.h. Values; functions are pure and thread-safe.
//
// A vitals segment is JSON Lines: one object a line, UTF-8, LF after every line. The keys of a sample stand
// in docs/reference/format-streams.md, "Samples". A reader takes them in any order, with any blanks, and
// numbers and texts in any form of JSON; a key that is unknown or stands twice is refused. A writer writes
//
//   {"time_ns":1500000000,"code":"MDC_PULS_OXIM_SAT_O2","mdc":150456,"value":97.5,"unit":"%",
//    "source":"synthetic:patient","quality":"good"}
//
// always in this order and without blanks: numbers as the shortest decimal that reads back to the same double
// (std::to_chars), text escaped only where it must be: \", \\ and \u00xx for control characters. Numbers are
// always finite.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "base/utc_time.h"

namespace kiroku::media {

/// Bounds what a reader must hold to bring waveforms into the order of time.
inline constexpr std::int64_t kLongestWaveformNs = 60'000'000'000;
inline constexpr std::size_t kMaximumVitalLineBytes = 1U << 20;
/// Times of the case clock are below it: every reader of JSON takes such numbers exactly.
inline constexpr std::int64_t kTimeLimitNs = std::int64_t{1} << 53U;

enum class VitalQuality { kGood, kQuestionable, kInvalid, kMissing };
std::string_view quality_name(VitalQuality quality);
std::optional<VitalQuality> parse_quality(std::string_view name);

/// One quantity at one time, or a waveform: a block of evenly spaced values, oldest first. Value i of n was
/// measured at time_ns - (n - i) / rate_hz, so that a block is complete, and stamped, when its last value is.
/// (| values | = n >= 1, n / rate_hz <= kLongestWaveformNs, not all of them missing.) Its device_time is that
/// of time_ns, its end.
struct VitalSample {
  std::int64_t time_ns = 0;
  std::optional<UtcTime> device_time;
  std::string code;
  std::uint32_t mdc = 0;        // 0: unknown
  std::optional<double> value;  // nothing: a waveform, or quality missing
  double rate_hz = 0;           // above 0 for a waveform
  std::vector<double> values;   // of a waveform, else empty; NaN where one is missing
  std::string unit;
  std::string source;
  VitalQuality quality = VitalQuality::kGood;

  [[nodiscard]] bool is_waveform() const { return rate_hz > 0; }
  bool operator==(const VitalSample&) const = default;
};

/// Which rule above the sample breaks, as half a sentence ("the value is not finite"); "" if none.
std::string problem_of(const VitalSample& sample);

/// The line, without LF. Throws kiroku::Error where the sample breaks a rule above (a value that is not
/// finite, an empty code, a waveform too long, no value though the quality is not missing, …: problem_of).
std::string to_json_line(const VitalSample& sample);

/// The sample, or one sentence saying what is wrong with the line. Never throws for what a line holds.
struct VitalParse {
  std::optional<VitalSample> sample;
  std::string problem;
};
VitalParse parse_vital_line(std::string_view line);

class LineFields;
/// Likewise, of a line whose members were read already.
VitalParse read_vital_sample(LineFields& fields);

/// Case-clock time of value `index` of a waveform.
std::int64_t waveform_time_ns(const VitalSample& waveform, std::size_t index);

}  // namespace kiroku::media

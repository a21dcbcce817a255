// What of a case beside its pictures takes part in a comparison. Plain data; the function is thread-safe.
#pragma once

#include <compare>
#include <cstddef>
#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "archive/reading/case_reader.h"
#include "crypto/age_recipient.h"
#include "viewer/compare/step_matching.h"

namespace kiroku::compare {

/// A number of a monitor, of good quality.
struct VitalNumber {
  std::int64_t time_ns = 0;
  double value = 0;
};
/// Two monitors may send the same quantity, and need not agree.
struct VitalKey {
  std::string code;
  std::string device;  // as the samples say, else the stream's name
  auto operator<=>(const VitalKey&) const = default;
};
/// A pressure in mmHg; nothing of a unit that is not stated, or is none of a pressure.
std::optional<double> mmhg_of(double value, std::string_view unit);

/// One quantity of one device over time, in order, in one unit: where a device changes the unit, what follows
/// is a series of its own.
struct VitalSeries {
  std::string label, unit;
  std::vector<VitalNumber> numbers;
  std::string told_device = {};  // the device where several send this quantity, else ""
};

struct AlarmStart {
  std::int64_t time_ns = 0;
  std::string about;  // the code of the quantity, "" where the device did not say
  std::string text, priority;
};

/// What takes no part: what a device calls questionable or invalid, or the recorder, as where it may have
/// been measured before the case, of an earlier patient.
struct LeftOut {
  std::uint64_t questionable = 0, invalid = 0;  // numbers
  std::uint64_t alarms = 0;                     // that begin
  [[nodiscard]] bool any() const { return questionable + invalid + alarms > 0; }
  bool operator==(const LeftOut&) const = default;
};

struct CaseRecord {
  std::vector<Mark> marks;
  std::map<VitalKey, VitalSeries> vitals;  // waveforms are left out
  std::vector<AlarmStart> alarms;
  LeftOut left_out;
  /// Events to which the ledger commits and whose lines are not there: any of them may be a mark.
  std::size_t events_lacking = 0;
};

/// Marks of all events streams and numbers of all streams of vital signs. kiroku::Error naming the segment
/// that cannot be read, or is not what the ledger says.
CaseRecord read_case_record(const archive::CaseReader& recording, const crypto::AgeIdentities& identities);

}  // namespace kiroku::compare

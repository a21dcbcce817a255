// What of a case beside its pictures takes part in a comparison. Plain data; the function is thread-safe.
#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <vector>

#include "archive/case_reader.h"
#include "crypto/age_recipient.h"
#include "viewer/compare/step_matching.h"

namespace kiroku::compare {

/// A number of a monitor, of good or questionable quality.
struct VitalNumber {
  std::int64_t time_ns = 0;
  double value = 0;
};
/// One quantity over time, in order.
struct VitalSeries {
  std::string label, unit;
  std::vector<VitalNumber> numbers;
};

struct AlarmStart {
  std::int64_t time_ns = 0;
  std::string about;  // the code of the quantity, "" where the device did not say
  std::string text, priority;
};

struct CaseRecord {
  std::vector<Mark> marks;
  std::map<std::string, VitalSeries> vitals;  // by code; waveforms are left out
  std::vector<AlarmStart> alarms;
};

/// Marks of all events streams and numbers of all streams of vital signs. kiroku::Error naming the segment
/// that cannot be read, or is not what the ledger says.
CaseRecord read_case_record(const archive::CaseReader& recording, const crypto::AgeIdentities& identities);

}  // namespace kiroku::compare

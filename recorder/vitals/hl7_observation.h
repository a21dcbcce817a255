// One OBX segment, put in order: fields that a sender shifted are moved back, code and unit brought into the
// terms of the field. A value; functions are pure and thread-safe.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "media/vital_sample.h"
#include "recorder/vitals/hl7_message.h"
#include "recorder/vitals/hl7_time.h"
#include "recorder/vitals/mdc_terms.h"

namespace kiroku::recorder {

struct Observation {
  std::string set_id;              // OBX-1, for people
  std::string type;                // OBX-2: "NM", "NA", "ST", "CWE", …; "" where it says none
  Quantity quantity;               // OBX-3
  std::string sub_id;              // OBX-4: "1.3.1.150456"
  Hl7Field value;                  // OBX-5; a view into the message
  Unit unit;                       // OBX-6
  std::vector<std::string> flags;  // OBX-8
  std::string status;              // OBX-11: "R", "F", "X", …
  std::string time_text;           // OBX-14 as sent
  std::optional<Hl7Time> time;     // OBX-14, if it says when
  std::string method;              // OBX-17, all of it
  std::string rate_text;           // "500 Hz", wherever it stands in the segment; "" if nowhere
  std::vector<std::string> remarks;

  [[nodiscard]] bool has_flag(std::string_view flag) const;
  /// Only there to say which device, subsystem or channel the others belong to.
  [[nodiscard]] bool is_containment() const;
  /// "OBX 3 (MDC_PULS_OXIM_SAT_O2)".
  [[nodiscard]] std::string name() const;
};

/// `segment` must be an OBX; its message must outlive the observation.
Observation read_observation(const Hl7Segment& segment);

/// A decimal number, nothing else: "97", "+36.6", "-1e3"; not "", "97 %", "nan".
std::optional<double> parse_decimal(std::string_view text);
/// Whether a device that sends this number says that it has none: -999, -99.9, 32767, 8388607 and kin.
bool means_missing(double number);
/// The same for a value of a waveform, where small negative numbers occur.
bool means_missing_in_waveform(double number);

}  // namespace kiroku::recorder

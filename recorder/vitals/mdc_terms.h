// Codes and units of devices in the terms of the field: IEEE 11073-10101 reference identifiers and UCUM. Pure
// functions, thread-safe.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>

#include "recorder/vitals/hl7_message.h"

namespace kiroku::recorder {

/// What was observed. `code` is the MDC reference identifier; of a private or other code the triplet as it
/// was sent ("2267^COMEN_ACVPU^99COMEN"), so that nothing of it is lost.
struct Quantity {
  std::string code;
  std::uint32_t mdc = 0;  // 0: unknown
  std::string remark;     // half a sentence where name and number do not go together, "" else

  [[nodiscard]] bool is_attribute() const { return code.starts_with("MDC_ATTR_"); }
  /// Events and alarms, also those of the private range of the nomenclature.
  [[nodiscard]] bool is_event() const {
    return code.starts_with("MDC_EVT_") || code.starts_with("MDCX_EVT_");
  }
};

/// From a coded value (CE, CWE; OBX-3 and OBX-5): "150456^MDC_PULS_OXIM_SAT_O2^MDC", name and number the
/// other way round, the MDC triplet second after another system's, only a number, or a code of any other
/// system. `code` is empty if the field is.
Quantity quantity_of(const Hl7Field& field);

/// `unit` is UCUM ("%", "mm[Hg]", "/min"), "" where none is stated; as it was sent where it is not `known`.
struct Unit {
  std::string unit;
  bool known = true;
};
/// From OBX-6: "262688^MDC_DIM_PERCENT^MDC", "mL^mL^UCUM", "mmHg", …
Unit unit_of(const Hl7Field& field);
/// From the unit of a file: "mmHg", "uV", "bpm", …
Unit unit_of(std::string_view text);

/// The usual quantity for the label of a signal in a file ("II", "ABP", "PLETH", …, in any case), or the
/// label itself.
Quantity quantity_of_label(std::string_view label);

}  // namespace kiroku::recorder

// The vital signs this project names itself: IEEE 11073-10101 reference identifiers, numeric codes and UCUM
// units. Constant data; thread-safe. Sources that receive codes from a device pass them on as they are and
// need no entry here.
#pragma once

#include <cstdint>
#include <span>
#include <string_view>

namespace kiroku::media {

/// One quantity. `mdc` is partition * 65536 + term code; 0 for own codes outside the nomenclature.
struct VitalCode {
  std::string_view code;
  std::uint32_t mdc = 0;
  std::string_view unit;   // UCUM
  std::string_view label;  // for people
};

/// A mark that a synthetic source sets at the instant its picture flashes, to measure the skew of streams.
inline constexpr std::string_view kFlashCode = "KIROKU_FLASH";

/// All of them, sorted by code.
std::span<const VitalCode> vital_codes();
/// The entry for a reference identifier, or null.
const VitalCode* find_vital_code(std::string_view code);

}  // namespace kiroku::media

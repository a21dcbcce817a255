// Vital signs by their IEEE 11073-10101 reference identifiers, numeric codes and usual UCUM units: those this
// project names itself, and those it completes where a device gives only name or number. Constant data;
// thread-safe. Codes of a device that have no entry here are passed on as they are.
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
/// The entry for a numeric code, or null; null for 0.
const VitalCode* find_vital_code(std::uint32_t mdc);

}  // namespace kiroku::media

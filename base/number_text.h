// Numbers in sentences. Pure, thread-safe, independent of locale.
#pragma once

#include <cstdint>
#include <string>

namespace kiroku {

/// With at most `digits` significant ones: "0.5", "1e+300", "nan".
std::string number_text(double number, int digits = 6);

/// As few digits as read back to the bit.
std::string exact_text(double number);

/// "1 entry", "3 entries".
std::string counted(std::uint64_t number, const std::string& one, const std::string& many);

}  // namespace kiroku

// Numbers in sentences. Pure, thread-safe, independent of locale.
#pragma once

#include <string>

namespace kiroku {

/// With at most `digits` significant ones: "0.5", "1e+300", "nan".
std::string number_text(double number, int digits = 6);

/// As few digits as read back to the bit.
std::string exact_text(double number);

}  // namespace kiroku

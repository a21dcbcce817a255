// Numbers in sentences. Pure, thread-safe, independent of locale.
#pragma once

#include <string>

namespace kiroku::sim {

/// With at most `digits` significant ones: "0.5", "1e+300", "nan".
std::string number_text(double number, int digits = 6);

}  // namespace kiroku::sim

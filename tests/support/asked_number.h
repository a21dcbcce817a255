// How much a test tries: what the environment asks for, else its usual measure.
#pragma once

#include <cstdlib>
#include <string>

namespace kiroku::test {

/// The number in the variable called `name`; `usual` without it.
inline std::size_t asked_number(const char* name, std::size_t usual) {
  const char* const asked = std::getenv(name);
  return asked == nullptr ? usual : std::stoul(asked);
}

}  // namespace kiroku::test

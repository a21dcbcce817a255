// Numbers in the values of options. kiroku::UsageError names the option ("--zoom") and what it was given.
#pragma once

#include <cstddef>
#include <string>
#include <vector>

namespace kiroku::apps {

/// Finite.
double parse_number(const std::string& text, const std::string& what);
/// From `least` to `greatest`.
double parse_number(const std::string& text, const std::string& what, double least, double greatest);
/// Seconds of a length of time as people write it (base/time_text.h), from `least` to `greatest` seconds.
double parse_seconds(const std::string& text, const std::string& what, double least, double greatest);
/// A whole number from `least` to `greatest`.
std::size_t parse_count(const std::string& text, const std::string& what, std::size_t least,
                        std::size_t greatest);
/// So many numbers with `separator` between them.
std::vector<double> parse_numbers(const std::string& text, char separator, std::size_t count,
                                  const std::string& what);

}  // namespace kiroku::apps

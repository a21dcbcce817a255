#include "apps/sim/number_option.h"

#include <algorithm>
#include <charconv>

#include "base/error.h"
#include "base/number_text.h"
#include "base/time_text.h"
#include "sim/respiration/number_table.h"

namespace kiroku::apps {

double parse_number(const std::string& text, const std::string& what) {
  const auto number = sim::number_of(text);
  if (!number) throw UsageError(what + " is '" + text + "'; it must be a number");
  return *number;
}

double parse_number(const std::string& text, const std::string& what, double least, double greatest) {
  const auto number = sim::number_of(text);
  if (!number || !(*number >= least && *number <= greatest)) {
    throw UsageError(what + " is '" + text + "': it must be a number from " + number_text(least) + " to " +
                     number_text(greatest));
  }
  return *number;
}

double parse_seconds(const std::string& text, const std::string& what, double least, double greatest) {
  const auto ns = parse_time_text(text);
  const double seconds = ns ? static_cast<double>(*ns) / 1e9 : -1;
  if (!ns || seconds < least || seconds > greatest) {
    throw UsageError(what + " is '" + text + "', which is no length of time from " + number_text(least) +
                     "s to " + number_text(greatest) + "s: write " + std::string(kTimeForms));
  }
  return seconds;
}

std::size_t parse_count(const std::string& text, const std::string& what, std::size_t least,
                        std::size_t greatest) {
  std::size_t count = 0;
  const auto [end, failure] = std::from_chars(text.data(), text.data() + text.size(), count);
  if (failure != std::errc() || end != text.data() + text.size() || count < least || count > greatest) {
    throw UsageError(what + " is '" + text + "'; it must be a whole number from " + std::to_string(least) +
                     " to " + std::to_string(greatest));
  }
  return count;
}

std::vector<double> parse_numbers(const std::string& text, char separator, std::size_t count,
                                  const std::string& what) {
  std::vector<double> numbers;
  std::size_t begin = 0;
  while (begin <= text.size()) {
    const std::size_t end = std::min(text.find(separator, begin), text.size());
    const auto number = sim::number_of(text.substr(begin, end - begin));
    if (!number) break;
    numbers.push_back(*number);
    begin = end + 1;
  }
  if (numbers.size() != count || begin <= text.size()) {
    throw UsageError(what + " is '" + text + "'; it must be " + std::to_string(count) + " numbers with '" +
                     separator + "' between them");
  }
  return numbers;
}

}  // namespace kiroku::apps

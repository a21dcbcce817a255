#include "recorder/vitals/hl7_time.h"

#include <array>
#include <cstdio>
#include <string>

namespace kiroku::recorder {
namespace {

using std::chrono::hours;
using std::chrono::microseconds;
using std::chrono::minutes;
using std::chrono::seconds;

bool is_digit(char c) { return c >= '0' && c <= '9'; }

int number(std::string_view digits) {
  int value = 0;
  for (const char c : digits) {
    value = value * 10 + (c - '0');
  }
  return value;
}

std::string_view without_blanks(std::string_view text) {
  while (!text.empty() && text.front() == ' ') {
    text.remove_prefix(1);
  }
  while (!text.empty() && text.back() == ' ') {
    text.remove_suffix(1);
  }
  return text;
}

/// Takes "+0530", "+05:30" or "Z" from the end. False for one that cannot be.
bool take_zone(std::string_view& text, std::optional<minutes>& zone) {
  if (text.ends_with('Z')) {
    zone = minutes(0);
    text.remove_suffix(1);
    return true;
  }
  // A date may have hyphens: only what stands after a time of day is a zone.
  const std::size_t sign = text.find_last_of("+-");
  if (sign == std::string_view::npos || (text[sign] == '-' && sign < 10)) {
    // "2026-0500" does not occur; a zone after fewer digits than a date says nothing of an instant.
    return text.find('+') == std::string_view::npos;
  }
  std::string digits(text.substr(sign + 1));
  if (digits.size() == 5 && digits[2] == ':') {
    digits.erase(2, 1);
  }
  if (digits.size() != 4 || digits.find_first_not_of("0123456789") != std::string::npos) {
    return false;
  }
  const int hour = number(digits.substr(0, 2));
  const int minute = number(digits.substr(2));
  if (hour > 14 || minute > 59) {
    return false;
  }
  zone = minutes(hour * 60 + minute) * (text[sign] == '-' ? -1 : 1);
  text = text.substr(0, sign);
  return true;
}

/// "2026-01-24T13:15:40" as "20260124131540"; other text as it is.
std::string without_marks(std::string_view text) {
  std::string digits;
  for (std::size_t i = 0; i < text.size(); ++i) {
    const bool mark = ((i == 4 || i == 7) && text[i] == '-') ||
                      (i >= 8 && i <= 10 && (text[i] == 'T' || text[i] == ' ')) ||
                      (i >= 11 && text[i] == ':');
    if (!mark) {
      digits += text[i];
    }
  }
  return digits;
}

}  // namespace

std::optional<Hl7Time> parse_hl7_time(std::string_view text) {
  text = without_blanks(text);
  if (text.size() > 40) {
    return std::nullopt;
  }
  Hl7Time time;
  if (!take_zone(text, time.zone)) {
    return std::nullopt;
  }
  const std::string digits = without_marks(text);
  const std::size_t whole = std::min(digits.find('.'), digits.size());
  std::string fraction = whole < digits.size() ? digits.substr(whole + 1) : "";
  std::string date = digits.substr(0, whole);
  if (whole < digits.size() && (fraction.empty() || date.size() != 14)) {
    return std::nullopt;
  }
  constexpr std::size_t kWholeDigits = 14;
  if (date.size() > kWholeDigits) {
    fraction = date.substr(kWholeDigits);  // the dot was left out
    date.resize(kWholeDigits);
  }
  if (date.size() < 4 || date.size() % 2 != 0 || fraction.size() > 6 ||
      (date + fraction).find_first_not_of("0123456789") != std::string::npos) {
    return std::nullopt;
  }
  const auto part = [&](std::size_t begin, int otherwise) {
    return date.size() > begin ? number(std::string_view(date).substr(begin, 2)) : otherwise;
  };
  const int year = number(std::string_view(date).substr(0, 4));
  const std::chrono::year_month_day day{std::chrono::year(year),
                                        std::chrono::month(static_cast<unsigned>(part(4, 1))),
                                        std::chrono::day(static_cast<unsigned>(part(6, 1)))};
  const int hour = part(8, 0);
  const int minute = part(10, 0);
  const int second = part(12, 0);
  // 60 is a leap second.
  if (year < 1850 || !day.ok() || hour > 23 || minute > 59 || second > 60) {
    return std::nullopt;
  }
  const bool has_fraction = !fraction.empty();
  fraction.resize(6, '0');
  time.local = UtcTime(std::chrono::sys_days(day)) + hours(hour) + minutes(minute) + seconds(second) +
               microseconds(number(fraction));
  time.precision =
      has_fraction ? Hl7Time::Precision::kFraction : static_cast<Hl7Time::Precision>(date.size() / 2 - 2);
  return time;
}

std::string format_hl7_time(UtcTime time) {
  std::string text = format_utc(time);  // 2026-01-24T13:15:40.123456Z
  std::string digits;
  for (const char c : text.substr(0, text.size() - 4)) {
    if (is_digit(c) || c == '.') {
      digits += c;
    }
  }
  return digits + "+0000";
}

std::string format_hl7_zone(minutes zone) {
  const auto size = static_cast<int>(zone.count() < 0 ? -zone.count() : zone.count());
  std::array<char, 16> text{};
  std::snprintf(text.data(), text.size(), "%c%02d%02d", zone.count() < 0 ? '-' : '+', size / 60, size % 60);
  return text.data();
}

}  // namespace kiroku::recorder

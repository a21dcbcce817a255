#include "base/utc_time.h"

#include <array>
#include <cstdio>

namespace kiroku {
namespace {

using std::chrono::days;
using std::chrono::floor;
using std::chrono::hh_mm_ss;
using std::chrono::microseconds;
using std::chrono::year_month_day;

struct Fields {
  int year;
  unsigned month, day;
  int hour, minute, second, microsecond;
};

Fields fields_of(UtcTime time) {
  const auto day = floor<days>(time);
  const year_month_day date(day);
  const hh_mm_ss<microseconds> clock(time - day);
  return {int(date.year()),
          unsigned(date.month()),
          unsigned(date.day()),
          int(clock.hours().count()),
          int(clock.minutes().count()),
          int(clock.seconds().count()),
          int(clock.subseconds().count())};
}

/// Reads exactly `digits` decimal digits at `position` and moves it on; -1 where there are fewer.
int take_number(std::string_view text, std::size_t& position, int digits) {
  int value = 0;
  for (int i = 0; i < digits; ++i, ++position) {
    if (position >= text.size() || text[position] < '0' || text[position] > '9') return -1;
    value = value * 10 + (text[position] - '0');
  }
  return value;
}

bool take(std::string_view text, std::size_t& position, char expected) {
  if (position >= text.size() || text[position] != expected) return false;
  ++position;
  return true;
}

}  // namespace

std::string format_utc(UtcTime time) {
  const Fields f = fields_of(time);
  std::array<char, 64> text{};
  std::snprintf(text.data(), text.size(), "%04d-%02u-%02uT%02d:%02d:%02d.%06dZ", f.year, f.month, f.day,
                f.hour, f.minute, f.second, f.microsecond);
  return text.data();
}

std::string format_utc_compact(UtcTime time) {
  const Fields f = fields_of(time);
  std::array<char, 64> text{};
  std::snprintf(text.data(), text.size(), "%04d%02u%02uT%02d%02d%02dZ", f.year, f.month, f.day, f.hour,
                f.minute, f.second);
  return text.data();
}

std::optional<UtcTime> parse_utc(std::string_view text) {
  std::size_t at = 0;
  const int year = take_number(text, at, 4);
  if (year < 0 || !take(text, at, '-')) return {};
  const int month = take_number(text, at, 2);
  if (month < 0 || !take(text, at, '-')) return {};
  const int day = take_number(text, at, 2);
  if (day < 0 || !take(text, at, 'T')) return {};
  const int hour = take_number(text, at, 2);
  if (hour < 0 || hour > 23 || !take(text, at, ':')) return {};
  const int minute = take_number(text, at, 2);
  if (minute < 0 || minute > 59 || !take(text, at, ':')) return {};
  const int second = take_number(text, at, 2);
  if (second < 0 || second > 59) return {};
  int micro = 0;
  if (take(text, at, '.')) {
    int scale = 100'000;
    const std::size_t first = at;
    while (at < text.size() && text[at] >= '0' && text[at] <= '9') {
      if (at - first == 6) return {};
      micro += (text[at++] - '0') * scale;
      scale /= 10;
    }
    if (at == first) return {};
  }
  if (!take(text, at, 'Z') || at != text.size()) return {};
  const year_month_day date{std::chrono::year(year), std::chrono::month(unsigned(month)),
                            std::chrono::day(unsigned(day))};
  if (!date.ok()) return {};
  return UtcTime(std::chrono::sys_days(date)) + std::chrono::hours(hour) + std::chrono::minutes(minute) +
         std::chrono::seconds(second) + microseconds(micro);
}

UtcTime utc_now() { return floor<microseconds>(std::chrono::system_clock::now()); }

}  // namespace kiroku

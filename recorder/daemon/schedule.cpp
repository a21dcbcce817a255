#include "recorder/daemon/schedule.h"

#include <algorithm>
#include <array>
#include <charconv>

#include "base/error.h"

namespace kiroku::recorder {
namespace {

constexpr int kMinutesPerDay = 24 * 60;
constexpr std::array<std::string_view, 7> kDays{"sun", "mon", "tue", "wed", "thu", "fri", "sat"};

[[noreturn]] void refuse(std::string_view text, const std::string& why) {
  throw UsageError("'" + std::string(text) + "' is no window of time: " + why +
                   "; write it like \"mon-fri 07:30-16:00\" or \"daily 00:00-24:00\"");
}

std::size_t day_number(std::string_view day, std::string_view all) {
  const auto* found = std::find(kDays.begin(), kDays.end(), day);
  if (found == kDays.end()) refuse(all, "'" + std::string(day) + "' is no day");
  return static_cast<std::size_t>(found - kDays.begin());
}

std::bitset<7> parse_days(std::string_view text, std::string_view all) {
  std::bitset<7> days;
  if (text == "daily") return days.set();
  while (true) {
    const std::size_t comma = text.find(',');
    const std::string_view part = text.substr(0, comma);
    const std::size_t dash = part.find('-');
    const std::size_t first = day_number(part.substr(0, dash), all);
    const std::size_t last = dash == std::string_view::npos ? first : day_number(part.substr(dash + 1), all);
    for (std::size_t day = first;; day = (day + 1) % kDays.size()) {
      days.set(day);
      if (day == last) break;
    }
    if (comma == std::string_view::npos) return days;
    text.remove_prefix(comma + 1);
  }
}

int two_digits(std::string_view text, int largest, std::string_view all) {
  int value = -1;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (text.size() != 2 || error != std::errc() || end != text.data() + text.size() || value < 0 ||
      value > largest) {
    refuse(all, "'" + std::string(text) + "' is no part of a time");
  }
  return value;
}

int parse_minute(std::string_view text, std::string_view all) {
  if (text.size() != 5 || text[2] != ':') refuse(all, "'" + std::string(text) + "' is no time of day");
  const int minute = two_digits(text.substr(0, 2), 24, all) * 60 + two_digits(text.substr(3), 59, all);
  if (minute > kMinutesPerDay) refuse(all, "a day ends at 24:00");
  return minute;
}

}  // namespace

Schedule::Window Schedule::parse_window(std::string_view text) {
  const std::size_t blank = text.find(' ');
  if (blank == std::string_view::npos) refuse(text, "days, a blank and two times are needed");
  const std::string_view times = text.substr(blank + 1);
  const std::size_t dash = times.find('-');
  if (dash == std::string_view::npos) refuse(text, "it has no end");
  Window window;
  window.days = parse_days(text.substr(0, blank), text);
  window.begin_minute = parse_minute(times.substr(0, dash), text);
  window.end_minute = parse_minute(times.substr(dash + 1), text);
  if (window.begin_minute == kMinutesPerDay) refuse(text, "a window begins before 24:00");
  if (window.end_minute <= window.begin_minute) window.end_minute += kMinutesPerDay;
  return window;
}

Schedule Schedule::parse(const std::vector<std::string>& windows) {
  Schedule schedule;
  for (const std::string& text : windows) schedule.windows_.push_back(parse_window(text));
  return schedule;
}

bool Schedule::contains(const std::tm& local) const {
  const int minute = local.tm_hour * 60 + local.tm_min;
  const auto today = static_cast<std::size_t>(local.tm_wday);
  const std::size_t yesterday = (today + kDays.size() - 1) % kDays.size();
  return std::any_of(windows_.begin(), windows_.end(), [&](const Window& window) {
    const bool of_today = window.days[today] && minute >= window.begin_minute && minute < window.end_minute;
    return of_today || (window.days[yesterday] && minute + kMinutesPerDay < window.end_minute);
  });
}

std::tm local_time(UtcTime at) {
  const std::time_t seconds = std::chrono::system_clock::to_time_t(at);
  std::tm local{};
  ::localtime_r(&seconds, &local);
  return local;
}

}  // namespace kiroku::recorder

#include "viewer/report/figures_in_words.h"

#include <array>
#include <cstdio>
#include <cstdlib>
#include <string_view>

namespace kiroku::report {
namespace {

constexpr std::int64_t kMillisecond = 1'000'000;

template <typename... Values>
std::string print(const char* form, Values... values) {
  std::array<char, 64> text{};
  const int size = std::snprintf(text.data(), text.size(), form, values...);
  return {text.data(), static_cast<std::size_t>(size)};
}

}  // namespace

std::string utc_time(UtcTime time, bool fraction) {
  const std::string text = format_utc(time);  // 2026-08-05T09:15:02.000123Z
  return text.substr(0, 10) + " " + text.substr(11, fraction ? 15 : 8) + " UTC";
}

std::string case_time(std::int64_t ns, bool fraction) {
  const std::int64_t ms = std::llabs(ns) / kMillisecond;
  const std::int64_t seconds = ms / 1'000;
  std::string text = print("%s%lld:%02lld:%02lld", ns < 0 ? "-" : "", static_cast<long long>(seconds / 3'600),
                           static_cast<long long>(seconds / 60 % 60), static_cast<long long>(seconds % 60));
  if (fraction) text += print(".%03lld", static_cast<long long>(ms % 1'000));
  return text;
}

std::string byte_size(std::uint64_t bytes) {
  static constexpr auto kUnits = std::to_array<std::string_view>({"kB", "MB", "GB", "TB"});
  if (bytes < 1'000) return std::to_string(bytes) + " B";
  double value = static_cast<double>(bytes);
  std::size_t unit = 0;
  for (value /= 1'000; value >= 999.95 && unit + 1 < kUnits.size(); value /= 1'000) ++unit;
  return print("%.1f ", value) + std::string(kUnits[unit]);
}

std::string grouped(std::uint64_t number) {
  std::string text = std::to_string(number);
  for (std::size_t at = text.size(); at > 3; at -= 3) text.insert(at - 3, "\u00A0");
  return text;
}

std::string seconds_up(std::int64_t ns) {
  constexpr std::int64_t kTenth = 100 * kMillisecond;
  return print("%.1f", static_cast<double>((ns + kTenth - 1) / kTenth) / 10);
}

std::string signed_seconds(std::int64_t ns) { return print("%+.3f s", static_cast<double>(ns) / 1e9); }

}  // namespace kiroku::report

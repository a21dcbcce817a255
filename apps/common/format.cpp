#include "apps/common/format.h"

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <cstdio>
#include <ctime>
#include <optional>

#include "base/error.h"
#include "base/time_text.h"

namespace kiroku::apps {
namespace {

constexpr std::int64_t kLongestNs = 1000LL * 3600 * 1'000'000'000;

std::optional<double> parse_number(std::string_view text) {
  if (text.empty() || text.find_first_not_of("0123456789.") != std::string_view::npos) return {};
  double value = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error != std::errc() || end != text.data() + text.size()) return {};
  return value;
}

/// Length in characters, not bytes, of UTF-8 text.
std::size_t characters(std::string_view text) {
  return std::size_t(std::count_if(text.begin(), text.end(),
                                   [](char c) { return (static_cast<unsigned char>(c) & 0xc0U) != 0x80U; }));
}

}  // namespace

std::string format_bytes(std::uint64_t bytes) {
  constexpr std::array<const char*, 5> kUnits{"B", "kB", "MB", "GB", "TB"};
  double value = double(bytes);
  std::size_t unit = 0;
  while (value >= 999.5 && unit + 1 < kUnits.size()) {
    value /= 1000;
    ++unit;
  }
  std::array<char, 32> text{};
  const int decimals = unit == 0 || value >= 99.5 ? 0 : value >= 9.95 ? 1 : 2;
  std::snprintf(text.data(), text.size(), "%.*f %s", decimals, value, kUnits[unit]);
  return text.data();
}

std::string format_duration(std::int64_t nanoseconds) {
  const std::int64_t seconds = std::max<std::int64_t>(nanoseconds, 0) / 1'000'000'000;
  std::array<char, 48> text{};
  const auto hours = (long long)(seconds / 3600);
  const int minutes = int(seconds / 60 % 60), rest = int(seconds % 60);
  if (hours > 0) {
    std::snprintf(text.data(), text.size(), "%lld:%02d:%02d", hours, minutes, rest);
  } else {
    std::snprintf(text.data(), text.size(), "%d:%02d", minutes, rest);
  }
  return text.data();
}

std::string format_local(UtcTime time) {
  const std::time_t seconds =
      std::chrono::system_clock::to_time_t(std::chrono::floor<std::chrono::seconds>(time));
  std::tm fields{};
  if (::localtime_r(&seconds, &fields) == nullptr) return format_utc_for_people(time);
  std::array<char, 64> text{};
  std::strftime(text.data(), text.size(), "%Y-%m-%d %H:%M:%S %z", &fields);
  return text.data();
}

std::string format_utc_for_people(UtcTime time) {
  const std::string text = format_utc(time);
  return text.substr(0, 10) + " " + text.substr(11, 8) + " UTC";
}

std::chrono::nanoseconds parse_duration(std::string_view text, const std::string& what) {
  const std::optional<std::int64_t> ns = parse_time_text(text);
  if (!ns || *ns == 0 || *ns > kLongestNs) {
    throw UsageError(what + " is '" + std::string(text) + "', which is no length of time: write " +
                     std::string(kTimeForms));
  }
  return std::chrono::nanoseconds(*ns);
}

void require_unit(std::string_view text, const std::string& what) {
  const std::string stated = what + " is '" + std::string(text) + "', which ";
  if (!text.empty() && text.find_first_not_of("0123456789.") == std::string_view::npos)
    throw UsageError(stated + "does not say of what: write 24h, 15min or 90s");
  if (std::ranges::count(text, ':') == 1)
    throw UsageError(stated +
                     "may be hours and minutes, or minutes and seconds: write 24h, 15min or 0:15:00");
}

std::chrono::nanoseconds parse_stated_duration(std::string_view text, const std::string& what) {
  require_unit(text, what);
  const std::optional<std::int64_t> ns = parse_time_text(text);
  if (!ns || *ns == 0 || *ns > kLongestNs) {
    throw UsageError(what + " is '" + std::string(text) +
                     "', which is no length of time: write 24h, 15min, 90s, 1h30m or 1:30:00");
  }
  return std::chrono::nanoseconds(*ns);
}

std::int64_t parse_bit_rate(std::string_view text, const std::string& what) {
  std::string_view digits = text;
  double factor = 1;
  if (digits.ends_with('k')) factor = 1e3;
  if (digits.ends_with('M')) factor = 1e6;
  if (factor > 1) digits.remove_suffix(1);
  const auto number = parse_number(digits);
  if (!number || *number * factor < 1e3 || *number * factor > 1e9) {
    throw UsageError(what + " is '" + std::string(text) +
                     "', which is no bit rate between 1k and 1000M: write 4M or 800k");
  }
  return std::llround(*number * factor);
}

std::string format_table(const std::vector<std::vector<std::string>>& rows, std::string_view alignment,
                         std::size_t indent) {
  std::vector<std::size_t> widths;
  for (const auto& row : rows) {
    widths.resize(std::max(widths.size(), row.size()));
    for (std::size_t i = 0; i < row.size(); ++i) widths[i] = std::max(widths[i], characters(row[i]));
  }
  std::string out;
  for (const auto& row : rows) {
    std::string line(indent, ' ');
    for (std::size_t i = 0; i < row.size(); ++i) {
      const std::string padding(widths[i] - characters(row[i]), ' ');
      const bool right = i < alignment.size() && alignment[i] == 'r';
      if (i > 0) line += "  ";
      line += right ? padding + row[i] : row[i] + padding;
    }
    line.erase(line.find_last_not_of(' ') + 1);
    out += line + "\n";
  }
  return out;
}

}  // namespace kiroku::apps

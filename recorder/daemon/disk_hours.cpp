#include "recorder/daemon/disk_hours.h"

#include <algorithm>
#include <array>
#include <charconv>
#include <utility>

#include "base/error.h"
#include "recorder/source/source_address.h"

namespace kiroku::recorder {
namespace {

// Containers, sealing and hashes beside the encoder's bits.
constexpr double kOverhead = 1.08;
constexpr double kBitsPerByte = 8;
constexpr double kSecondsPerHour = 3600;
// FFV1 leaves of real pictures 30 to 60 %.
constexpr double kLosslessShare = 0.6;
constexpr double kMpeg2Bytes = 4e6 * kOverhead / kBitsPerByte;

using Known = RoomRate::Known;
constexpr std::array<std::pair<Known, const char*>, 5> kPhrases{
    {{Known::kNow, "as it records now"},
     {Known::kLastCase, "as its last case"},
     {Known::kConfigured, "by the bit rate in kiroku.toml"},
     {Known::kReckoned, "by size and rate of its pictures, 1920x1080 at 30 where none is stated"},
     {Known::kNot, "not known before its first case"}}};

/// A number at the beginning of a text; nothing where there is none above 0.
std::optional<double> number(std::string_view text) {
  double value = 0;
  const auto read = std::from_chars(text.data(), text.data() + text.size(), value);
  return read.ec == std::errc() && value > 0 ? std::optional(value) : std::nullopt;
}

/// Of pictures of that source as they come.
double raw_bytes_per_second(const std::string& source) {
  constexpr double kWidth = 1920, kHeight = 1080, kRate = 30, kBytesPerPixel = 2;
  SourceAddress address;
  try {
    address = parse_source_address(source, Presence::kNotLookedAt);
  } catch (const Error&) {
    // What nobody can open is told where it is opened.
  }
  const std::string size = address.option("size", ""), rate = address.option("rate", "");
  const std::size_t x = size.find('x');
  const auto width = number(size),
             height = x == std::string::npos ? std::nullopt : number(std::string_view(size).substr(x + 1));
  const std::size_t over = rate.find('/');  // "30000/1001"
  const double divisor =
      over == std::string::npos ? 1 : number(std::string_view(rate).substr(over + 1)).value_or(1);
  const double pixels = width && height ? *width * *height : kWidth * kHeight;
  return pixels * number(rate).value_or(kRate * divisor) / divisor * kBytesPerPixel;
}

}  // namespace

std::optional<ConfiguredRate> configured_bytes_per_second(const std::vector<ConfiguredVideo>& videos) {
  ConfiguredRate rate;
  for (const auto& [video, source] : videos) {
    if (video.profile == Profile::kMpeg2) {
      rate.bytes_per_second += static_cast<double>(video.bit_rate) * kOverhead / kBitsPerByte;
      continue;
    }
    const double share = video.profile == Profile::kLossless ? kLosslessShare : 1;
    rate.bytes_per_second += share * raw_bytes_per_second(source);
    rate.is_reckoned = true;
  }
  return rate.bytes_per_second > 0 ? std::optional(rate) : std::nullopt;
}

double bytes_per_second_to_come(const SessionStatus& session) {
  double rate = 0;
  for (const StreamStatus& stream : session.streams) {
    const std::string& profile = stream.profile_to_come.empty() ? stream.profile : stream.profile_to_come;
    if (profile == profile_name(Profile::kUncompressed)) rate += stream.raw_bytes_per_second;
    if (profile == profile_name(Profile::kLossless)) rate += kLosslessShare * stream.raw_bytes_per_second;
    if (profile == profile_name(Profile::kMpeg2)) rate += kMpeg2Bytes;
  }
  return rate;
}

RoomRate rate_of(std::string room, double now, double last_case, std::optional<ConfiguredRate> configured) {
  if (now > 0) return {std::move(room), Known::kNow, now};
  if (last_case > 0) return {std::move(room), Known::kLastCase, last_case};
  if (configured) {
    const Known known = configured->is_reckoned ? Known::kReckoned : Known::kConfigured;
    return {std::move(room), known, configured->bytes_per_second};
  }
  return {std::move(room), Known::kNot, 0};
}

DiskHours disk_hours(std::uint64_t free_bytes, const std::vector<RoomRate>& rooms) {
  DiskHours out;
  double rate = 0;
  for (const auto& [way, phrase] : kPhrases) {
    std::string names;
    for (const RoomRate& room : rooms) {
      if (room.known != way) continue;
      names += (names.empty() ? "" : ", ") + room.room;
      rate += room.bytes_per_second;
      out.are_at_most = out.are_at_most || way == Known::kNot;
    }
    if (!names.empty()) out.assumes += (out.assumes.empty() ? "" : "; ") + names + " " + phrase;
  }
  if (rate > 0) out.hours = static_cast<double>(free_bytes) / rate / kSecondsPerHour;
  return out;
}

bool is_short(const DiskHours& left, std::uint64_t free_bytes, std::size_t rooms, double hours) {
  if (left.hours) return *left.hours < hours;
  const double least = static_cast<double>(std::max<std::size_t>(1, rooms)) * kMpeg2Bytes;
  return static_cast<double>(free_bytes) / least / kSecondsPerHour < hours;
}

}  // namespace kiroku::recorder

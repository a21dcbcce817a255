#include "recorder/daemon/disk_hours.h"

#include <array>
#include <utility>

namespace kiroku::recorder {
namespace {

// Containers, sealing and hashes beside the encoder's bits.
constexpr double kOverhead = 1.08;
constexpr double kBitsPerByte = 8;
constexpr double kSecondsPerHour = 3600;

using Known = RoomRate::Known;
constexpr std::array<std::pair<Known, const char*>, 4> kPhrases{
    {{Known::kNow, "as it records now"},
     {Known::kLastCase, "as its last case"},
     {Known::kConfigured, "by the bit rate in kiroku.toml"},
     {Known::kNot, "not known before its first case"}}};

}  // namespace

std::optional<double> configured_bytes_per_second(const std::vector<VideoProfile>& videos) {
  double bits = 0;
  for (const VideoProfile& video : videos) {
    if (video.profile != Profile::kMpeg2) return {};
    bits += static_cast<double>(video.bit_rate);
  }
  if (bits <= 0) return {};
  return bits * kOverhead / kBitsPerByte;
}

double bytes_per_second_to_come(const SessionStatus& session) {
  constexpr double kLosslessShare = 0.6;
  constexpr double kMpeg2Bytes = 4e6 * kOverhead / kBitsPerByte;
  double rate = 0;
  for (const StreamStatus& stream : session.streams) {
    const std::string& profile = stream.profile_to_come.empty() ? stream.profile : stream.profile_to_come;
    if (profile == profile_name(Profile::kUncompressed)) rate += stream.raw_bytes_per_second;
    if (profile == profile_name(Profile::kLossless)) rate += kLosslessShare * stream.raw_bytes_per_second;
    if (profile == profile_name(Profile::kMpeg2)) rate += kMpeg2Bytes;
  }
  return rate;
}

RoomRate rate_of(std::string room, double now, double last_case, std::optional<double> configured) {
  if (now > 0) return {std::move(room), Known::kNow, now};
  if (last_case > 0) return {std::move(room), Known::kLastCase, last_case};
  if (configured) return {std::move(room), Known::kConfigured, *configured};
  return {std::move(room), Known::kNot, 0};
}

DiskHours disk_hours(std::uint64_t free_bytes, const std::vector<RoomRate>& rooms) {
  DiskHours out;
  double rate = 0;
  bool known = !rooms.empty();
  for (const auto& [way, phrase] : kPhrases) {
    std::string names;
    for (const RoomRate& room : rooms) {
      if (room.known != way) continue;
      names += (names.empty() ? "" : ", ") + room.room;
      rate += room.bytes_per_second;
      known = known && way != Known::kNot;
    }
    if (!names.empty()) out.assumes += (out.assumes.empty() ? "" : "; ") + names + " " + phrase;
  }
  if (known && rate > 0) out.hours = static_cast<double>(free_bytes) / rate / kSecondsPerHour;
  return out;
}

}  // namespace kiroku::recorder

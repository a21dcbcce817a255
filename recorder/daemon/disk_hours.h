// How long a disk lasts if every room records, and what that assumes: what `kiroku status`, `kiroku doctor`,
// /metrics and the journal say of it is this one figure. Pure functions, thread-safe.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "recorder/encoder/video_profile.h"
#include "recorder/session.h"

namespace kiroku::recorder {

/// What a room writes while it records.
struct RoomRate {
  /// How that is known. kNow: by what it writes now. kLastCase: by what its last case wrote at its end.
  /// kConfigured: by the bit rates that are asked for; real pictures mostly need less. kNot: not at all, as
  /// before the first case with a profile that has no bit rate.
  enum class Known { kNow, kLastCase, kConfigured, kNot };
  std::string room;
  Known known = Known::kNot;
  double bytes_per_second = 0;
};

/// Bytes in a second on the disk, containers and sealing included; nothing where a profile has no bit rate,
/// or there is no video.
std::optional<double> configured_bytes_per_second(const std::vector<VideoProfile>& videos);
/// Of a session whose streams of pictures have the profiles that they have or will have next, at most: FFV1
/// leaves of real pictures 30 to 60 % (docs/results/performance.md). MPEG-2 counts
/// with the usual 4 Mbit/s.
double bytes_per_second_to_come(const SessionStatus& session);
/// The best that is known of a room. `now` and `last_case` are bytes in a second, 0 where there is none. A
/// room that rests counts with what its last case wrote, so that the figure does not jump when a case begins
/// or ends.
RoomRate rate_of(std::string room, double now, double last_case, std::optional<double> configured);

struct DiskHours {
  std::optional<double> hours;  // nothing where the rate of a room is not known, or there is no room
  /// One phrase a way of knowing: "or-1 as it records now; or-2, or-3 by the bit rate in kiroku.toml".
  std::string assumes;
};
DiskHours disk_hours(std::uint64_t free_bytes, const std::vector<RoomRate>& rooms);

}  // namespace kiroku::recorder

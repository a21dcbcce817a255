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
  /// kConfigured: by the bit rates that are asked for; real pictures mostly need less. kReckoned: a profile
  /// has no bit rate, and its pictures count with the size and rate that their source's address states. kNot:
  /// not at all, as before the first case of a room without pictures.
  enum class Known { kNow, kLastCase, kConfigured, kReckoned, kNot };
  std::string room;
  Known known = Known::kNot;
  double bytes_per_second = 0;
};

/// A stream of pictures as it is configured.
struct ConfiguredVideo {
  VideoProfile video;
  std::string source;  // its address
};
struct ConfiguredRate {
  double bytes_per_second = 0;
  bool is_reckoned = false;  // a profile has no bit rate
};
/// Bytes in a second on the disk, containers and sealing included; nothing where there is no video. Where a
/// profile has no bit rate: of pictures as large and as many as the source's address states, else 1920x1080,
/// 30 a second, in 4:2:2; FFV1 counts with 60 % of that.
std::optional<ConfiguredRate> configured_bytes_per_second(const std::vector<ConfiguredVideo>& videos);
/// Of a session whose streams of pictures have the profiles that they have or will have next, at most: FFV1
/// leaves of real pictures 30 to 60 % (docs/results/performance.md). MPEG-2 counts
/// with the usual 4 Mbit/s.
double bytes_per_second_to_come(const SessionStatus& session);
/// The best that is known of a room. `now` and `last_case` are bytes in a second, 0 where there is none. A
/// room that rests counts with what its last case wrote, so that the figure does not jump when a case begins
/// or ends.
RoomRate rate_of(std::string room, double now, double last_case, std::optional<ConfiguredRate> configured);

struct DiskHours {
  std::optional<double> hours;  // nothing where the rate of no room is known, or there is no room
  bool are_at_most = false;     // the rate of a room is not known: the others alone count
  /// One phrase a way of knowing: "or-1 as it records now; or-2, or-3 by the bit rate in kiroku.toml".
  std::string assumes;
};
DiskHours disk_hours(std::uint64_t free_bytes, const std::vector<RoomRate>& rooms);
/// Whether it is full before so many hours have passed; where nobody knows, whether it would be with one
/// camera of the usual 4 Mbit/s in each of `rooms`.
bool is_short(const DiskHours& left, std::uint64_t free_bytes, std::size_t rooms, double hours);

}  // namespace kiroku::recorder

#include "recorder/daemon/room_rules.h"

#include <algorithm>

namespace kiroku::recorder {
namespace {

// Nothing came for so long: the signal has paused.
constexpr std::int64_t kSignalPauseNs = 1'000'000'000;

// A source that has delivered nothing of a new session may still be opening; after so long it is away.
constexpr std::int64_t kOpeningNs = 10'000'000'000;

// What ends a person's rest. Not while a slow disk or a busy machine keeps pictures of a live source waiting:
// the source must be lost, too, as one that says nothing is after some seconds (SourceGuard::Limits).
bool is_away(const StreamStatus& stream, std::int64_t now_ns) {
  return !stream.live && now_ns - stream.last_ns >= (stream.frames > 0 ? kSignalPauseNs : kOpeningNs);
}

std::int64_t last_sign_of_life_ns(const CaseSoFar& running) {
  const auto& streams = running.status.streams;
  const std::size_t deciding = running.video_streams == 0 ? streams.size() : running.video_streams;
  std::int64_t last_ns = 0;
  for (std::size_t i = 0; i < std::min(deciding, streams.size()); ++i)
    last_ns = std::max(last_ns, streams[i].last_ns);
  return last_ns;
}

}  // namespace

bool StartRules::schedule_wants_a_case(UtcTime now) {
  const bool in_window = !rules_.schedule.empty() && rules_.schedule.contains(local_time(now));
  if (!in_window) window_rests_ = false;
  return in_window && !window_rests_;
}

bool StartRules::signal_wants_a_case(const SessionStatus& now) {
  for (const StreamStatus& stream : now.streams) {
    if (stream.name != rules_.start_on_signal) continue;
    const bool present = stream.frames > 0 && now.now_ns - stream.last_ns < kSignalPauseNs;
    if (is_away(stream, now.now_ns)) signal_rests_ = false;  // the next signal is another procedure
    if (!present) {
      signal_since_ns_.reset();
    } else if (!signal_since_ns_) {
      signal_since_ns_ = now.now_ns;
    }
    return present && !signal_rests_ && now.now_ns - *signal_since_ns_ >= rules_.signal_lasts.count();
  }
  return false;
}

std::string rule_to_end(const RoomRules& rules, const CaseSoFar& running, UtcTime now) {
  const SessionStatus& status = running.status;
  if (status.now_ns - status.begins_ns >= (rules.longest_case - running.before).count())
    return "longest-case";
  const std::int64_t silent_since_ns = std::max(last_sign_of_life_ns(running), status.decided_ns);
  if (rules.stop_after_silence && status.now_ns - silent_since_ns > rules.stop_after_silence->count())
    return "silence";
  return running.begun_by_schedule && !rules.schedule.contains(local_time(now)) ? "schedule" : "";
}

}  // namespace kiroku::recorder

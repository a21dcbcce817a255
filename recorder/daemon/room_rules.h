// When a room begins and ends cases by itself.
#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>

#include "base/utc_time.h"
#include "recorder/daemon/schedule.h"
#include "recorder/session.h"

namespace kiroku::recorder {

/// When a room starts and stops by itself.
struct RoomRules {
  Schedule schedule;  // records inside its windows
  /// What was recorded so long before a case begins becomes part of it. Sources are open all the time then.
  std::chrono::nanoseconds pre_roll{0};
  /// A case begins when this stream (of pictures, or of vital signs) has delivered for `signal_lasts` without
  /// a pause; "": never. Needs a pre-roll, which holds what was delivered meanwhile.
  std::string start_on_signal;
  std::chrono::nanoseconds signal_lasts = std::chrono::seconds(3);
  /// A case in which no video (or, where there is none, no vital sign) came for so long is ended.
  std::optional<std::chrono::nanoseconds> stop_after_silence;
  /// A case is ended after so long; a forgotten one does not fill the disk.
  std::chrono::nanoseconds longest_case = std::chrono::hours(24);
  /// A case that was cut off less than this before the recorder starts is carried on by a new one; never, if
  /// nothing. After a case that an error or a full disk ended, another one is tried for so long.
  std::optional<std::chrono::nanoseconds> resume_within;
};

/// Whether a rule wants a case to begin. A person who ended one is not overruled: neither the window that is
/// open then nor the signal that is there then begins another, not even where another session has to open its
/// source anew. Not thread-safe.
class StartRules {
 public:
  /// `rules` must outlive it.
  explicit StartRules(const RoomRules& rules) : rules_(rules) {}
  /// Whether a window of the schedule is open.
  [[nodiscard]] bool schedule_wants_a_case(UtcTime now);
  /// Whether the signal has lasted; times are those of the session that records ahead.
  [[nodiscard]] bool signal_wants_a_case(const SessionStatus& now);
  void stopped_by_person() { window_rests_ = signal_rests_ = true; }
  /// Another session begins, and its clock at 0.
  void forget_signal() { signal_since_ns_.reset(); }

 private:
  const RoomRules& rules_;
  bool window_rests_ = false, signal_rests_ = false;
  std::optional<std::int64_t> signal_since_ns_;
};

/// What there is to know of a running case, for the rules that end one.
struct CaseSoFar {
  const SessionStatus& status;
  bool begun_by_schedule = false;      // its operation was
  std::chrono::nanoseconds before{0};  // recorded by the operation's earlier cases
  std::size_t video_streams = 0;  // the first ones of its status; with none, every stream is a sign of life
};

/// The rule that ends the case now, as the reason of its end: "longest-case", "silence", "schedule"; "" while
/// none does.
std::string rule_to_end(const RoomRules& rules, const CaseSoFar& running, UtcTime now);

}  // namespace kiroku::recorder

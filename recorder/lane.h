// One stream of a session from its source to its segments. A lane owns its threads; its session drives it
// from one thread.
#pragma once

#include <atomic>
#include <chrono>
#include <cstdint>
#include <mutex>
#include <optional>
#include <string>

#include "archive/writing/case_writer.h"
#include "recorder/clock/case_clock.h"
#include "recorder/clock/sleep_watch.h"
#include "recorder/fact_queue.h"
#include "recorder/segment_store.h"

namespace kiroku::recorder {

/// What people should hear about, and whether the session must end. Thread-safe.
class ProblemLog {
 public:
  /// Something a person should see; recording goes on.
  void report(const std::string& sentence);
  /// The disk is full, or another write failed: the case must be closed with what is there. The first one
  /// stands.
  void end_session(const std::string& close_reason, const std::string& sentence);

  [[nodiscard]] std::string latest() const;
  [[nodiscard]] std::string close_reason() const;  // "" while nothing forces an end

 private:
  mutable std::mutex mutex_;
  std::string latest_;
  std::string close_reason_;
};

/// What lanes share; outlives them.
struct LaneContext {
  const CaseClock& clock;
  SleepWatch& sleeps;
  SegmentStore& store;
  FactQueue& facts;
  ProblemLog& problems;
  std::chrono::nanoseconds segment_duration;
  std::optional<std::int64_t> end_ns;  // nothing is recorded from this case-clock time on
};

struct LaneStatus {
  bool live = false;  // something came lately
  std::uint64_t frames = 0, dropped = 0, segments = 0, bytes = 0;
  std::int64_t last_ns = 0;          // case-clock end of what was recorded
  std::int64_t durable_ns = 0;       // case-clock end of the last segment that was handed to the ledger
  std::uint64_t refused = 0;         // of senders who may not send
  unsigned stuck = 0;                // threads of its source that do not come back from its driver
  std::uint64_t given_up = 0;        // such threads since the recorder started
  std::string input;                 // what comes, as Source::input() says
  bool unboxed = false;              // as Source::is_unboxed() says
  std::string profile = {};          // of pictures: in which form the next one is archived
  std::string profile_to_come = {};  // asked for, and not begun yet; "": none
  double raw_bytes_per_second = 0;   // of pictures as they come, uncompressed; 0 before the first
  std::uint64_t elsewhere = 0;       // messages of other places, which are not recorded
};

class Lane {
 public:
  virtual ~Lane() = default;
  virtual void start() = 0;
  /// A case begins there, of what is recorded ahead. Thread-safe.
  virtual void case_begins(std::int64_t /*begins_ns*/) {}
  /// Asks the source to end; returns at once. Thread-safe.
  virtual void stop() = 0;
  /// Waits until everything is recorded and stated. Gaps that last until the end are stated up to `close_ns`.
  virtual void finish(std::int64_t close_ns) = 0;
  /// Whether nothing more comes, so that finish() would not cut anything off. Thread-safe.
  [[nodiscard]] virtual bool ended() const = 0;
  /// Whether the source had more when LaneContext::end_ns was reached. Thread-safe.
  [[nodiscard]] virtual bool reached_end() const = 0;
  /// Whether the source states its own times and goes as fast as it can, so that the clock says nothing of
  /// it.
  [[nodiscard]] virtual bool is_unpaced() const = 0;
  /// What is recorded from this time of the case clock on stands in another segment than what was recorded
  /// before. Returns at once. Thread-safe, as is_split_at(), which says whether it does.
  virtual void split_at(std::int64_t time_ns) = 0;
  [[nodiscard]] virtual bool is_split_at(std::int64_t time_ns) const = 0;
  [[nodiscard]] virtual LaneStatus status() const = 0;
  [[nodiscard]] virtual const std::string& name() const = 0;
};

/// The multiple of `duration` after `time_ns`.
std::int64_t next_boundary(std::int64_t time_ns, std::chrono::nanoseconds duration);
/// What a gap after a failed write is caused by: a full disk, or a machine that could not take what came.
archive::GapCause gap_cause_for(const std::exception& error);
/// The close reason for a failed write: "disk-full", or "error: <sentence>".
std::string close_reason_for(const std::exception& error);

}  // namespace kiroku::recorder

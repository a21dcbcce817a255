// One stream's segments on their way to the disk and the ledger.
#pragma once

#include <atomic>
#include <condition_variable>
#include <cstdint>
#include <deque>
#include <memory>
#include <mutex>
#include <string>
#include <thread>

#include "recorder/fact_queue.h"
#include "recorder/segment_store.h"

namespace kiroku::recorder {

/// Writes segments one after the other and makes them durable on a thread of its own, so that the writer
/// never waits for the disk: data each quarter of a second while a segment grows, everything when it ends;
/// then its entry goes to the ledger's writer. begin, write, end and give_up are called by one thread.
class StreamOutput {
 public:
  struct Ending {
    std::int64_t end_ns = 0;
    std::uint64_t frames = 0, dropped = 0;
  };

  StreamOutput(SegmentStore& store, std::size_t stream_index, archive::StreamInfo info, FactQueue& facts);
  /// Waits until everything handed over is durable and stated.
  ~StreamOutput();
  StreamOutput(const StreamOutput&) = delete;
  StreamOutput& operator=(const StreamOutput&) = delete;

  /// `profile`: of its pictures; "": the stream's.
  void begin(std::int64_t start_ns, std::int64_t first_pts, std::string time_base,
             std::string_view profile = {});
  /// Plaintext. Throws kiroku::IoError; then give_up() is all that is left.
  void write(ByteView plaintext);
  [[nodiscard]] bool is_open() const { return current_ != nullptr; }
  [[nodiscard]] std::uint64_t open_bytes() const;
  void end(const Ending& ending);
  /// After a failed write: keeps what is on disk, stated as incomplete.
  void give_up(const Ending& ending);
  /// Waits until everything handed over is durable and stated. Throws what went wrong on the way
  /// (kiroku::IoError).
  void drain();

  [[nodiscard]] std::uint64_t segments() const { return segments_; }
  [[nodiscard]] std::uint64_t bytes() const { return bytes_; }
  /// Case-clock end of the last segment whose entry has gone to the ledger's writer; 0 before the first.
  [[nodiscard]] std::int64_t claimed_until_ns() const { return claimed_until_ns_; }
  /// Where the segment begins that is open; INT64_MAX while none is. From any thread.
  [[nodiscard]] std::int64_t open_since_ns() const { return open_since_ns_; }
  [[nodiscard]] const archive::StreamInfo& info() const { return info_; }

 private:
  struct Handed {
    std::shared_ptr<archive::SegmentWriter> segment;
    archive::SegmentEntry entry;
    bool in_standby = false;
  };
  void tell(archive::SegmentEntry entry, bool in_standby);
  void run();
  [[nodiscard]] archive::SegmentEntry entry_for(const Ending& ending) const;

  SegmentStore& store_;
  const std::size_t stream_index_;
  const archive::StreamInfo info_;
  FactQueue& facts_;

  // The writing thread's.
  std::shared_ptr<archive::SegmentWriter> current_;
  archive::SegmentEntry entry_;
  bool in_standby_ = false;

  std::mutex mutex_;  // guards the six below
  std::condition_variable changed_;
  std::deque<Handed> handed_;
  std::shared_ptr<archive::SegmentWriter> growing_;
  std::uint64_t synced_bytes_ = 0;  // of growing_
  bool stopping_ = false;
  bool busy_ = false;
  std::exception_ptr failure_;

  std::atomic<std::uint64_t> segments_ = 0, bytes_ = 0;
  std::atomic<std::int64_t> claimed_until_ns_ = 0, open_since_ns_ = INT64_MAX;
  std::thread finisher_;
};

}  // namespace kiroku::recorder

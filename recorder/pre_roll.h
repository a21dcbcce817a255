// What was recorded ahead of a case that may begin: sealed segments in a standby folder, and the facts about
// them, as long as they are young enough. Thread-safe.
#pragma once

#include <chrono>
#include <cstdint>
#include <deque>
#include <filesystem>
#include <mutex>
#include <optional>
#include <vector>

#include "archive/upkeep/standby_folder.h"
#include "recorder/fact_queue.h"

namespace kiroku::recorder {

class PreRoll {
 public:
  /// Keeps segments whose end is not older than `keep`. `folder` must outlive the object.
  PreRoll(archive::StandbyFolder& folder, std::size_t streams, std::chrono::nanoseconds keep);

  /// In the order of the queue of facts.
  void add(Fact fact);
  /// Discards what is too old at `now_ns`, until decide() was called. Throws kiroku::IoError.
  void trim(std::int64_t now_ns);

  /// A case begins: from now on everything is kept, but for segments that begin before `not_before_ns`, which
  /// are discarded, also those that are handed over later. Returns where it begins: the start of the oldest
  /// segment that is kept, `now_ns` if there is none. Throws kiroku::IoError.
  std::int64_t decide(std::int64_t now_ns, std::int64_t not_before_ns = INT64_MIN);
  /// The case could not be made: old segments are discarded again.
  void reconsider();
  /// For each stream, what was discarded.
  [[nodiscard]] std::vector<archive::StreamTotal> gone() const;
  /// The facts that are kept, handed over once.
  std::vector<Fact> take();
  /// Where a segment of the folder lies, and its number in the case. After decide().
  [[nodiscard]] std::filesystem::path path_of(const archive::FileReference& file) const;
  void number(StandbySegment& segment) const;
  /// After decide(): false for one that is not to be kept, and is discarded. Throws kiroku::IoError.
  bool keeps(const StandbySegment& segment);
  /// A gap as far as it lies in the case; nothing if it does not.
  [[nodiscard]] std::optional<archive::GapEntry> within_case(archive::GapEntry gap) const;

  struct Amount {
    std::uint64_t segments = 0;
    std::int64_t duration_ns = 0;
  };
  /// What is held now.
  [[nodiscard]] Amount amount() const;
  /// What decide() discarded.
  [[nodiscard]] Amount left_out() const;

 private:
  void discard(const StandbySegment& segment);

  archive::StandbyFolder& folder_;
  const std::int64_t keep_ns_;
  mutable std::mutex mutex_;
  std::deque<Fact> facts_;
  std::vector<archive::StreamTotal> gone_;
  std::optional<std::int64_t> begins_ns_;  // once decided
  std::int64_t not_before_ns_ = INT64_MIN;
  Amount left_out_;
};

}  // namespace kiroku::recorder

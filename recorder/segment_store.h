// Where the segments of a session go: into its case; or, before a case has begun, into a standby folder, from
// which those that are still wanted are taken over. begin() may be called from any thread, also while enter()
// is.
#pragma once

#include <algorithm>
#include <cstdint>
#include <memory>
#include <mutex>
#include <vector>

#include "archive/upkeep/standby_folder.h"
#include "archive/writing/case_writer.h"

namespace kiroku::recorder {

class SegmentStore {
 public:
  /// `standby` may be null: then enter() is called before anything is begun. It must outlive the object.
  SegmentStore(archive::StandbyFolder* standby, std::size_t streams)
      : standby_(standby), next_(streams), starts_(streams) {}

  struct Begun {
    std::unique_ptr<archive::SegmentWriter> segment;
    std::uint64_t index = 0;  // in the case; in the standby folder where it lies there
    bool in_standby = false;
  };
  /// `start_ns` and `profile` as those of archive::SegmentEntry.
  Begun begin(std::size_t stream_index, std::int64_t start_ns, const std::string& profile = {}) {
    const std::lock_guard guard(mutex_);
    const std::uint64_t raw = next_.at(stream_index)++;
    if (writer_ == nullptr) {
      starts_.at(stream_index).push_back(start_ns);
      return {standby_->begin_segment(stream_index, raw, profile), raw, true};
    }
    const std::uint64_t index = raw - gone_.at(stream_index);
    return {writer_->begin_segment(stream_index, index, profile), index, false};
  }
  /// From now on segments go into the case. `gone` counts, for each stream, the segments of the standby
  /// folder that no case will hold, and those that begin before `not_before_ns` are none of it either: the
  /// case's numbers begin after them. Returns how many of these were not counted. `writer` must outlive the
  /// object.
  std::uint64_t enter(archive::CaseWriter& writer, std::vector<std::uint64_t> gone,
                      std::int64_t not_before_ns = INT64_MIN) {
    const std::lock_guard guard(mutex_);
    std::uint64_t more = 0;
    for (std::size_t i = 0; i < gone.size(); ++i) {
      // Segments of one stream begin in the order of their numbers.
      const auto end = std::ranges::lower_bound(starts_.at(i), not_before_ns);
      const auto before = static_cast<std::uint64_t>(end - starts_.at(i).begin());
      if (before <= gone[i]) continue;
      more += before - gone[i];
      gone[i] = before;
    }
    gone_ = std::move(gone);
    writer_ = &writer;
    return more;
  }

 private:
  archive::StandbyFolder* standby_;
  std::mutex mutex_;
  archive::CaseWriter* writer_ = nullptr;
  std::vector<std::uint64_t> next_, gone_;
  std::vector<std::vector<std::int64_t>> starts_;  // of each segment of the standby folder
};

}  // namespace kiroku::recorder

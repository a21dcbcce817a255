// Where the segments of a session go: into its case; or, before a case has begun, into a standby folder, from
// which those that are still wanted are taken over. begin() may be called from any thread, also while enter()
// is.
#pragma once

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
  SegmentStore(archive::StandbyFolder* standby, std::size_t streams) : standby_(standby), next_(streams) {}

  struct Begun {
    std::unique_ptr<archive::SegmentWriter> segment;
    std::uint64_t index = 0;  // in the case; in the standby folder where it lies there
    bool in_standby = false;
  };
  /// `profile` as archive::SegmentEntry::profile.
  Begun begin(std::size_t stream_index, const std::string& profile = {}) {
    const std::lock_guard guard(mutex_);
    const std::uint64_t raw = next_.at(stream_index)++;
    if (writer_ == nullptr) return {standby_->begin_segment(stream_index, raw, profile), raw, true};
    const std::uint64_t index = raw - gone_.at(stream_index);
    return {writer_->begin_segment(stream_index, index, profile), index, false};
  }
  /// From now on segments go into the case. `gone` counts, for each stream, the segments of the standby
  /// folder that no case will hold: the case's numbers begin after them. `writer` must outlive the object.
  void enter(archive::CaseWriter& writer, std::vector<std::uint64_t> gone) {
    const std::lock_guard guard(mutex_);
    gone_ = std::move(gone);
    writer_ = &writer;
  }

 private:
  archive::StandbyFolder* standby_;
  std::mutex mutex_;
  archive::CaseWriter* writer_ = nullptr;
  std::vector<std::uint64_t> next_, gone_;
};

}  // namespace kiroku::recorder

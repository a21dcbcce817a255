// Where segments are recorded ahead of a case that may begin (pre-roll): sealed like all others, in a hidden
// folder of the archive. begin_segment() may be called from any thread, the rest by one.
#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include "archive/format/ledger_entry.h"
#include "archive/writing/segment_writer.h"
#include "crypto/age_recipient.h"

namespace kiroku::archive {

class FileSystem;

/// The name of such a folder begins so. One that is found when nobody records was left by a recorder that
/// died.
inline constexpr std::string_view kStandbyPrefix = ".standby-";

class StandbyFolder {
 public:
  /// Makes `<archive>/.standby-<random>`. Throws kiroku::IoError.
  StandbyFolder(FileSystem& files, const std::filesystem::path& archive,
                const std::vector<StreamInfo>& streams, std::vector<crypto::AgeRecipients> recipients);
  /// Removes the folder with what is left in it.
  ~StandbyFolder();
  StandbyFolder(const StandbyFolder&) = delete;
  StandbyFolder& operator=(const StandbyFolder&) = delete;

  /// A new segment file; numbered as in a case, from 0 for each stream.
  /// `profile` as SegmentEntry::profile.
  std::unique_ptr<SegmentWriter> begin_segment(std::size_t stream_index, std::uint64_t segment_index,
                                               const std::string& profile = {});
  /// Where the file lies that commit() or salvage() returned.
  [[nodiscard]] std::filesystem::path path_of(const FileReference& file) const { return folder_ / file.file; }
  /// Removes a segment that no case will need. Throws kiroku::IoError.
  void discard(const FileReference& file);

 private:
  FileSystem& files_;
  std::filesystem::path folder_;
  std::vector<StreamInfo> streams_;
  std::vector<crypto::AgeRecipients> recipients_;
};

/// What is gone of recorders that died, and what could not be removed.
struct AbandonedStandby {
  struct Left {
    std::filesystem::path folder;
    std::string problem;
  };
  std::uint64_t segments = 0;  // in what was removed
  std::vector<Left> left;
};
/// Removes what recorders that died left. A folder that cannot be removed keeps no other one. Only when
/// nobody records into the archive. Throws kiroku::IoError where the archive cannot be listed.
AbandonedStandby remove_abandoned_standby(FileSystem& files, const std::filesystem::path& archive);

}  // namespace kiroku::archive

#include "archive/upkeep/standby_folder.h"

#include <array>
#include <optional>

#include "archive/format/case_layout.h"
#include "archive/format/segment_media.h"
#include "archive/storage/file_system.h"
#include "base/error.h"
#include "crypto/encoding.h"
#include "crypto/secret.h"

namespace kiroku::archive {

namespace {

namespace fs = std::filesystem;

std::string new_name() {
  std::array<std::byte, 4> random{};
  crypto::fill_random(random);
  return std::string(kStandbyPrefix) + crypto::to_hex(random);
}

std::uint64_t files_below(const FileReading& files, const fs::path& folder) {
  std::uint64_t count = 0;
  for (const std::string& name : files.names_in(folder)) {
    const std::optional<FileStatus> status = files.status(folder / name);
    if (status && status->kind == FileStatus::Kind::kFolder) {
      count += files_below(files, folder / name);
    } else if (status && status->kind == FileStatus::Kind::kRegular) {
      ++count;
    }
  }
  return count;
}

}  // namespace

StandbyFolder::StandbyFolder(FileSystem& files, const fs::path& archive,
                             const std::vector<StreamInfo>& streams,
                             std::vector<crypto::AgeRecipients> recipients)
    : files_(files), folder_(archive / new_name()), recipients_(std::move(recipients)) {
  files_.make_folder(folder_);
  files_.make_folder(folder_ / kSegmentsFolder);
  for (const StreamInfo& stream : streams) {
    streams_.push_back(stream);
    streams_.back().extension = *extension_of_media(stream.media);
    files_.make_folder(folder_ / kSegmentsFolder / stream.name);
  }
}

StandbyFolder::~StandbyFolder() {
  try {
    remove_tree(files_, folder_);
  } catch (const std::exception&) {  // NOLINT(bugprone-empty-catch): the next start removes it
  }
}

std::unique_ptr<SegmentWriter> StandbyFolder::begin_segment(std::size_t stream_index,
                                                            std::uint64_t segment_index,
                                                            const std::string& profile) {
  SegmentEntry begun;
  begun.index = segment_index;
  begun.profile = profile;
  const std::string relative = file_of(streams_.at(stream_index), begun);
  return std::make_unique<SegmentWriter>(files_, folder_ / relative, relative, recipients_.at(stream_index));
}

void StandbyFolder::discard(const FileReference& file) { files_.remove(path_of(file)); }

AbandonedStandby remove_abandoned_standby(FileSystem& files, const fs::path& archive) {
  AbandonedStandby result;
  std::vector<fs::path> abandoned;
  for (const std::string& name : files.names_in(archive)) {
    if (name.starts_with(kStandbyPrefix)) {
      abandoned.push_back(archive / name);
    }
  }
  for (const fs::path& folder : abandoned) {
    try {
      if (!files.is_folder(folder)) {
        continue;
      }
      const std::uint64_t segments = files_below(files, folder);
      remove_tree(files, folder);
      result.segments += segments;
    } catch (const Error& error) {
      result.left.push_back({folder, error.what()});
    }
  }
  return result;
}

}  // namespace kiroku::archive

#include "archive/upkeep/standby_folder.h"

#include <array>

#include "archive/format/case_layout.h"
#include "archive/storage/file_system.h"
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

}  // namespace

StandbyFolder::StandbyFolder(FileSystem& files, const fs::path& archive,
                             const std::vector<StreamInfo>& streams,
                             std::vector<crypto::AgeRecipients> recipients)
    : files_(files), folder_(archive / new_name()), recipients_(std::move(recipients)) {
  files_.make_folder(folder_);
  files_.make_folder(folder_ / kSegmentsFolder);
  for (const StreamInfo& stream : streams) {
    streams_.push_back(stream.name);
    extensions_.emplace_back(*extension_of_media(stream.media));
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
                                                            std::uint64_t segment_index) {
  const std::string relative =
      segment_path(streams_.at(stream_index), segment_index, extensions_.at(stream_index));
  return std::make_unique<SegmentWriter>(files_, folder_ / relative, relative, recipients_.at(stream_index));
}

void StandbyFolder::discard(const FileReference& file) { files_.remove(path_of(file)); }

std::uint64_t remove_abandoned_standby(FileSystem& files, const fs::path& archive) {
  std::uint64_t segments = 0;
  std::vector<fs::path> abandoned;
  for (const fs::directory_entry& entry : fs::directory_iterator(archive)) {
    if (entry.is_directory() && !entry.is_symlink() &&
        entry.path().filename().string().starts_with(kStandbyPrefix)) {
      abandoned.push_back(entry.path());
    }
  }
  for (const fs::path& folder : abandoned) {
    for (const fs::directory_entry& file : fs::recursive_directory_iterator(folder)) {
      segments += file.is_regular_file() ? 1U : 0U;
    }
    remove_tree(files, folder);
  }
  return segments;
}

}  // namespace kiroku::archive

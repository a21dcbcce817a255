#include "apps/verify/outside_note.h"

#include <utility>

#include "apps/common/file.h"

namespace kiroku::apps {

archive::OutsideNote load_outside_note(const std::filesystem::path& file) {
  return {file.string(), std::string(text_of(read_small_file(file, "the note")))};
}

std::vector<archive::OutsideNote> KeptOutside::newest(const std::vector<crypto::VerifierKey>& devices) const {
  std::vector<archive::OutsideNote> all = notes;
  for (const archive::OutsideCopy& copy : copies) {
    if (auto note = archive::newest_signed_note(copy, devices)) all.push_back(std::move(*note));
  }
  return all;
}

KeptOutside load_kept_outside(const std::vector<std::string>& files_and_copies) {
  KeptOutside kept;
  for (const std::string& named : files_and_copies) {
    std::error_code ignored;
    if (std::filesystem::is_directory(named, ignored)) {
      kept.copies.push_back(archive::read_outside_copy(named));
    } else {
      kept.notes.push_back(load_outside_note(named));
    }
  }
  return kept;
}

}  // namespace kiroku::apps

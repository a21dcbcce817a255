// Checkpoints that a person kept outside of what is verified. Functions; thread-safe.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "archive/verify/outside_copy.h"
#include "archive/verify/verify_options.h"

namespace kiroku::apps {

/// From a file. Nothing is judged here. Throws kiroku::Error where there is nothing to read.
archive::OutsideNote load_outside_note(const std::filesystem::path& file);

/// What was kept: notes, and earlier copies of a case or a log, whose notes all count.
struct KeptOutside {
  std::vector<archive::OutsideNote> notes;
  std::vector<archive::OutsideCopy> copies;

  /// The notes, and of each copy the newest one that these devices signed, for whoever takes one alone.
  [[nodiscard]] std::vector<archive::OutsideNote> newest(
      const std::vector<crypto::VerifierKey>& devices) const;
};
/// From files that hold a note each, and folders that are copies. Nothing is judged here. Throws
/// kiroku::Error where there is nothing to read.
KeptOutside load_kept_outside(const std::vector<std::string>& files_and_copies);

}  // namespace kiroku::apps

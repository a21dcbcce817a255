// Checkpoints of an appliance log that its own device signed, by the notes beside it. Functions;
// thread-safe. Whoever can write to the archive's disk puts other files there: those count for nothing.
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "archive/storage/file_system.h"
#include "crypto/hash.h"
#include "crypto/signed_note.h"

namespace kiroku::archive {

struct OwnCheckpoint {
  crypto::Checkpoint checkpoint;
  std::string note;
};

/// What a note says, whoever signed it.
std::optional<crypto::Checkpoint> text_of_note(std::string_view note);
/// What a note states, if the device signed it for its log.
std::optional<OwnCheckpoint> as_own(std::string note, const crypto::VerifierKey& device);
/// The checkpoint of that size in `folder` (of a log), if it is one that the device signed; with `root` only
/// if it is over that. Throws kiroku::IoError.
std::optional<OwnCheckpoint> checkpoint_of(const std::filesystem::path& folder,
                                           const crypto::VerifierKey& device, std::uint64_t size,
                                           const FileReading& files,
                                           const crypto::Sha256Digest* root = nullptr);
/// Sizes of the notes in checkpoints/ of `folder`, ascending, by their names. Throws kiroku::IoError.
std::vector<std::uint64_t> note_sizes_in(const FileReading& files, const std::filesystem::path& folder);
/// The roots over so many of a ledger's first lines, whatever they say, for `sizes` in ascending order; fewer
/// where there are fewer lines. Throws kiroku::IoError.
std::vector<crypto::Sha256Digest> roots_of_lines(const FileReading& files, const std::filesystem::path& file,
                                                 const std::vector<std::uint64_t>& sizes);
/// The largest of `sizes` (ascending) of which the device signed a checkpoint over the lines that are there;
/// 0: none. Throws kiroku::IoError.
std::uint64_t newest_that_fits(const FileReading& files, const std::filesystem::path& folder,
                               const crypto::VerifierKey& device, const std::vector<std::uint64_t>& sizes);

}  // namespace kiroku::archive

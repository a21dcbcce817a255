// One sealed segment of a case as plaintext by offset, once its ciphertext is known to be what the ledger
// says. Immutable after open(); read_at is thread-safe.
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <optional>

#include "archive/case_folder.h"
#include "archive/ledger_entry.h"
#include "crypto/age_file.h"
#include "media/checked_files.h"

namespace kiroku::media {

/// Told how many bytes more were read.
using ReadProgress = std::function<void(std::uint64_t more_bytes)>;

class SealedSegment : public crypto::ByteSource {
 public:
  /// Reads the file once to compare size and SHA-256 with the entry, then opens it. A segment with complete =
  /// false may be cut short: it is readable up to the first chunk that does not authenticate, and one that
  /// recovery found may be empty, where not even its header reached the disk. Throws kiroku::Error naming the
  /// file: not there, no regular file, not what the ledger says, damaged, none of the identities fits.
  static SealedSegment open(const archive::CaseFolder& folder, const archive::SegmentEntry& entry,
                            const crypto::AgeIdentities& identities, const ReadProgress& progress = {});

  /// The same; a file that `checked` holds is not read once more to compare it, and one that fits goes there.
  static SealedSegment open(const archive::CaseFolder& folder, const archive::SegmentEntry& entry,
                            const crypto::AgeIdentities& identities, CheckedFiles& checked);

  /// The same without comparing hashes, for whoever has done so: `sealed_file` is the whole path.
  static SealedSegment open_unchecked(const std::filesystem::path& sealed_file, bool complete,
                                      const crypto::AgeIdentities& identities);

  [[nodiscard]] std::uint64_t size() const override { return plaintext_ ? plaintext_->plaintext_size() : 0; }
  std::size_t read_at(std::uint64_t offset, std::span<std::byte> into) const override {
    return plaintext_ ? plaintext_->read_at(offset, into) : 0;
  }

 private:
  /// `compare` looks at the file before its first byte is decrypted, and may refuse it.
  static SealedSegment open_after(const archive::CaseFolder& folder, const archive::SegmentEntry& entry,
                                  const crypto::AgeIdentities& identities,
                                  const std::function<void(const archive::ReadableFile& file)>& compare);
  SealedSegment(std::unique_ptr<crypto::ByteSource> file, std::optional<crypto::AgeFile> plaintext)
      : file_(std::move(file)), plaintext_(std::move(plaintext)) {}

  std::unique_ptr<crypto::ByteSource> file_;  // on the heap: plaintext_ refers to it
  std::optional<crypto::AgeFile> plaintext_;  // nothing: none of it can be opened
};

}  // namespace kiroku::media

// One sealed segment of a case as plaintext by offset. Its ciphertext is known to be what the ledger says,
// and only the bytes that were hashed are decrypted (crypto/hashed_source.h). Immutable after open(); read_at
// is thread-safe.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <utility>

#include "archive/format/case_folder.h"
#include "archive/format/ledger_entry.h"
#include "archive/reading/sealed_source.h"
#include "crypto/age_file.h"
#include "crypto/hash_trails.h"

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

  /// The same; where `checked` has the trail of the entry's hash, the file is not hashed as a whole once
  /// more: each block is compared with the trail when it is read.
  static SealedSegment open(const archive::CaseFolder& folder, const archive::SegmentEntry& entry,
                            const crypto::AgeIdentities& identities, crypto::HashTrails& checked);

  /// The same of bytes that lie elsewhere than in a case's folder. Throws what `source` throws, too.
  static SealedSegment open(const archive::SealedSource& source, const archive::SegmentEntry& entry,
                            const crypto::AgeIdentities& identities, crypto::HashTrails& checked);

  /// Opens what somebody else compares with the ledger. `sealed` must outlive the object.
  static SealedSegment decrypt(const crypto::ByteSource& sealed, bool complete,
                               const crypto::AgeIdentities& identities);

  [[nodiscard]] std::uint64_t size() const override { return plaintext_ ? plaintext_->plaintext_size() : 0; }
  /// Throws crypto::SourceChanged where the file is no longer what was hashed.
  std::size_t read_at(std::uint64_t offset, std::span<std::byte> into) const override {
    return plaintext_ ? plaintext_->read_at(offset, into) : 0;
  }

 private:
  /// On the heap: the second refers to the first, and what decrypts to the second.
  struct Sealed {
    std::unique_ptr<crypto::ByteSource> bytes;
    std::string name;  // as errors say it
    std::optional<crypto::HashedSource> hashed;
  };

  static std::unique_ptr<Sealed> open_file(const archive::CaseFolder& folder,
                                           const archive::SegmentEntry& entry);
  static SealedSegment open_checked(std::unique_ptr<Sealed> sealed, const archive::SegmentEntry& entry,
                                    const crypto::AgeIdentities& identities, crypto::HashTrails& checked);
  static SealedSegment decrypt_hashed(std::unique_ptr<Sealed> sealed,
                                      std::shared_ptr<const crypto::HashTrail> trail,
                                      const archive::SegmentEntry& entry,
                                      const crypto::AgeIdentities& identities);
  SealedSegment(std::unique_ptr<Sealed> sealed, std::optional<crypto::AgeFile> plaintext)
      : sealed_(std::move(sealed)), plaintext_(std::move(plaintext)) {}

  std::unique_ptr<Sealed> sealed_;            // null where somebody else holds the file
  std::optional<crypto::AgeFile> plaintext_;  // nothing: none of it can be opened
};

}  // namespace kiroku::media

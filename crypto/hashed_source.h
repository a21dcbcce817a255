// Bytes that are decrypted are the bytes that were hashed. A file that is hashed and then read again may have
// changed in between. Here SHA-256 leaves a trail: its state at each block of the file. Whoever reads a block
// later puts it through the hash from the state before the block, which must lead to the state after it. A
// block that leads there is one with which the whole file has the same SHA-256.
#pragma once

#include <atomic>
#include <cstdint>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "base/bytes.h"
#include "base/error.h"
#include "crypto/byte_source.h"
#include "crypto/hash.h"
#include "crypto/openssl_handles.h"

namespace kiroku::crypto {

/// What is read now is not what was hashed before.
class SourceChanged : public Error {
 public:
  /// `offset` is of the first block that differs.
  SourceChanged(const std::string& name, std::uint64_t offset);
  [[nodiscard]] std::uint64_t offset() const { return offset_; }

 private:
  std::uint64_t offset_;
};

/// Where hashing begins.
struct HashBegin {
  std::uint64_t offset = 0;  // of the first byte that is hashed
  ByteView before;           // hashed before it
};

/// The states of SHA-256 along a source. Immutable; thread-safe. Some 220 bytes for each block.
class HashTrail {
 public:
  /// Half of what a core's second-level cache holds, so that the hash reads what the kernel just copied.
  static constexpr std::size_t kBlockBytes = 512U << 10U;
  /// Told how many bytes more were hashed.
  using Progress = std::function<void(std::uint64_t more_bytes)>;

  /// Hashes [begin.offset, source.size()), in order, each byte once. A source that became shorter gives a
  /// trail of what there was. `also` takes the same bytes of the source along the way, so that a file is read
  /// once for all its hashes. Throws whatever the source throws.
  static HashTrail of(const ByteSource& source, const HashBegin& begin = {}, const Progress& progress = {},
                      std::span<Hasher> also = {});

  [[nodiscard]] std::uint64_t begin() const { return begin_; }
  [[nodiscard]] std::uint64_t end() const { return end_; }
  [[nodiscard]] std::size_t blocks() const { return states_.size() - 1; }
  /// SHA-256 of all, with what was hashed before the first byte.
  [[nodiscard]] Sha256Digest digest() const;
  /// Whether these are the bytes of block `number` that were hashed.
  [[nodiscard]] bool holds(std::size_t number, ByteView block) const;

 private:
  explicit HashTrail(std::uint64_t begin) : begin_(begin), end_(begin) {}
  std::uint64_t begin_, end_;
  std::vector<DigestContext> states_;  // before each block, and after the last
};

/// A source of which only hashed bytes come out. Thread-safe.
class HashedSource final : public ByteSource {
 public:
  /// `source` must outlive the object and is named `name` in errors. `front` stands for the bytes before
  /// trail->begin() and is as long.
  HashedSource(const ByteSource& source, std::shared_ptr<const HashTrail> trail, std::string name,
               Bytes front = {});

  [[nodiscard]] const HashTrail& trail() const { return *trail_; }
  [[nodiscard]] std::uint64_t size() const override { return trail_->end(); }
  /// Throws SourceChanged if a block is not what was hashed, and at each call after that; whatever the source
  /// throws. The newest block is kept, so that small reads in order read and hash nothing twice.
  std::size_t read_at(std::uint64_t offset, std::span<std::byte> into) const override;
  /// Where a read met bytes that were not hashed: for whoever must be sure that nobody in between passed over
  /// the error.
  [[nodiscard]] std::optional<std::uint64_t> changed_at() const {
    const std::uint64_t at = changed_at_.load();
    return at == kNowhere ? std::nullopt : std::optional(at);
  }

 private:
  using Block = std::shared_ptr<const Bytes>;
  static constexpr std::uint64_t kNowhere = UINT64_MAX;
  [[nodiscard]] Block block(std::size_t number) const;

  const ByteSource& source_;
  std::shared_ptr<const HashTrail> trail_;
  std::string name_;
  Bytes front_;
  mutable std::atomic<std::uint64_t> changed_at_ = kNowhere;
  mutable std::mutex mutex_;  // guards the rest
  mutable std::size_t newest_number_ = SIZE_MAX;
  mutable Block newest_;
};

}  // namespace kiroku::crypto

#include "crypto/hashed_source.h"

#include <algorithm>
#include <cassert>
#include <cstring>
#include <utility>

namespace kiroku::crypto {
namespace {

[[noreturn]] void fail() { throw Error("cannot hash: OpenSSL reports " + last_openssl_error()); }

void update(const DigestContext& hash, ByteView bytes) {
  if (EVP_DigestUpdate(hash.get(), bytes.data(), bytes.size()) != 1) fail();
}

DigestContext sha256_of(ByteView bytes) {
  DigestContext hash(EVP_MD_CTX_new());
  if (!hash || EVP_DigestInit_ex2(hash.get(), EVP_sha256(), nullptr) != 1) fail();
  update(hash, bytes);
  return hash;
}

DigestContext copy_of(const DigestContext& hash) {
  DigestContext copy(EVP_MD_CTX_new());
  if (!copy || EVP_MD_CTX_copy_ex(copy.get(), hash.get()) != 1) fail();
  return copy;
}

Sha256Digest finish(DigestContext hash) {
  Sha256Digest digest;
  if (EVP_DigestFinal_ex(hash.get(), openssl_bytes(std::span<std::byte>(digest)), nullptr) != 1) fail();
  return digest;
}

}  // namespace

SourceChanged::SourceChanged(const std::string& name, std::uint64_t offset)
    : Error(name + " changed after it was hashed: from byte " + std::to_string(offset) +
            " on it holds other bytes, and nothing of them was used. Find out what writes to the file, or "
            "whether the disk fails, and try again"),
      offset_(offset) {}

HashTrail HashTrail::of(const ByteSource& source, const HashBegin& begin, const Progress& progress,
                        std::span<Hasher> also) {
  HashTrail trail(begin.offset);
  DigestContext hash = sha256_of(begin.before);
  trail.states_.push_back(copy_of(hash));
  const std::uint64_t size = source.size();
  Bytes buffer(static_cast<std::size_t>(std::min<std::uint64_t>(kBlockBytes, size)));
  while (trail.end_ < size) {
    const auto wanted = static_cast<std::size_t>(std::min<std::uint64_t>(kBlockBytes, size - trail.end_));
    const std::size_t got = source.read_at(trail.end_, std::span(buffer).first(wanted));
    if (got == 0) break;
    update(hash, ByteView(buffer).first(got));
    for (Hasher& each : also) each.update(ByteView(buffer).first(got));
    trail.states_.push_back(copy_of(hash));
    trail.end_ += got;
    if (progress) progress(got);
    if (got < wanted) break;
  }
  return trail;
}

Sha256Digest HashTrail::digest() const { return finish(copy_of(states_.back())); }

bool HashTrail::holds(std::size_t number, ByteView block) const {
  DigestContext hash = copy_of(states_[number]);
  update(hash, block);
  return finish(std::move(hash)) == finish(copy_of(states_[number + 1]));
}

HashedSource::HashedSource(const ByteSource& source, std::shared_ptr<const HashTrail> trail, std::string name,
                           Bytes front)
    : source_(source), trail_(std::move(trail)), name_(std::move(name)), front_(std::move(front)) {
  assert(front_.size() == trail_->begin());
}

HashedSource::Block HashedSource::block(std::size_t number) const {
  {
    const std::lock_guard guard(mutex_);
    if (newest_number_ == number) return newest_;
  }
  const std::uint64_t offset = trail_->begin() + std::uint64_t{number} * HashTrail::kBlockBytes;
  const std::uint64_t size = std::min<std::uint64_t>(HashTrail::kBlockBytes, trail_->end() - offset);
  auto bytes = std::make_shared<Bytes>(static_cast<std::size_t>(size));
  // Compared in memory that nobody else writes to: what the caller gets was in the hash.
  if (source_.read_at(offset, *bytes) != bytes->size() || !trail_->holds(number, *bytes)) {
    changed_at_ = offset;
    throw SourceChanged(name_, offset);
  }
  const std::lock_guard guard(mutex_);
  newest_number_ = number;
  newest_ = bytes;
  return bytes;
}

std::size_t HashedSource::read_at(std::uint64_t offset, std::span<std::byte> into) const {
  if (const auto changed = changed_at()) throw SourceChanged(name_, *changed);
  if (offset >= size()) return 0;
  into = into.first(static_cast<std::size_t>(std::min<std::uint64_t>(into.size(), size() - offset)));
  std::size_t filled = 0;
  if (offset < front_.size() && !into.empty()) {
    filled = std::min(into.size(), front_.size() - static_cast<std::size_t>(offset));
    std::memcpy(into.data(), front_.data() + offset, filled);
  }
  while (filled < into.size()) {
    const std::uint64_t at = offset + filled - trail_->begin();
    const Block bytes = block(static_cast<std::size_t>(at / HashTrail::kBlockBytes));
    const auto skipped = static_cast<std::size_t>(at % HashTrail::kBlockBytes);
    const std::size_t taken = std::min(into.size() - filled, bytes->size() - skipped);
    std::memcpy(into.data() + filled, bytes->data() + skipped, taken);
    filled += taken;
  }
  return filled;
}

}  // namespace kiroku::crypto

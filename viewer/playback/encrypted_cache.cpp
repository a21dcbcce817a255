#include "viewer/playback/encrypted_cache.h"

#include <array>
#include <cerrno>
#include <fcntl.h>
#include <system_error>
#include <unistd.h>
#include <utility>

#include "base/descriptor.h"
#include "base/error.h"
#include "crypto/byte_source.h"

namespace kiroku::playback {
namespace {

namespace fs = std::filesystem;

constexpr std::string_view kEnding = ".sealed";

std::array<std::byte, crypto::kAeadNonceSize> nonce_of(std::uint64_t number) {
  std::array<std::byte, crypto::kAeadNonceSize> nonce{};
  for (std::size_t i = 0; i < sizeof number; ++i) nonce[i] = static_cast<std::byte>(number >> (8 * i));
  return nonce;
}

bool write_whole(const fs::path& file, ByteView bytes) {
  constexpr int kOwnerOnly = 0600;
  const Descriptor descriptor(::open(file.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, kOwnerOnly));
  while (descriptor && !bytes.empty()) {
    const ssize_t count = ::write(descriptor.number(), bytes.data(), bytes.size());
    if (count < 0 && errno == EINTR) continue;
    if (count < 0) return false;
    bytes = bytes.subspan(static_cast<std::size_t>(count));
  }
  return static_cast<bool>(descriptor);
}

void remove_sealed(const fs::path& folder) {
  std::error_code failed;
  for (const fs::directory_entry& entry : fs::directory_iterator(folder, failed)) {
    if (entry.path().extension() == kEnding) {
      std::error_code ignored;
      fs::remove(entry.path(), ignored);
    }
  }
}

}  // namespace

EncryptedCache::EncryptedCache(fs::path folder, std::uint64_t most_bytes)
    : folder_(std::move(folder)),
      most_bytes_(most_bytes),
      key_(crypto::Secret::random(crypto::kAeadKeySize)) {
  std::error_code failed;
  fs::create_directories(folder_, failed);
  if (!failed) fs::permissions(folder_, fs::perms::owner_all, failed);
  if (failed) throw IoError("use the folder for viewing copies", folder_, failed.value());
  remove_sealed(folder_);
}

EncryptedCache::~EncryptedCache() { remove_sealed(folder_); }

fs::path EncryptedCache::file_of(std::uint64_t number) const {
  return folder_ / (std::to_string(number) + std::string(kEnding));
}

crypto::ChaCha20Poly1305 EncryptedCache::cipher() const { return crypto::ChaCha20Poly1305(key_.bytes()); }

std::optional<Bytes> EncryptedCache::get(const std::string& name) {
  std::uint64_t number = 0;
  {
    const std::lock_guard guard(mutex_);
    const auto item = items_.find(name);
    if (item == items_.end()) return std::nullopt;
    used_.splice(used_.end(), used_, item->second.used);
    number = item->second.number;
  }
  try {
    const auto file = crypto::open_file_source(file_of(number));
    Bytes sealed(file->size());
    if (sealed.size() >= crypto::kAeadTagSize && file->read_at(0, sealed) == sealed.size()) {
      Bytes plain(sealed.size() - crypto::kAeadTagSize);
      if (cipher().open(nonce_of(number), sealed, plain, bytes_of(name))) return plain;
    }
  } catch (const Error&) {
    // lost: as good as never made
  }
  const std::lock_guard guard(mutex_);
  const auto item = items_.find(name);
  if (item != items_.end() && item->second.number == number) forget(item);
  return std::nullopt;
}

void EncryptedCache::put(const std::string& name, ByteView bytes) {
  const std::uint64_t size = bytes.size() + crypto::kAeadTagSize;
  if (size > most_bytes_) return;
  std::uint64_t number = 0;
  {
    const std::lock_guard guard(mutex_);
    number = next_number_++;
    while (bytes_ + size > most_bytes_ && !used_.empty()) forget(items_.find(used_.front()));
  }
  Bytes sealed(size);
  cipher().seal(nonce_of(number), bytes, sealed, bytes_of(name));
  if (!write_whole(file_of(number), sealed)) {
    std::error_code ignored;
    fs::remove(file_of(number), ignored);
    return;
  }
  const std::lock_guard guard(mutex_);
  const auto before = items_.find(name);
  if (before != items_.end()) forget(before);
  items_.emplace(name, Item{number, size, used_.insert(used_.end(), name)});
  bytes_ += size;
}

void EncryptedCache::forget_ending(std::string_view end) {
  const std::lock_guard guard(mutex_);
  for (auto item = items_.begin(); item != items_.end();) {
    const auto at = item++;
    if (at->first.ends_with(end)) forget(at);
  }
}

std::uint64_t EncryptedCache::bytes() const {
  const std::lock_guard guard(mutex_);
  return bytes_;
}

void EncryptedCache::forget(std::map<std::string, Item>::iterator item) {
  std::error_code ignored;
  fs::remove(file_of(item->second.number), ignored);
  bytes_ -= item->second.bytes;
  used_.erase(item->second.used);
  items_.erase(item);
}

}  // namespace kiroku::playback

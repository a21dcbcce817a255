// What was computed from a patient's sealed pictures, kept on disk for a while and unreadable to everybody
// else: sealed with ChaCha20-Poly1305 under a key that exists in this object's memory alone. Thread-safe.
#pragma once

#include <cstdint>
#include <filesystem>
#include <list>
#include <map>
#include <mutex>
#include <optional>
#include <string>
#include <string_view>

#include "base/bytes.h"
#include "crypto/aead.h"
#include "crypto/secret.h"

namespace kiroku::playback {

class EncryptedCache {
 public:
  /// Makes the folder, readable by its owner alone, if it is not there, and removes what another object left
  /// in it: nobody can read that any more. One object a folder. At most `most_bytes` on disk: what was used
  /// least recently goes first. Throws kiroku::IoError if the folder cannot be used.
  EncryptedCache(std::filesystem::path folder, std::uint64_t most_bytes);
  /// Removes its files.
  ~EncryptedCache();
  EncryptedCache(const EncryptedCache&) = delete;
  EncryptedCache& operator=(const EncryptedCache&) = delete;

  /// What was put there under the name; nothing if it was not, has gone, or the file is damaged or lost.
  std::optional<Bytes> get(const std::string& name);
  /// Keeps a copy, if there is space: a cache that cannot be written to costs time, and nothing else.
  void put(const std::string& name, ByteView bytes);
  /// Forgets everything whose name ends so, and removes its files.
  void forget_ending(std::string_view end);
  /// On disk.
  [[nodiscard]] std::uint64_t bytes() const;

 private:
  struct Item {
    std::uint64_t number = 0;  // names the file, and is the nonce: never used twice
    std::uint64_t bytes = 0;
    std::list<std::string>::iterator used;
  };

  [[nodiscard]] std::filesystem::path file_of(std::uint64_t number) const;
  [[nodiscard]] crypto::ChaCha20Poly1305 cipher() const;
  /// The mutex is held.
  void forget(std::map<std::string, Item>::iterator item);

  const std::filesystem::path folder_;
  const std::uint64_t most_bytes_;
  const crypto::Secret key_;
  mutable std::mutex mutex_;  // guards the rest
  std::map<std::string, Item> items_;
  std::list<std::string> used_;  // the least recently used first
  std::uint64_t next_number_ = 0, bytes_ = 0;
};

}  // namespace kiroku::playback

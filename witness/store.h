// What a witness remembers: the logs that it knows, and of each the newest checkpoint that it cosigned.
// Thread-safe; other processes may use the same file and are waited for.
#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <vector>

#include "archive/catalogue/sqlite_file.h"
#include "crypto/signed_note.h"

namespace kiroku::witness {

/// The newest cosigned checkpoint of a log.
struct Latest {
  std::uint64_t size = 0;
  crypto::Sha256Digest root{};
  std::string note;  // with the log's signature and the witness's, as it is shown to monitors
};
struct KnownLog {
  std::string origin;
  std::vector<crypto::VerifierKey> keys;
  std::optional<Latest> latest;
};

class Store {
 public:
  /// Makes the database of a new witness, or leaves the one that is there. Throws kiroku::UsageError,
  /// kiroku::Error.
  static void make(const std::filesystem::path& file);
  /// One that is absent, empty or damaged is refused, never made anew: what it knew keeps the witness from
  /// cosigning two histories. Throws kiroku::UsageError, kiroku::Error.
  explicit Store(const std::filesystem::path& file);

  /// One more key of a log; false where it is known already.
  bool add_key(const std::string& origin, const crypto::VerifierKey& key);
  [[nodiscard]] std::vector<KnownLog> logs() const;
  [[nodiscard]] std::optional<KnownLog> log(const std::string& origin) const;
  /// By the SHA-256 of its origin, in hex.
  [[nodiscard]] std::optional<KnownLog> log_of_hash(const std::string& hash) const;

  /// Puts `next` in the place of the newest checkpoint, durably, if that still has `old_size` entries (0
  /// where there is none) and, at the same size, the same root; else changes nothing and returns false.
  /// Nobody else changes it in between.
  bool advance(const std::string& origin, std::uint64_t old_size, const Latest& next);

 private:
  mutable std::mutex mutex_;
  std::unique_ptr<archive::SqliteFile> database_;
};

}  // namespace kiroku::witness

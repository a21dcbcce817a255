// What of an archive is in the store already: a small database, which can be made anew, as the store tells
// the same. Not thread-safe; one process ships from a home at a time.
#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>

#include "archive/catalogue/sqlite_file.h"
#include "base/descriptor.h"
#include "base/utc_time.h"

namespace kiroku::fleet {

/// A file as it was when it was looked at.
struct FileState {
  std::uint64_t bytes = 0;
  UtcTime changed;
  bool operator==(const FileState&) const = default;
};

struct ShippedObject {
  FileState file;
  std::string sha256;   // hexadecimal
  std::string version;  // the store's; "" while it is only being sent
  UtcTime lock_ends;
  /// The store told of it with this size, hash and lock after it was put.
  bool confirmed = false;
};

class ShippingList {
 public:
  /// Opens or makes the file. `is_new` says whether there was none, or a damaged one that was set aside: the
  /// store may hold what the list does not know.
  explicit ShippingList(const std::filesystem::path& file);

  /// From now on this process alone ships by the list, so that nothing is put twice. Throws
  /// kiroku::UsageError where another one does, kiroku::IoError.
  void take();

  [[nodiscard]] bool is_new() const { return is_new_; }
  /// What is known of the object with this key.
  [[nodiscard]] std::optional<ShippedObject> find(const std::string& key);
  void put(const std::string& key, const ShippedObject& object);
  /// How far a ledger that still grows is in the store, in bytes from its beginning.
  [[nodiscard]] std::uint64_t grown(const std::string& recording);
  void set_grown(const std::string& recording, std::uint64_t bytes);

  struct Totals {
    std::uint64_t objects = 0, bytes = 0;
  };
  [[nodiscard]] Totals confirmed();

 private:
  const std::filesystem::path path_;
  bool is_new_;
  Descriptor lock_;
  std::unique_ptr<archive::SqliteFile> file_;
};

}  // namespace kiroku::fleet

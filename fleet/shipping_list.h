// What of an archive is in the store already: a small database, which can be made anew, as the store tells
// the same. Not thread-safe; one process ships from a home at a time.
#pragma once

#include <chrono>
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

/// The store told of it with this size, hash and lock after it was put.
struct ShippedObject {
  FileState file;
  std::string sha256;   // hexadecimal
  std::string version;  // the store's
  UtcTime lock_ends;
};

/// Writing is put together: one flush of the disk for each object would take longer than sending it. What a
/// crash loses of the list the store still tells.
class ShippingList {
 public:
  /// Opens or makes the file.
  explicit ShippingList(const std::filesystem::path& file);

  /// From now on this process alone ships by the list, so that nothing is put twice. Throws
  /// kiroku::UsageError where another one does, kiroku::IoError.
  void take();

  /// Whether the store may hold what the list does not know: the list is new, a process that shipped by it
  /// died, or an answer was lost.
  [[nodiscard]] bool may_be_behind() const { return may_be_behind_; }
  /// Something was put, and nobody knows whether the store took it.
  void doubt() { may_be_behind_ = true; }
  /// Before something is put into the store. Durable when it returns.
  void before_putting();
  /// Everything that was entered so far survives a crash.
  void keep();
  /// The same; and the list knows all that was put.
  void finish();

  /// What is known of the object with this key.
  [[nodiscard]] std::optional<ShippedObject> find(const std::string& key);
  void enter(const std::string& key, const ShippedObject& object);
  /// How far a ledger that still grows is in the store, from its beginning.
  struct Grown {
    std::uint64_t bytes = 0, lines = 0;
  };
  [[nodiscard]] Grown grown(const std::string& recording);
  void set_grown(const std::string& recording, const Grown& grown);
  /// How a folder was when all of it was in the store, as the shipper writes it; "" where it was not yet.
  [[nodiscard]] std::string whole(const std::string& recording);
  void set_whole(const std::string& recording, const std::string& state);

  /// Whether all that the store holds of a case was last confirmed to be under legal hold, or not to be;
  /// nothing where nobody looked.
  [[nodiscard]] std::optional<bool> hold(const std::string& case_id);
  void set_hold(const std::string& case_id, bool standing);
  /// When every object of a case under legal hold was last seen to be so in the store, and by which entries
  /// of the log it was held then.
  struct HoldCheck {
    std::string entries;
    UtcTime at;
  };
  [[nodiscard]] std::optional<HoldCheck> hold_check(const std::string& case_id);
  void set_hold_check(const std::string& case_id, const HoldCheck& check);

  /// How far it was looked whether locks in the store last as long as is asked for.
  struct LockLook {
    std::chrono::seconds retention{0};  // that was asked for
    std::string after_key = {};         // up to this key of the store's all were looked at
    std::uint64_t looked_at = 0, lengthened = 0, failed = 0;  // versions; asked about, and of these
    std::string problem = {};                                 // the first that failed
    bool finished = false;                                    // to the end
  };
  /// Nothing where nobody looked.
  [[nodiscard]] std::optional<LockLook> lock_look();
  void set_lock_look(const LockLook& look);

  struct Totals {
    std::uint64_t objects = 0, bytes = 0;
  };
  [[nodiscard]] Totals totals();

 private:
  void begin();
  void set_unfinished(bool unfinished);

  const std::filesystem::path path_;
  bool may_be_behind_, unfinished_ = false;
  Descriptor lock_;
  std::unique_ptr<archive::SqliteFile> file_;
  std::optional<archive::SqliteFile::Transaction> open_;  // after file_, which it uses
};

}  // namespace kiroku::fleet

#include "viewer/people/known_devices.h"

#include <mutex>
#include <sys/stat.h>

#include "archive/catalogue/sqlite_file.h"
#include "base/error.h"
#include "crypto/encoding.h"
#include "crypto/hash.h"
#include "viewer/people/session.h"

namespace kiroku::viewer {
namespace {

constexpr const char* kDevice = "device";
constexpr const char* kAddress = "address";

/// `key` is the SHA-256 of a cookie, or an address; `turn` counts up with each sign-in.
constexpr archive::SqliteFile::Schema kSchema{
    "list of known devices",
    "CREATE TABLE places (kind TEXT NOT NULL, key TEXT NOT NULL, user TEXT NOT NULL, credential TEXT NOT "
    "NULL, failures INTEGER NOT NULL, turn INTEGER NOT NULL, PRIMARY KEY (kind, key, user)) STRICT;"
    "PRAGMA user_version = 1;",
    1, "SELECT kind, key, user, credential, failures, turn FROM places LIMIT 1", true};

std::string hash_of(const std::string& token) { return crypto::to_hex(crypto::sha256(bytes_of(token))); }

}  // namespace

struct KnownDevices::State {
  std::unique_ptr<archive::SqliteFile> file;
  std::mutex mutex;

  bool has(const char* kind, const std::string& key, const Caller& caller) {
    auto row =
        file->statement("SELECT 1 FROM places WHERE kind = ? AND key = ? AND user = ? AND credential = ?");
    row.bind(kind).bind(key).bind(caller.user).bind(format_utc(caller.credential));
    return row.step();
  }
  Standing standing(const Caller& caller) {
    if (!caller.device.empty() && has(kDevice, hash_of(caller.device), caller)) return Standing::kKnownDevice;
    return has(kAddress, caller.holder, caller) ? Standing::kKnownAddress : Standing::kStranger;
  }
  std::int64_t next_turn() {
    auto row = file->statement("SELECT COALESCE(MAX(turn), 0) + 1 FROM places");
    row.step();
    return row.integer(0);
  }
  void put(const char* kind, const std::string& key, const Caller& caller, std::int64_t turn) {
    file->statement(
            "INSERT OR REPLACE INTO places (kind, key, user, credential, failures, turn) VALUES "
            "(?, ?, ?, ?, 0, ?)")
        .bind(kind)
        .bind(key)
        .bind(caller.user)
        .bind(format_utc(caller.credential))
        .bind(turn)
        .step();
    file->statement(
            "DELETE FROM places WHERE kind = ? AND user = ? AND turn NOT IN (SELECT turn FROM places "
            "WHERE kind = ? AND user = ? ORDER BY turn DESC LIMIT ?)")
        .bind(kind)
        .bind(caller.user)
        .bind(kind)
        .bind(caller.user)
        .bind(std::int64_t{kMostOfUser})
        .step();
  }
};

KnownDevices::KnownDevices(std::unique_ptr<State> state) : state_(std::move(state)) {}
KnownDevices::~KnownDevices() = default;

std::unique_ptr<KnownDevices> KnownDevices::open(const std::filesystem::path& file) {
  auto state = std::make_unique<State>();
  state->file = archive::SqliteFile::open(file, kSchema);
  if (::chmod(file.c_str(), 0600) != 0 && errno != EPERM) throw IoError("protect", file, errno);
  return std::unique_ptr<KnownDevices>(new KnownDevices(std::move(state)));
}

KnownDevices::Standing KnownDevices::standing(const Caller& caller) const {
  const std::lock_guard guard(state_->mutex);
  return state_->standing(caller);
}

std::string KnownDevices::remember(const Caller& caller) {
  std::string token = random_token();
  const std::string key = hash_of(token);
  const std::lock_guard guard(state_->mutex);
  archive::SqliteFile::Transaction transaction(*state_->file);
  // Several people may share a browser: the others' standing moves to the new cookie.
  if (!caller.device.empty()) {
    state_->file->statement("UPDATE places SET key = ? WHERE kind = ? AND key = ?")
        .bind(key)
        .bind(kDevice)
        .bind(hash_of(caller.device))
        .step();
  }
  const std::int64_t turn = state_->next_turn();
  state_->put(kDevice, key, caller, turn);
  state_->put(kAddress, caller.holder, caller, turn);
  transaction.commit();
  return token;
}

void KnownDevices::note_failure(const Caller& caller) {
  const std::lock_guard guard(state_->mutex);
  archive::SqliteFile::Transaction transaction(*state_->file);
  const Standing standing = state_->standing(caller);
  if (standing == Standing::kStranger) return;
  const bool by_device = standing == Standing::kKnownDevice;
  const char* const kind = by_device ? kDevice : kAddress;
  const std::string key = by_device ? hash_of(caller.device) : caller.holder;
  state_->file->statement("UPDATE places SET failures = failures + 1 WHERE kind = ? AND key = ? AND user = ?")
      .bind(kind)
      .bind(key)
      .bind(caller.user)
      .step();
  state_->file->statement("DELETE FROM places WHERE kind = ? AND key = ? AND user = ? AND failures >= ?")
      .bind(kind)
      .bind(key)
      .bind(caller.user)
      .bind(std::int64_t{kOwnFailures})
      .step();
  transaction.commit();
}

}  // namespace kiroku::viewer

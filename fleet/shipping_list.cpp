#include "fleet/shipping_list.h"

#include <cerrno>
#include <fcntl.h>
#include <sys/file.h>

#include "base/error.h"

namespace kiroku::fleet {
namespace {

constexpr archive::SqliteFile::Schema kSchema{
    "list of what is in the store",
    "CREATE TABLE object (key TEXT PRIMARY KEY, bytes INTEGER NOT NULL, changed_us INTEGER NOT NULL, sha256 "
    "TEXT NOT "
    "NULL, version TEXT NOT NULL, lock_ends_us INTEGER NOT NULL) WITHOUT ROWID;"
    "CREATE TABLE grown (recording TEXT PRIMARY KEY, up_to INTEGER NOT NULL, lines INTEGER NOT NULL) WITHOUT "
    "ROWID;"
    "CREATE TABLE whole (folder TEXT PRIMARY KEY, state TEXT NOT NULL) WITHOUT ROWID;"
    "CREATE TABLE state (unfinished INTEGER NOT NULL);"
    "INSERT INTO state VALUES (1);"
    "PRAGMA user_version = 1;",
    1,
    "SELECT key, bytes, changed_us, sha256, version, lock_ends_us, recording, up_to, lines, folder, "
    "whole.state, unfinished "
    "FROM object, grown, whole, state LIMIT 1"};

std::int64_t microseconds(UtcTime time) { return time.time_since_epoch().count(); }
UtcTime time_of(std::int64_t microseconds) { return UtcTime(std::chrono::microseconds(microseconds)); }

}  // namespace

ShippingList::ShippingList(const std::filesystem::path& file)
    : path_(file), may_be_behind_(true), file_(archive::SqliteFile::open(file, kSchema)) {
  // Lists that were made before there were legal holds, or before these or locks were looked at again, lack
  // them.
  file_
      ->statement(
          "CREATE TABLE IF NOT EXISTS hold (case_id TEXT PRIMARY KEY, standing INTEGER NOT NULL) WITHOUT "
          "ROWID")
      .step();
  file_
      ->statement(
          "CREATE TABLE IF NOT EXISTS hold_check (case_id TEXT PRIMARY KEY, entries TEXT NOT NULL, at_us "
          "INTEGER NOT NULL) WITHOUT ROWID")
      .step();
  file_
      ->statement(
          "CREATE TABLE IF NOT EXISTS lock_look (row INTEGER PRIMARY KEY CHECK (row = 1), retention_s "
          "INTEGER "
          "NOT NULL, after_key TEXT NOT NULL, looked_at INTEGER NOT NULL, lengthened INTEGER NOT NULL, "
          "failed INTEGER NOT NULL, problem TEXT NOT NULL, finished INTEGER NOT NULL)")
      .step();
  auto state = file_->statement("SELECT unfinished FROM state");
  may_be_behind_ = !state.step() || state.integer(0) != 0;
}

void ShippingList::take() {
  const std::filesystem::path lock = path_.string() + ".lock";
  lock_ = Descriptor(::open(lock.c_str(), O_RDWR | O_CREAT | O_CLOEXEC | O_NOFOLLOW, 0600));
  if (lock_.number() < 0) throw IoError("open", lock, errno);
  if (::flock(lock_.number(), LOCK_EX | LOCK_NB) == 0) return;
  if (errno != EWOULDBLOCK) throw IoError("lock", lock, errno);
  throw UsageError(
      "another 'kiroku ship' is at work on this home, kiroku-ship.service perhaps: there is nothing to do");
}

void ShippingList::begin() {
  if (!open_) open_.emplace(*file_);
}

void ShippingList::set_unfinished(bool unfinished) {
  begin();
  auto set = file_->statement("UPDATE state SET unfinished = ?");
  set.bind(std::int64_t{unfinished});
  set.step();
  unfinished_ = unfinished;
}

void ShippingList::before_putting() {
  if (unfinished_) return;
  set_unfinished(true);
  keep();
}

void ShippingList::keep() {
  if (!open_) return;
  open_->commit();
  open_.reset();
}

void ShippingList::finish() {
  if (unfinished_ || may_be_behind_) set_unfinished(false);
  keep();
  may_be_behind_ = false;
}

std::optional<ShippedObject> ShippingList::find(const std::string& key) {
  auto found =
      file_->statement("SELECT bytes, changed_us, sha256, version, lock_ends_us FROM object WHERE key = ?");
  found.bind(std::string_view(key));
  if (!found.step()) return {};
  return ShippedObject{{static_cast<std::uint64_t>(found.integer(0)), time_of(found.integer(1))},
                       found.text(2),
                       found.text(3),
                       time_of(found.integer(4))};
}

void ShippingList::enter(const std::string& key, const ShippedObject& object) {
  begin();
  auto put = file_->statement("INSERT OR REPLACE INTO object VALUES (?, ?, ?, ?, ?, ?)");
  put.bind(std::string_view(key))
      .bind(static_cast<std::int64_t>(object.file.bytes))
      .bind(microseconds(object.file.changed))
      .bind(std::string_view(object.sha256))
      .bind(std::string_view(object.version))
      .bind(microseconds(object.lock_ends));
  put.step();
}

ShippingList::Grown ShippingList::grown(const std::string& recording) {
  auto found = file_->statement("SELECT up_to, lines FROM grown WHERE recording = ?");
  found.bind(std::string_view(recording));
  if (!found.step()) return {};
  return {static_cast<std::uint64_t>(found.integer(0)), static_cast<std::uint64_t>(found.integer(1))};
}

void ShippingList::set_grown(const std::string& recording, const Grown& grown) {
  begin();
  auto put = file_->statement("INSERT OR REPLACE INTO grown VALUES (?, ?, ?)");
  put.bind(std::string_view(recording))
      .bind(static_cast<std::int64_t>(grown.bytes))
      .bind(static_cast<std::int64_t>(grown.lines));
  put.step();
}

std::string ShippingList::whole(const std::string& recording) {
  auto found = file_->statement("SELECT state FROM whole WHERE folder = ?");
  found.bind(std::string_view(recording));
  return found.step() ? found.text(0) : "";
}

void ShippingList::set_whole(const std::string& recording, const std::string& state) {
  begin();
  auto put = file_->statement("INSERT OR REPLACE INTO whole VALUES (?, ?)");
  put.bind(std::string_view(recording)).bind(std::string_view(state));
  put.step();
}

std::optional<bool> ShippingList::hold(const std::string& case_id) {
  auto found = file_->statement("SELECT standing FROM hold WHERE case_id = ?");
  found.bind(std::string_view(case_id));
  if (!found.step()) return {};
  return found.integer(0) != 0;
}

void ShippingList::set_hold(const std::string& case_id, bool standing) {
  begin();
  auto put = file_->statement("INSERT OR REPLACE INTO hold VALUES (?, ?)");
  put.bind(std::string_view(case_id)).bind(std::int64_t{standing});
  put.step();
}

std::optional<ShippingList::HoldCheck> ShippingList::hold_check(const std::string& case_id) {
  auto found = file_->statement("SELECT entries, at_us FROM hold_check WHERE case_id = ?");
  found.bind(std::string_view(case_id));
  if (!found.step()) return {};
  return HoldCheck{found.text(0), time_of(found.integer(1))};
}

void ShippingList::set_hold_check(const std::string& case_id, const HoldCheck& check) {
  begin();
  auto put = file_->statement("INSERT OR REPLACE INTO hold_check VALUES (?, ?, ?)");
  put.bind(std::string_view(case_id)).bind(std::string_view(check.entries)).bind(microseconds(check.at));
  put.step();
}

std::optional<ShippingList::LockLook> ShippingList::lock_look() {
  auto found = file_->statement(
      "SELECT retention_s, after_key, looked_at, lengthened, failed, problem, finished FROM lock_look");
  if (!found.step()) return {};
  const auto count = [&](int column) { return static_cast<std::uint64_t>(found.integer(column)); };
  return LockLook{.retention = std::chrono::seconds(found.integer(0)),
                  .after_key = found.text(1),
                  .looked_at = count(2),
                  .lengthened = count(3),
                  .failed = count(4),
                  .problem = found.text(5),
                  .finished = found.integer(6) != 0};
}

void ShippingList::set_lock_look(const LockLook& look) {
  begin();
  auto put = file_->statement("INSERT OR REPLACE INTO lock_look VALUES (1, ?, ?, ?, ?, ?, ?, ?)");
  put.bind(static_cast<std::int64_t>(look.retention.count()))
      .bind(std::string_view(look.after_key))
      .bind(static_cast<std::int64_t>(look.looked_at))
      .bind(static_cast<std::int64_t>(look.lengthened))
      .bind(static_cast<std::int64_t>(look.failed))
      .bind(std::string_view(look.problem))
      .bind(std::int64_t{look.finished});
  put.step();
}

ShippingList::Totals ShippingList::totals() {
  auto summed = file_->statement("SELECT count(*), coalesce(sum(bytes), 0) FROM object");
  summed.step();
  return {static_cast<std::uint64_t>(summed.integer(0)), static_cast<std::uint64_t>(summed.integer(1))};
}

}  // namespace kiroku::fleet

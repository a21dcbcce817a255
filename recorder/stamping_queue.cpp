#include "recorder/stamping_queue.h"

#include <chrono>
#include <mutex>
#include <utility>

#include "archive/catalogue/sqlite_file.h"

namespace kiroku::recorder {
namespace {

using archive::SqliteFile;
using archive::SqliteStatement;

constexpr SqliteFile::Schema kSchema{"stamping queue", R"(
  CREATE TABLE wanted (
    case_id    TEXT NOT NULL,
    authority  TEXT NOT NULL,
    checkpoint INTEGER NOT NULL,  -- tree size
    since_us   INTEGER NOT NULL,  -- microseconds since 1970, UTC, as are all times here
    attempts   INTEGER NOT NULL,
    last_error TEXT NOT NULL,
    PRIMARY KEY (case_id, authority)
  ) STRICT;
  CREATE TABLE authorities (
    name          TEXT PRIMARY KEY,
    failures      INTEGER NOT NULL,
    written_us    INTEGER NOT NULL,
    limit_us      INTEGER NOT NULL,
    next_us       INTEGER NOT NULL,
    path          TEXT NOT NULL,
    last_error    TEXT NOT NULL,
    last_token_us INTEGER
  ) STRICT;
  PRAGMA user_version = 1;
)",
                                     1, "SELECT 1 FROM wanted, authorities WHERE attempts = last_token_us"};

std::int64_t microseconds(UtcTime time) { return time.time_since_epoch().count(); }
UtcTime time_of(std::int64_t us) { return UtcTime(std::chrono::microseconds(us)); }

}  // namespace

struct StampingQueue::State {
  explicit State(std::unique_ptr<SqliteFile> the_database) : database(std::move(the_database)) {}
  std::mutex mutex;
  std::unique_ptr<SqliteFile> database;
};

StampingQueue::StampingQueue(std::unique_ptr<State> state) : state_(std::move(state)) {}
StampingQueue::~StampingQueue() = default;

std::unique_ptr<StampingQueue> StampingQueue::open(const std::filesystem::path& file) {
  return std::unique_ptr<StampingQueue>(
      new StampingQueue(std::make_unique<State>(SqliteFile::open(file, kSchema))));
}

void StampingQueue::want(const std::string& case_id, const std::string& authority, std::uint64_t checkpoint,
                         UtcTime now) {
  const std::lock_guard guard(state_->mutex);
  state_->database
      ->statement(R"(
    INSERT INTO wanted (case_id, authority, checkpoint, since_us, attempts, last_error) VALUES (?, ?, ?, ?, 0, '')
    ON CONFLICT (case_id, authority) DO UPDATE SET checkpoint = max(checkpoint, excluded.checkpoint))")
      .bind(case_id)
      .bind(authority)
      .bind(static_cast<std::int64_t>(checkpoint))
      .bind(microseconds(now))
      .step();
}

void StampingQueue::failed(const std::string& case_id, const std::string& authority,
                           const std::string& error) {
  const std::lock_guard guard(state_->mutex);
  state_->database
      ->statement(
          "UPDATE wanted SET attempts = attempts + 1, last_error = ? WHERE case_id = ? AND authority = ?")
      .bind(error)
      .bind(case_id)
      .bind(authority)
      .step();
}

void StampingQueue::done(const std::string& case_id, const std::string& authority, std::uint64_t checkpoint) {
  const std::lock_guard guard(state_->mutex);
  state_->database->statement("DELETE FROM wanted WHERE case_id = ? AND authority = ? AND checkpoint <= ?")
      .bind(case_id)
      .bind(authority)
      .bind(static_cast<std::int64_t>(checkpoint))
      .step();
}

void StampingQueue::drop(const std::string& case_id, const std::string& authority) {
  const std::lock_guard guard(state_->mutex);
  state_->database->statement("DELETE FROM wanted WHERE case_id = ? AND authority = ?")
      .bind(case_id)
      .bind(authority)
      .step();
}

std::vector<WantedToken> StampingQueue::list() const {
  const std::lock_guard guard(state_->mutex);
  std::vector<WantedToken> list;
  SqliteStatement rows = state_->database->statement(
      "SELECT case_id, authority, checkpoint, since_us, attempts, last_error FROM wanted "
      "ORDER BY since_us, case_id, authority");
  while (rows.step()) {
    list.push_back({rows.text(0), rows.text(1), static_cast<std::uint64_t>(rows.integer(2)),
                    time_of(rows.integer(3)), static_cast<std::uint64_t>(rows.integer(4)), rows.text(5)});
  }
  return list;
}

std::optional<AuthorityRecord> StampingQueue::authority(const std::string& name) const {
  const std::lock_guard guard(state_->mutex);
  SqliteStatement row = state_->database->statement(
      "SELECT failures, written_us, limit_us, next_us, path, last_error, last_token_us FROM authorities "
      "WHERE name = ?");
  row.bind(name);
  if (!row.step()) return {};
  AuthorityRecord record;
  record.failures = static_cast<unsigned>(row.integer(0));
  record.written = time_of(row.integer(1));
  record.limit = time_of(row.integer(2));
  record.next = time_of(row.integer(3));
  record.path = row.text(4);
  record.last_error = row.text(5);
  if (!row.is_null(6)) record.last_token = time_of(row.integer(6));
  return record;
}

void StampingQueue::remember(const std::string& name, const AuthorityRecord& record) {
  const std::lock_guard guard(state_->mutex);
  const auto last_token = record.last_token ? std::optional(microseconds(*record.last_token)) : std::nullopt;
  state_->database
      ->statement(R"(
    INSERT INTO authorities (name, failures, written_us, limit_us, next_us, path, last_error, last_token_us)
    VALUES (?, ?, ?, ?, ?, ?, ?, ?)
    ON CONFLICT (name) DO UPDATE SET
      failures = excluded.failures, written_us = excluded.written_us, limit_us = excluded.limit_us,
      next_us = excluded.next_us, path = excluded.path, last_error = excluded.last_error,
      last_token_us = coalesce(excluded.last_token_us, last_token_us))")
      .bind(name)
      .bind(static_cast<std::int64_t>(record.failures))
      .bind(microseconds(record.written))
      .bind(microseconds(record.limit))
      .bind(microseconds(record.next))
      .bind(record.path)
      .bind(record.last_error)
      .bind(last_token)
      .step();
}

}  // namespace kiroku::recorder

#include "witness/store.h"

#include <algorithm>
#include <charconv>

#include "base/error.h"
#include "crypto/encoding.h"
#include "crypto/hash.h"

namespace kiroku::witness {
namespace {

constexpr archive::SqliteFile::Schema kSchema{"witness's database",
                                              "CREATE TABLE log_key (origin TEXT NOT NULL, hash TEXT NOT "
                                              "NULL, key TEXT NOT NULL, PRIMARY KEY (origin, key));"
                                              "CREATE INDEX log_hash ON log_key (hash);"
                                              // Sizes as text: they may not fit a signed number.
                                              "CREATE TABLE latest (origin TEXT PRIMARY KEY, size TEXT NOT "
                                              "NULL, root TEXT NOT NULL, note TEXT NOT NULL);"
                                              "PRAGMA user_version = 1;",
                                              1, "SELECT origin, size, root, note FROM latest LIMIT 1", false,
                                              // An old copy would cosign a second history.
                                              "nothing tells any more what this witness cosigned, so make a "
                                              "new one with 'kiroku witness init', and give its key to "
                                              "those who rely on it"};

std::string hash_of(const std::string& origin) { return crypto::to_hex(crypto::sha256(bytes_of(origin))); }

std::uint64_t size_of(const std::string& text, const std::string& origin) {
  std::uint64_t size = 0;
  const auto [end, failure] = std::from_chars(text.data(), text.data() + text.size(), size);
  if (failure != std::errc() || end != text.data() + text.size())
    throw Error("the witness's database holds no size for '" + origin + "': " + kSchema.advice);
  return size;
}

std::optional<Latest> latest_of(archive::SqliteFile& database, const std::string& origin) {
  auto row = database.statement("SELECT size, root, note FROM latest WHERE origin = ?");
  row.bind(origin);
  if (!row.step()) return std::nullopt;
  Latest latest{size_of(row.text(0), origin), {}, row.text(2)};
  const auto root = crypto::from_hex(row.text(1));
  if (!root || root->size() != latest.root.size())
    throw Error("the witness's database holds no root for '" + origin + "': " + kSchema.advice);
  std::ranges::copy(*root, latest.root.begin());
  return latest;
}

std::optional<KnownLog> known(archive::SqliteFile& database, const std::string& origin) {
  KnownLog log{origin, {}, {}};
  auto rows = database.statement("SELECT key FROM log_key WHERE origin = ? ORDER BY key");
  rows.bind(origin);
  while (rows.step()) log.keys.push_back(crypto::VerifierKey::parse(rows.text(0)));
  if (log.keys.empty()) return std::nullopt;
  log.latest = latest_of(database, origin);
  return log;
}

}  // namespace

void Store::make(const std::filesystem::path& file) { archive::SqliteFile::open(file, kSchema); }

Store::Store(const std::filesystem::path& file)
    : database_(archive::SqliteFile::open_existing(file, kSchema)) {}

bool Store::add_key(const std::string& origin, const crypto::VerifierKey& key) {
  const std::lock_guard lock(mutex_);
  archive::SqliteFile::Transaction transaction(*database_);
  auto there = database_->statement("SELECT 1 FROM log_key WHERE origin = ? AND key = ?");
  if (there.bind(origin).bind(key.to_string()).step()) return false;
  database_->statement("INSERT INTO log_key (origin, hash, key) VALUES (?, ?, ?)")
      .bind(origin)
      .bind(hash_of(origin))
      .bind(key.to_string())
      .step();
  transaction.commit();
  return true;
}

std::vector<KnownLog> Store::logs() const {
  const std::lock_guard lock(mutex_);
  std::vector<std::string> origins;
  auto rows = database_->statement("SELECT DISTINCT origin FROM log_key ORDER BY origin");
  while (rows.step()) origins.push_back(rows.text(0));
  std::vector<KnownLog> logs;
  for (const std::string& origin : origins) logs.push_back(*known(*database_, origin));
  return logs;
}

std::optional<KnownLog> Store::log(const std::string& origin) const {
  const std::lock_guard lock(mutex_);
  return known(*database_, origin);
}

std::optional<KnownLog> Store::log_of_hash(const std::string& hash) const {
  const std::lock_guard lock(mutex_);
  auto row = database_->statement("SELECT origin FROM log_key WHERE hash = ? LIMIT 1");
  row.bind(hash);
  if (!row.step()) return std::nullopt;
  return known(*database_, row.text(0));
}

bool Store::advance(const std::string& origin, std::uint64_t old_size, const Latest& next) {
  const std::lock_guard lock(mutex_);
  archive::SqliteFile::Transaction transaction(*database_);
  const std::optional<Latest> now = latest_of(*database_, origin);
  if ((now ? now->size : 0) != old_size) return false;
  if (now && now->size == next.size && now->root != next.root) return false;
  database_->statement("INSERT OR REPLACE INTO latest (origin, size, root, note) VALUES (?, ?, ?, ?)")
      .bind(origin)
      .bind(std::to_string(next.size))
      .bind(crypto::to_hex(next.root))
      .bind(next.note)
      .step();
  transaction.commit();
  return true;
}

}  // namespace kiroku::witness

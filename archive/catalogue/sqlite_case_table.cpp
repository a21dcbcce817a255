#include "archive/catalogue/sqlite_case_table.h"

namespace kiroku::archive {
namespace {

constexpr SqliteFile::Schema kSchema{"catalogue", R"(
  CREATE TABLE cases (
    case_id         TEXT PRIMARY KEY,   -- name of the folder
    opened_us       INTEGER NOT NULL,   -- microseconds since 1970, UTC
    duration_ns     INTEGER,
    state           TEXT NOT NULL,
    streams         TEXT NOT NULL,      -- names, a space between
    segments        INTEGER NOT NULL,
    bytes           INTEGER NOT NULL,
    tokens          INTEGER NOT NULL,
    verdict         TEXT,
    verified_us     INTEGER,
    ledger_bytes    INTEGER NOT NULL,   -- what the row was made from; -1 if there was no ledger
    ledger_mtime_ns INTEGER NOT NULL    -- when something of the case last changed, by the file system
  ) STRICT;
  PRAGMA user_version = 1;
)",
                                     1, "SELECT ledger_mtime_ns FROM cases LIMIT 1"};

UtcTime time_of(std::int64_t microseconds) { return UtcTime(std::chrono::microseconds(microseconds)); }

}  // namespace

SqliteCaseTable::SqliteCaseTable(const std::filesystem::path& file)
    : database_(SqliteFile::open(file, kSchema)) {}

void SqliteCaseTable::put(const CatalogueRow& row, const CaseStamp& stamp) {
  database_
      ->statement(R"(
    INSERT INTO cases (case_id, opened_us, duration_ns, state, streams, segments, bytes, tokens, ledger_bytes,
                       ledger_mtime_ns)
    VALUES (?, ?, ?, ?, ?, ?, ?, ?, ?, ?)
    ON CONFLICT (case_id) DO UPDATE SET
      verdict = iif(ledger_bytes = excluded.ledger_bytes AND ledger_mtime_ns = excluded.ledger_mtime_ns,
                    verdict, NULL),
      verified_us = iif(ledger_bytes = excluded.ledger_bytes AND ledger_mtime_ns = excluded.ledger_mtime_ns,
                        verified_us, NULL),
      opened_us = excluded.opened_us, duration_ns = excluded.duration_ns, state = excluded.state,
      streams = excluded.streams, segments = excluded.segments, bytes = excluded.bytes, tokens = excluded.tokens,
      ledger_bytes = excluded.ledger_bytes, ledger_mtime_ns = excluded.ledger_mtime_ns)")
      .bind(row.case_id)
      .bind(row.opened.time_since_epoch().count())
      .bind(row.duration_ns)
      .bind(row.state)
      .bind(joined_names(row.streams))
      .bind(static_cast<std::int64_t>(row.segments))
      .bind(static_cast<std::int64_t>(row.bytes))
      .bind(static_cast<std::int64_t>(row.tokens))
      .bind(stamp.bytes)
      .bind(stamp.changed)
      .step();
}

std::map<std::string, CaseStamp> SqliteCaseTable::stamps() {
  std::map<std::string, CaseStamp> stamps;
  SqliteStatement rows = database_->statement("SELECT case_id, ledger_bytes, ledger_mtime_ns FROM cases");
  while (rows.step()) stamps[rows.text(0)] = {rows.integer(1), rows.integer(2)};
  return stamps;
}

std::vector<CatalogueRow> SqliteCaseTable::rows() {
  std::vector<CatalogueRow> list;
  SqliteStatement rows = database_->statement(
      "SELECT case_id, opened_us, duration_ns, state, streams, segments, bytes, tokens, verdict, verified_us "
      "FROM cases ORDER BY opened_us DESC, case_id DESC");
  while (rows.step()) {
    CatalogueRow row;
    row.case_id = rows.text(0);
    row.opened = time_of(rows.integer(1));
    if (!rows.is_null(2)) row.duration_ns = rows.integer(2);
    row.state = rows.text(3);
    row.streams = split_names(rows.text(4));
    row.segments = static_cast<std::uint64_t>(rows.integer(5));
    row.bytes = static_cast<std::uint64_t>(rows.integer(6));
    row.tokens = static_cast<std::uint64_t>(rows.integer(7));
    if (!rows.is_null(8)) {
      row.last_verdict = rows.text(8);
      row.verified = time_of(rows.integer(9));
    }
    list.push_back(std::move(row));
  }
  return list;
}

void SqliteCaseTable::remove(const std::string& case_id) {
  database_->statement("DELETE FROM cases WHERE case_id = ?").bind(case_id).step();
}

void SqliteCaseTable::set_verdict(const std::string& case_id, const std::string& verdict, UtcTime when) {
  database_->statement("UPDATE cases SET verdict = ?, verified_us = ? WHERE case_id = ?")
      .bind(verdict)
      .bind(when.time_since_epoch().count())
      .bind(case_id)
      .step();
}

void SqliteCaseTable::together(const std::function<void()>& work) {
  SqliteFile::Transaction transaction(*database_);
  work();
  transaction.commit();
}

}  // namespace kiroku::archive

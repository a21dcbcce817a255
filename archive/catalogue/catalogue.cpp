#include "archive/catalogue/catalogue.h"

#include <algorithm>
#include <chrono>
#include <map>
#include <sys/stat.h>
#include <utility>

#include "archive/catalogue/ledger_summary.h"
#include "archive/catalogue/sqlite_file.h"
#include "archive/format/case_layout.h"
#include "archive/verify/excerpt_verifier.h"
#include "base/error.h"

namespace kiroku::archive {

namespace {

namespace fs = std::filesystem;

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

/// What tells that a case changed: its ledger, or which files there are. A file that is written in place
/// does not show; whoever reads a verdict is told of when it is.
struct LedgerStamp {
  std::int64_t bytes = -1;
  std::int64_t changed_ns = 0;
  friend bool operator==(const LedgerStamp&, const LedgerStamp&) = default;
};

LedgerStamp stamp_of(const fs::path& case_folder) {
  struct stat status {};
  if (::stat((case_folder / kLedgerFile).c_str(), &status) != 0) {
    return {};
  }
  LedgerStamp stamp{status.st_size, 0};
  // By the time of the status, which nobody sets as they like.
  const auto see = [&](const fs::path& path) {
    struct stat each {};
    if (::lstat(path.c_str(), &each) == 0) {
      stamp.changed_ns =
          std::max(stamp.changed_ns, each.st_ctim.tv_sec * 1'000'000'000 + each.st_ctim.tv_nsec);
    }
  };
  for (const fs::path& path : {case_folder, case_folder / kLedgerFile, case_folder / kCheckpointsFolder,
                               case_folder / kTokensFolder, case_folder / kSegmentsFolder}) {
    see(path);
  }
  std::error_code error;
  fs::directory_iterator streams(case_folder / kSegmentsFolder, error);
  for (; !error && streams != fs::directory_iterator(); streams.increment(error)) {
    see(streams->path());
  }
  return stamp;
}

UtcTime time_of(std::int64_t microseconds) { return UtcTime(std::chrono::microseconds(microseconds)); }

/// The start in "20260805T091502Z-3f9c21ab"; 1970 for any other name.
UtcTime opened_by_name(const std::string& name) {
  if (!is_case_id(name)) {
    return {};
  }
  const std::string rfc3339 = name.substr(0, 4) + "-" + name.substr(4, 2) + "-" + name.substr(6, 5) + ":" +
                              name.substr(11, 2) + ":" + name.substr(13, 3);
  return parse_utc(rfc3339).value_or(UtcTime{});
}

std::string joined(const std::vector<std::string>& names) {
  std::string text;
  for (const std::string& name : names) {
    text += (text.empty() ? "" : " ") + name;
  }
  return text;
}

std::vector<std::string> split(const std::string& text) {
  std::vector<std::string> names;
  for (std::size_t at = 0; at < text.size();) {
    const std::size_t end = std::min(text.find(' ', at), text.size());
    names.push_back(text.substr(at, end - at));
    at = end + 1;
  }
  return names;
}

/// Folders of an archive that are, or claim to be, cases.
std::map<std::string, fs::path> case_folders(const fs::path& archive) {
  std::map<std::string, fs::path> folders;
  std::error_code error;
  fs::directory_iterator entries(archive, error);
  for (; !error && entries != fs::directory_iterator(); entries.increment(error)) {
    const std::string name = entries->path().filename().string();
    std::error_code ignored;
    if (name != "log" && name != kEvidenceFolder && !name.starts_with('.') &&
        entries->is_directory(ignored) && !is_excerpt(entries->path())) {
      folders[name] = entries->path();
    }
  }
  if (error) {
    throw IoError("read the archive folder", archive, error.value());
  }
  return folders;
}

CatalogueRow read_case(const std::string& name, const fs::path& folder) {
  CatalogueRow row;
  row.case_id = name;
  const std::optional<LedgerSummary> summary = summarise_ledger(folder);
  if (!summary) {
    row.state = "unreadable";
    row.opened = opened_by_name(name);
    return row;
  }
  row.state = summary->duration_ns ? "closed" : "open";
  row.opened = summary->opened;
  row.duration_ns = summary->duration_ns;
  row.streams = summary->streams;
  row.segments = summary->segments;
  row.bytes = summary->bytes;
  row.tokens = summary->tokens;
  return row;
}

}  // namespace

struct Catalogue::State {
  explicit State(std::unique_ptr<SqliteFile> the_database) : database(std::move(the_database)) {}

  SqliteStatement statement(std::string_view sql) { return database->statement(sql); }
  void store(const CatalogueRow& row, const LedgerStamp& stamp);
  std::map<std::string, LedgerStamp> stamps();

  std::unique_ptr<SqliteFile> database;
};

void Catalogue::State::store(const CatalogueRow& row, const LedgerStamp& stamp) {
  statement(R"(
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
      .bind(joined(row.streams))
      .bind(static_cast<std::int64_t>(row.segments))
      .bind(static_cast<std::int64_t>(row.bytes))
      .bind(static_cast<std::int64_t>(row.tokens))
      .bind(stamp.bytes)
      .bind(stamp.changed_ns)
      .step();
}

std::map<std::string, LedgerStamp> Catalogue::State::stamps() {
  std::map<std::string, LedgerStamp> stamps;
  SqliteStatement rows = statement("SELECT case_id, ledger_bytes, ledger_mtime_ns FROM cases");
  while (rows.step()) {
    stamps[rows.text(0)] = {rows.integer(1), rows.integer(2)};
  }
  return stamps;
}

Catalogue::Catalogue(std::unique_ptr<State> state) : state_(std::move(state)) {}
Catalogue::~Catalogue() = default;

std::unique_ptr<Catalogue> Catalogue::open(const fs::path& file) {
  return std::unique_ptr<Catalogue>(new Catalogue(std::make_unique<State>(SqliteFile::open(file, kSchema))));
}

// The stamp is taken before the ledger is read: what is appended meanwhile makes the row old at once, rather
// than hide.
void Catalogue::refresh(const fs::path& case_folder) {
  fs::path folder = fs::absolute(case_folder).lexically_normal();
  if (!folder.has_filename()) {
    folder = folder.parent_path();  // it was given with a slash at the end
  }
  const LedgerStamp stamp = stamp_of(folder);
  state_->store(read_case(folder.filename().string(), folder), stamp);
}

std::size_t Catalogue::rebuild(const fs::path& archive) {
  const std::map<std::string, fs::path> folders = case_folders(archive);
  SqliteFile::Transaction transaction(*state_->database);
  for (const auto& [name, stamp] : state_->stamps()) {
    if (!folders.contains(name)) {
      state_->statement("DELETE FROM cases WHERE case_id = ?").bind(name).step();
    }
  }
  for (const auto& [name, folder] : folders) {
    const LedgerStamp stamp = stamp_of(folder);
    state_->store(read_case(name, folder), stamp);
  }
  transaction.commit();
  return folders.size();
}

std::vector<CatalogueRow> Catalogue::list(const fs::path& archive) {
  const std::map<std::string, fs::path> folders = case_folders(archive);
  SqliteFile::Transaction transaction(*state_->database);
  std::map<std::string, LedgerStamp> known = state_->stamps();
  for (const auto& [name, folder] : folders) {
    const LedgerStamp stamp = stamp_of(folder);
    const auto row = known.extract(name);
    if (row.empty() || row.mapped() != stamp) {
      state_->store(read_case(name, folder), stamp);
    }
  }
  for (const auto& [vanished, stamp] : known) {
    state_->statement("DELETE FROM cases WHERE case_id = ?").bind(vanished).step();
  }
  std::vector<CatalogueRow> list;
  SqliteStatement rows = state_->statement(
      "SELECT case_id, opened_us, duration_ns, state, streams, segments, bytes, tokens, verdict, verified_us "
      "FROM cases ORDER BY opened_us DESC, case_id DESC");
  while (rows.step()) {
    CatalogueRow row;
    row.case_id = rows.text(0);
    row.opened = time_of(rows.integer(1));
    if (!rows.is_null(2)) {
      row.duration_ns = rows.integer(2);
    }
    row.state = rows.text(3);
    row.streams = split(rows.text(4));
    row.segments = static_cast<std::uint64_t>(rows.integer(5));
    row.bytes = static_cast<std::uint64_t>(rows.integer(6));
    row.tokens = static_cast<std::uint64_t>(rows.integer(7));
    if (!rows.is_null(8)) {
      row.last_verdict = rows.text(8);
      row.verified = time_of(rows.integer(9));
    }
    list.push_back(std::move(row));
  }
  transaction.commit();
  return list;
}

void Catalogue::set_verdict(const std::string& case_id, const std::string& verdict, UtcTime when) {
  state_->statement("UPDATE cases SET verdict = ?, verified_us = ? WHERE case_id = ?")
      .bind(verdict)
      .bind(when.time_since_epoch().count())
      .bind(case_id)
      .step();
}

}  // namespace kiroku::archive

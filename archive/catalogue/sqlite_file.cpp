#include "archive/catalogue/sqlite_file.h"

#include <utility>

namespace kiroku::archive {

namespace {

namespace fs = std::filesystem;

constexpr int kBusyMilliseconds = 5000;

bool is_damage(int code) {
  // SQLITE_ERROR: not our tables.
  return code == SQLITE_CORRUPT || code == SQLITE_NOTADB || code == SQLITE_ERROR;
}

[[noreturn]] void throw_damaged(const fs::path& file, const SqliteFile::Schema& schema) {
  throw UsageError("the " + std::string(schema.what) + " " + file.string() + " is damaged: " + schema.advice);
}

}  // namespace

SqliteFile::Transaction::~Transaction() {
  if (!committed_) {
    sqlite3_exec(file_.database_.get(), "ROLLBACK", nullptr, nullptr, nullptr);
  }
}

void SqliteFile::Transaction::commit() {
  file_.execute("COMMIT");
  committed_ = true;
}

SqliteFile::SqliteFile(fs::path file, int flags) : file_(std::move(file)) {
  sqlite3* raw = nullptr;
  const int result = sqlite3_open_v2(file_.c_str(), &raw, SQLITE_OPEN_READWRITE | flags, nullptr);
  database_.reset(raw);
  if (result != SQLITE_OK) {
    throw SqliteError(database_.get(), file_);
  }
  sqlite3_busy_timeout(database_.get(), kBusyMilliseconds);
}

void SqliteFile::execute(const char* sql) {
  if (sqlite3_exec(database_.get(), sql, nullptr, nullptr, nullptr) != SQLITE_OK) {
    throw SqliteError(database_.get(), file_);
  }
}

std::int64_t SqliteFile::version() {
  SqliteStatement asked = statement("PRAGMA user_version");
  asked.step();
  return asked.integer(0);
}

bool SqliteFile::passes_quick_check() {
  // The statement is gone before a transaction begins: with a read still open, SQLite waits for no other
  // writer, since both could wait for each other.
  SqliteStatement check = statement("PRAGMA quick_check(1)");
  return check.step() && check.text(0) == "ok";
}

bool SqliteFile::prepare(const Schema& schema) {
  try {
    if (!passes_quick_check()) return false;
    if (version() == 0) {
      Transaction transaction(*this);
      if (version() == 0) {  // unless another process was quicker
        execute(schema.sql);
      }
      transaction.commit();
    }
    if (version() != schema.version) {
      throw UsageError(
          "the " + std::string(schema.what) + " " + file_.string() +
          " was made by a newer version: use that" +
          (schema.rebuildable ? ", or remove the file" : std::string("; else ") + schema.advice));
    }
    statement(schema.probe).step();
    return true;
  } catch (const SqliteError& error) {
    if (is_damage(error.code())) {
      return false;
    }
    throw;
  }
}

std::unique_ptr<SqliteFile> SqliteFile::open(const fs::path& file, const Schema& schema) {
  std::unique_ptr<SqliteFile> opened(new SqliteFile(file, SQLITE_OPEN_CREATE));
  if (!opened->prepare(schema)) {
    if (!schema.rebuildable) throw_damaged(file, schema);
    opened.reset();
    fs::path aside = file;
    aside += ".damaged";
    std::error_code error;
    fs::rename(file, aside, error);
    if (error) {
      throw IoError("set aside the damaged " + std::string(schema.what), file, error.value());
    }
    opened.reset(new SqliteFile(file, SQLITE_OPEN_CREATE));
    if (!opened->prepare(schema)) {
      throw Error("cannot make a " + std::string(schema.what) + " at " + file.string() +
                  ": check the disk it is on");
    }
  }
  return opened;
}

std::unique_ptr<SqliteFile> SqliteFile::open_existing(const fs::path& file, const Schema& schema) {
  std::error_code failed;
  const std::uintmax_t size = fs::file_size(file, failed);
  if (failed) {
    throw UsageError("the " + std::string(schema.what) + " " + file.string() + " cannot be read (" +
                     failed.message() + "): " + schema.advice);
  }
  if (size == 0) throw_damaged(file, schema);
  std::unique_ptr<SqliteFile> opened(new SqliteFile(file, 0));
  bool is_sound = false;
  try {
    is_sound = opened->version() != 0 && opened->prepare(schema);
  } catch (const SqliteError& error) {
    if (!is_damage(error.code())) throw;
  }
  if (!is_sound) throw_damaged(file, schema);
  return opened;
}

}  // namespace kiroku::archive

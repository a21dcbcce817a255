// SQLite objects with their deleters, and a statement with typed parameters and columns. Objects are not
// thread-safe. Errors are kiroku::Error naming the database.
#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <string_view>

#include <sqlite3.h>

#include "base/error.h"

namespace kiroku::archive {

struct SqliteDeleter {
  void operator()(sqlite3* database) const { sqlite3_close(database); }
  void operator()(sqlite3_stmt* statement) const { sqlite3_finalize(statement); }
};
using SqliteDatabase = std::unique_ptr<sqlite3, SqliteDeleter>;

/// SQLite refused a call; code() is its primary result code, e.g. SQLITE_CORRUPT.
class SqliteError : public Error {
 public:
  SqliteError(sqlite3* database, const std::filesystem::path& file)
      : Error("cannot use " + file.string() + ": " + sqlite3_errmsg(database)),
        code_(sqlite3_errcode(database) & 0xff) {}
  [[nodiscard]] int code() const { return code_; }

 private:
  int code_;
};

/// One prepared statement. Parameters are bound in order, then step() is called until it returns false.
class SqliteStatement {
 public:
  SqliteStatement(sqlite3* database, const std::filesystem::path& file, std::string_view sql)
      : database_(database), file_(file) {
    sqlite3_stmt* raw = nullptr;
    check(sqlite3_prepare_v2(database_, sql.data(), static_cast<int>(sql.size()), &raw, nullptr));
    statement_.reset(raw);
  }

  SqliteStatement& bind(std::int64_t value) {
    check(sqlite3_bind_int64(statement_.get(), ++bound_, value));
    return *this;
  }
  SqliteStatement& bind(std::string_view value) {
    check(sqlite3_bind_text(statement_.get(), ++bound_, value.data(), static_cast<int>(value.size()),
                            SQLITE_TRANSIENT));  // NOLINT(performance-no-int-to-ptr): SQLite's own macro
    return *this;
  }
  SqliteStatement& bind_real(double value) {
    check(sqlite3_bind_double(statement_.get(), ++bound_, value));
    return *this;
  }
  template <typename Value>
  SqliteStatement& bind(const std::optional<Value>& value) {
    if (value) {
      return bind(*value);
    }
    check(sqlite3_bind_null(statement_.get(), ++bound_));
    return *this;
  }

  /// True while there is a row.
  bool step() {
    const int result = sqlite3_step(statement_.get());
    if (result != SQLITE_ROW && result != SQLITE_DONE) {
      throw SqliteError(database_, file_);
    }
    return result == SQLITE_ROW;
  }

  [[nodiscard]] std::int64_t integer(int column) const {
    return sqlite3_column_int64(statement_.get(), column);
  }
  [[nodiscard]] double real(int column) const { return sqlite3_column_double(statement_.get(), column); }
  [[nodiscard]] std::string text(int column) const {
    const auto* characters = reinterpret_cast<const char*>(sqlite3_column_text(statement_.get(), column));
    const auto size = static_cast<std::size_t>(sqlite3_column_bytes(statement_.get(), column));
    return characters == nullptr ? std::string() : std::string(characters, size);
  }
  [[nodiscard]] bool is_null(int column) const {
    return sqlite3_column_type(statement_.get(), column) == SQLITE_NULL;
  }

 private:
  void check(int result) const {
    if (result != SQLITE_OK) {
      throw SqliteError(database_, file_);
    }
  }

  sqlite3* database_;
  const std::filesystem::path& file_;
  std::unique_ptr<sqlite3_stmt, SqliteDeleter> statement_;
  int bound_ = 0;
};

}  // namespace kiroku::archive

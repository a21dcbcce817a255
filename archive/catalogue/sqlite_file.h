// A database file that can be made anew when it is damaged: what the catalogue and the stamping queue have in
// common. Not thread-safe; other processes may use the same file and are waited for.
#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <string>
#include <string_view>

#include "archive/catalogue/sqlite_handles.h"

namespace kiroku::archive {

class SqliteFile {
 public:
  struct Schema {
    const char* what;  // for messages: "catalogue"
    /// Makes the tables of an empty file; ends with PRAGMA user_version = `version`. SQLite's default
    /// rollback journal stays: no further files lie beside the database once it is at rest.
    const char* sql;
    std::int64_t version;
    const char* probe;  // a statement that only works on these tables
    /// Whether what is in it can be made anew from elsewhere; a damaged file that cannot is refused.
    bool rebuildable = true;
    /// What to do where a file that cannot be made anew is damaged, or of another version.
    const char* advice = "put back a copy of it, or move it away and begin anew";
  };
  /// Opens or makes the file; a damaged one, or one with other tables, is set aside as .damaged and made
  /// anew if it is rebuildable. Throws kiroku::UsageError for one of another version, or damaged and not
  /// rebuildable, kiroku::Error where there can be none.
  static std::unique_ptr<SqliteFile> open(const std::filesystem::path& file, const Schema& schema);
  /// Of a file whose loss must be noticed: one that is absent or empty is refused as a damaged one is, and
  /// nothing is ever set aside or made.
  static std::unique_ptr<SqliteFile> open_existing(const std::filesystem::path& file, const Schema& schema);
  SqliteFile(const SqliteFile&) = delete;
  SqliteFile& operator=(const SqliteFile&) = delete;

  SqliteStatement statement(std::string_view sql) { return {database_.get(), file_, sql}; }

  /// Everything until commit() or nothing; other processes do not write in between.
  class Transaction {
   public:
    explicit Transaction(SqliteFile& file) : file_(file) { file_.execute("BEGIN IMMEDIATE"); }
    Transaction(const Transaction&) = delete;
    Transaction& operator=(const Transaction&) = delete;
    ~Transaction();
    void commit();

   private:
    SqliteFile& file_;
    bool committed_ = false;
  };

 private:
  SqliteFile(std::filesystem::path file, int flags);
  void execute(const char* sql);
  std::int64_t version();
  bool passes_quick_check();
  /// False if what is there is damaged or something else.
  bool prepare(const Schema& schema);

  std::filesystem::path file_;
  SqliteDatabase database_;
};

}  // namespace kiroku::archive

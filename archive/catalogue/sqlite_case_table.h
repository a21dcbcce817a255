// The table of cases of an appliance by itself, in a file of SQLite.
#pragma once

#include <filesystem>
#include <memory>

#include "archive/catalogue/case_table.h"
#include "archive/catalogue/sqlite_file.h"

namespace kiroku::archive {

class SqliteCaseTable final : public CaseTable {
 public:
  /// Opens or makes the file; a damaged one is set aside as .damaged and made anew. Throws kiroku::UsageError
  /// for one of a newer version.
  explicit SqliteCaseTable(const std::filesystem::path& file);

  void put(const CatalogueRow& row, const CaseStamp& stamp) override;
  std::map<std::string, CaseStamp> stamps() override;
  std::vector<CatalogueRow> rows() override;
  void remove(const std::string& case_id) override;
  void set_verdict(const std::string& case_id, const std::string& verdict, UtcTime when) override;
  void together(const std::function<void()>& work) override;

 private:
  std::unique_ptr<SqliteFile> database_;
};

}  // namespace kiroku::archive

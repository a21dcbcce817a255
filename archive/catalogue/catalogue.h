// What is recorded, in SQLite, for quick lists. The folders are the truth: rebuild() makes it anew from them.
// One file serves one archive. Not thread-safe; other processes may use the same file.
#pragma once

#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include "archive/catalogue/case_table.h"
#include "base/utc_time.h"

namespace kiroku::archive {

/// Every function throws kiroku::Error where the catalogue or the archive cannot be used.
class Catalogue {
 public:
  /// Opens or makes the file; a damaged one is set aside as .damaged and made anew (rebuild it then). One of
  /// a newer version is refused.
  static std::unique_ptr<Catalogue> open(const std::filesystem::path& file);
  ~Catalogue();
  /// Reads one case's folder into its row. A verdict is forgotten if its ledger changed since,
  /// or files were added, removed or replaced.
  void refresh(const std::filesystem::path& case_folder);
  /// Everything anew from the archive's folders; verdicts are kept where refresh() keeps them. Returns
  /// how many cases.
  std::size_t rebuild(const std::filesystem::path& archive);
  /// Rows whose folder appeared, vanished or grew since are brought up to date first; newest first. Folders
  /// that cannot be read as a case are listed as unreadable, never left out; `log`, names that begin with a
  /// dot and excerpts are none.
  std::vector<CatalogueRow> list(const std::filesystem::path& archive);
  /// Nothing happens for a case that is not in the catalogue.
  void set_verdict(const std::string& case_id, const std::string& verdict, UtcTime when);

 private:
  explicit Catalogue(std::unique_ptr<CaseTable> table);
  std::unique_ptr<CaseTable> table_;
};

}  // namespace kiroku::archive

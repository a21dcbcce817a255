// What is recorded, in SQLite, for quick lists. The folders are the truth: rebuild() makes it anew from them.
// Not thread-safe.
#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "base/utc_time.h"

namespace kiroku::archive {

struct CatalogueRow {
  std::string case_id;
  UtcTime opened;
  std::optional<std::int64_t> duration_ns;  // nothing while open
  std::string state;                        // "closed", "open", "unreadable"
  std::vector<std::string> streams;
  std::uint64_t segments = 0, bytes = 0, tokens = 0;
  std::optional<std::string> last_verdict;  // and when it was last verified
  std::optional<UtcTime> verified;
};

class Catalogue {
 public:
  /// Opens or makes the file; a damaged one is set aside as .damaged and made anew (rebuild it then).
  static std::unique_ptr<Catalogue> open(const std::filesystem::path& file);
  ~Catalogue();
  /// Reads one case's folder into its row.
  void refresh(const std::filesystem::path& case_folder);
  /// Everything anew from the archive's folders; verdicts are kept where the ledger did not change. Returns
  /// how many cases.
  std::size_t rebuild(const std::filesystem::path& archive);
  /// Rows whose folder appeared, vanished or grew since are brought up to date first; newest first.
  std::vector<CatalogueRow> list(const std::filesystem::path& archive);
  void set_verdict(const std::string& case_id, const std::string& verdict, UtcTime when);

 private:
  struct State;
  explicit Catalogue(std::unique_ptr<State> state);
  std::unique_ptr<State> state_;
};

}  // namespace kiroku::archive

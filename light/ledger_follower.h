// Follows the ledger of a case while a recorder writes it, for the code that a display shows now. Not
// thread-safe.
#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>

#include "archive/format/ledger_entry.h"
#include "crypto/merkle_tree.h"

namespace kiroku::light {

/// What a display shows in a second.
struct ShownLight {
  std::uint64_t code = 0;
  std::int64_t second = 0;
  std::uint64_t entries = 0;
  std::string case_id;
};

/// The ledger of one case, read as it grows.
class LedgerFollower {
 public:
  /// Throws kiroku::Error as archive::CaseFolder::open().
  explicit LedgerFollower(std::filesystem::path case_folder);

  /// Takes in what was written since. Throws kiroku::Error where the ledger cannot be read.
  void read_on();
  [[nodiscard]] std::uint64_t entries() const { return tree_.size(); }
  /// After `close`, or a ledger that is no longer what was read: nothing is shown any more.
  [[nodiscard]] bool is_over() const { return is_over_; }
  [[nodiscard]] const std::filesystem::path& folder() const { return folder_; }
  /// Nothing before the first whole line, after the end, and where nothing was written for so long that no
  /// recorder can be at work.
  [[nodiscard]] std::optional<ShownLight> light_at(std::int64_t second) const;

 private:
  std::filesystem::path folder_;
  std::uint64_t read_ = 0;  // bytes of whole lines
  std::string case_id_;
  std::int64_t newest_us_ = 0;  // UTC of the newest entry
  crypto::MerkleFrontier tree_;
  bool is_over_ = false;
};

/// Whichever case of an archive is being recorded: the newest that has no `close`.
class ArchiveFollower {
 public:
  explicit ArchiveFollower(std::filesystem::path archive) : archive_(std::move(archive)) {}
  /// Of the case that is being recorded now; nothing while there is none. What cannot be read is none, and
  /// problem() says why.
  std::optional<ShownLight> light_at(std::int64_t second);
  [[nodiscard]] const std::string& problem() const { return problem_; }

 private:
  std::filesystem::path archive_;
  std::unique_ptr<LedgerFollower> case_;
  std::string problem_;
};

}  // namespace kiroku::light

// What the appliance log says of consents, by docs/reference/format.md, "The appliance log": their order, and
// the sealed files that they name. Not thread-safe.
#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "archive/format/case_folder.h"
#include "archive/format/log_entry.h"
#include "archive/verify/finding_list.h"

namespace kiroku::archive {

class ConsentRules {
 public:
  /// `folder` is the log's. Both must outlive the object.
  ConsentRules(const CaseFolder& folder, FindingList& findings) : folder_(&folder), findings_(&findings) {}

  /// Whether an entry concerns consents: what take() is for.
  static bool concerns(const LogEntryBody& body);
  /// Of the newest entry: whether it was signed before another followed, whether anybody asked for its case,
  /// and whether the log knows that as opened.
  struct Standing {
    bool is_signed = false, is_asked_for = false, is_opened = false;
  };
  void take(const LogEntryBody& body, std::uint64_t number, Standing standing);
  /// Another entry follows: what was not signed until now never is.
  void followed();

  /// Whether an entry names the path.
  [[nodiscard]] bool names(const std::string& path) const { return files_.contains(path); }
  /// After the last of `entries`: judges the files of consents/ by the folder's listing. Those that no entry
  /// names are told only where the log itself is judged, since nothing says of which case they are, and once
  /// the entries that were added meanwhile were read, too.
  void finish(const std::vector<ListedFile>& listing, std::uint64_t entries, bool log_itself);

 private:
  void take_statement(const ConsentStatement& says, bool withdraws, std::uint64_t number, Standing standing);
  void name_file(const crypto::Sha256Digest& hash, std::uint64_t number, bool is_asked_for);
  void check_file(const std::string& path, std::uint64_t entry);
  void report_unnamed(const std::vector<ListedFile>& listing, std::uint64_t entries);
  /// What lines behind the first `entries` name: the file of an entry is there before it.
  [[nodiscard]] std::set<std::string> named_since(std::uint64_t entries) const;

  const CaseFolder* folder_;
  FindingList* findings_;
  using Use = std::pair<std::string, std::string>;  // case and purpose
  std::set<Use> standing_;
  /// Whose consent was withdrawn only by an entry that nobody signed in time: another withdrawal may follow.
  std::set<Use> doubted_;
  std::optional<std::pair<std::uint64_t, bool>> unsigned_;  // the newest entry; whether it withdraws
  /// The first entry that names each file, where its case was asked for.
  std::map<std::string, std::optional<std::uint64_t>> files_;
};

}  // namespace kiroku::archive

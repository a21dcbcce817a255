#include "apps/common/output_place.h"

#include <algorithm>
#include <array>
#include <optional>
#include <string_view>
#include <system_error>

#include "archive/format/case_layout.h"
#include "archive/format/excerpt_document.h"
#include "base/error.h"

namespace kiroku::apps {
namespace {

namespace fs = std::filesystem;

/// Files of a home that no command writes where a person names them (apps/kiroku/home.h). trust.pem is not
/// among them: whoever runs the home puts roots into it.
constexpr auto kFilesOfHome = std::to_array<std::string_view>(
    {"kiroku.toml", "recipients.txt", "device.key", "device.pub", "device-ml-dsa.key", "device-hardware.json",
     "device.identity", "identity.txt", "own-authority.pem", "newest-log.note", "last-signed.note",
     "store-credentials", "reporting.json", "viewer.key", "viewer.pem"});
constexpr std::string_view kArchiveOfHome = "archive", kAuthorityOfHome = "authority";

bool is_there(const fs::path& path) {
  std::error_code ignored;
  return fs::exists(fs::symlink_status(path, ignored));
}

bool is_home(const fs::path& folder) {
  return is_there(folder / "device.pub") && is_there(folder / "kiroku.toml");
}

bool is_file_of_home(const std::string& name) {
  const std::string_view sqlite = ".sqlite";
  // SQLite has files of its own beside a database: NAME.sqlite-wal.
  const std::size_t database = name.find(sqlite);
  const bool is_database = name.starts_with("catalogue.") || name.starts_with("stamping.") ||
                           name.starts_with("users.") || name.starts_with("shipping-");
  return std::ranges::find(kFilesOfHome, std::string_view(name)) != kFilesOfHome.end() ||
         (is_database && database != std::string::npos);
}

/// What the place belongs to, and what would come of it; nothing where it is free.
struct Owner {
  fs::path folder;
  std::string what, harm;
};

std::optional<Owner> owner_by_ledger(const fs::path& folder) {
  if (is_there(folder / archive::kLedgerFile)) {
    return Owner{folder, "the folder of a recorded case or of an appliance log",
                 "a file that its ledger does not name makes it read as tampered"};
  }
  if (is_there(folder / archive::kExcerptFile)) {
    return Owner{folder, "the folder of an excerpt",
                 "a file that it does not name makes it read as tampered"};
  }
  return std::nullopt;
}

std::optional<Owner> owner_by_home(const fs::path& path, Writes what) {
  const fs::path folder = path.parent_path();
  const std::string name = path.filename().string();
  if (folder == path || name.empty() || !is_home(folder)) return std::nullopt;
  if (name == kArchiveOfHome && what != Writes::kCases)
    return Owner{path, "the archive of a home", "only what the recorder keeps belongs there"};
  if (name == kAuthorityOfHome)
    return Owner{path, "the home's own time-stamping authority", "its keys and certificates lie there"};
  return std::nullopt;
}

std::optional<Owner> owner_of(const fs::path& path, Writes what) {
  const fs::path folder = path.parent_path();
  if (is_home(folder) && is_file_of_home(path.filename().string()))
    return Owner{folder, "a home", "the home consists of this file and others"};
  for (fs::path at = path;; at = at.parent_path()) {
    if (auto owner = owner_by_ledger(at)) return owner;
    if (auto owner = owner_by_home(at, what)) return owner;
    if (at == at.parent_path()) return std::nullopt;
  }
}

/// "lies in the folder of …: what would come of it"; "" where the place is free.
std::string why_not_there(const fs::path& named, Writes what) {
  std::error_code failed;
  fs::path as_named = fs::absolute(named, failed);
  if (failed) return "";  // such as a current folder that was removed: nothing can be written there either
  if (!as_named.has_filename()) as_named = as_named.parent_path();
  fs::path resolved = fs::weakly_canonical(as_named, failed);
  if (failed) resolved = as_named;
  // An archive may be a link to another disk: by its resolved name it is no home's any more.
  auto owner = owner_of(resolved, what);
  if (!owner) owner = owner_of(as_named, what);
  if (!owner) return "";
  const bool is_itself = owner->folder == resolved || owner->folder == as_named;
  return (is_itself ? "is " : "lies in ") + owner->what + " (" + owner->folder.string() +
         "): " + owner->harm + ". Nothing was written";
}

}  // namespace

void require_output_place(const fs::path& named, const std::string& option, Writes what) {
  if (what == Writes::kNothing || named.empty() || named == "-") return;
  if (const std::string why = why_not_there(named, what); !why.empty())
    throw UsageError(option + " names " + named.string() + ", which " + why + "; name a place outside of it");
}

void require_place_beside(const fs::path& input, const fs::path& output) {
  if (const std::string why = why_not_there(output, Writes::kOutput); !why.empty())
    throw UsageError(output.filename().string() + " would be written beside " + input.string() +
                     ", where it " + why + "; copy that elsewhere first");
}

}  // namespace kiroku::apps

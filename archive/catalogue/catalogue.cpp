#include "archive/catalogue/catalogue.h"

#include <algorithm>
#include <map>
#include <sys/stat.h>
#include <utility>

#include "archive/catalogue/sqlite_case_table.h"
#include "archive/format/case_layout.h"
#include "archive/format/log_aside.h"
#include "archive/verify/excerpt_verifier.h"
#include "base/error.h"

namespace kiroku::archive {

namespace {

namespace fs = std::filesystem;

/// A case's ledger, and which files there are, tell that it changed. A file that is written in place does not
/// show; whoever reads a verdict is told of when it is.
CaseStamp stamp_of(const fs::path& case_folder) {
  struct stat status {};
  if (::stat((case_folder / kLedgerFile).c_str(), &status) != 0) {
    return {};
  }
  CaseStamp stamp{status.st_size, 0};
  // By the time of the status, which nobody sets as they like.
  const auto see = [&](const fs::path& path) {
    struct stat each {};
    if (::lstat(path.c_str(), &each) == 0) {
      stamp.changed = std::max(stamp.changed, each.st_ctim.tv_sec * 1'000'000'000 + each.st_ctim.tv_nsec);
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

/// Folders of an archive that are, or claim to be, cases.
std::map<std::string, fs::path> case_folders(const fs::path& archive) {
  std::map<std::string, fs::path> folders;
  std::error_code error;
  fs::directory_iterator entries(archive, error);
  for (; !error && entries != fs::directory_iterator(); entries.increment(error)) {
    const std::string name = entries->path().filename().string();
    std::error_code ignored;
    if (name != "log" && name != kEvidenceFolder && !is_log_aside_name(name) && !name.starts_with('.') &&
        entries->is_directory(ignored) && !is_excerpt(entries->path())) {
      folders[name] = entries->path();
    }
  }
  if (error) {
    throw IoError("read the archive folder", archive, error.value());
  }
  return folders;
}

}  // namespace

Catalogue::Catalogue(std::unique_ptr<CaseTable> table) : table_(std::move(table)) {}
Catalogue::~Catalogue() = default;

std::unique_ptr<Catalogue> Catalogue::open(const fs::path& file) {
  return std::unique_ptr<Catalogue>(new Catalogue(std::make_unique<SqliteCaseTable>(file)));
}

// The stamp is taken before the ledger is read: what is appended meanwhile makes the row old at once, rather
// than hide.
void Catalogue::refresh(const fs::path& case_folder) {
  fs::path folder = fs::absolute(case_folder).lexically_normal();
  if (!folder.has_filename()) {
    folder = folder.parent_path();  // it was given with a slash at the end
  }
  const CaseStamp stamp = stamp_of(folder);
  table_->put(read_catalogue_row(folder.filename().string(), folder), stamp);
}

std::size_t Catalogue::rebuild(const fs::path& archive) {
  const std::map<std::string, fs::path> folders = case_folders(archive);
  table_->together([&] {
    for (const auto& [name, stamp] : table_->stamps()) {
      if (!folders.contains(name)) table_->remove(name);
    }
    for (const auto& [name, folder] : folders) {
      const CaseStamp stamp = stamp_of(folder);
      table_->put(read_catalogue_row(name, folder), stamp);
    }
  });
  return folders.size();
}

std::vector<CatalogueRow> Catalogue::list(const fs::path& archive) {
  const std::map<std::string, fs::path> folders = case_folders(archive);
  std::vector<CatalogueRow> list;
  table_->together([&] {
    std::map<std::string, CaseStamp> known = table_->stamps();
    for (const auto& [name, folder] : folders) {
      const CaseStamp stamp = stamp_of(folder);
      const auto row = known.extract(name);
      if (row.empty() || row.mapped() != stamp) table_->put(read_catalogue_row(name, folder), stamp);
    }
    for (const auto& [vanished, stamp] : known) table_->remove(vanished);
    list = table_->rows();
  });
  return list;
}

void Catalogue::set_verdict(const std::string& case_id, const std::string& verdict, UtcTime when) {
  table_->set_verdict(case_id, verdict, when);
}

}  // namespace kiroku::archive

#include "fleet/fetcher.h"

#include <algorithm>
#include <cerrno>
#include <charconv>
#include <fcntl.h>
#include <map>
#include <span>
#include <unistd.h>

#include "archive/format/case_layout.h"
#include "archive/format/ledger_entry.h"
#include "archive/format/limits.h"
#include "archive/reading/case_reader.h"
#include "base/descriptor.h"
#include "base/error.h"
#include "base/printable.h"
#include "crypto/encoding.h"

namespace kiroku::fleet {
namespace {

namespace fs = std::filesystem;

constexpr std::uint64_t kLargestObject = 5ULL << 30;
constexpr std::string_view kGrowing = "growing/";
constexpr std::string_view kLog = "log";  // an appliance's, beside its cases

/// Names of files below a case's folder, as the store tells them: nothing may lead out of it.
bool is_name_below(std::string_view path) {
  constexpr std::size_t kMost = 200;
  if (!is_plain_key(path) || path.size() > kMost) return false;
  for (std::size_t begin = 0; begin <= path.size();) {
    const std::size_t end = std::min(path.find('/', begin), path.size());
    const std::string_view part = path.substr(begin, end - begin);
    if (part.empty() || part.front() == '.') return false;
    begin = end + 1;
  }
  return true;
}

void make_folders(const fs::path& folder) {
  std::error_code failed;
  fs::create_directories(folder, failed);
  if (failed) throw IoError("create", folder, failed.value());
}

/// A file that is written piece by piece.
class NewFile {
 public:
  NewFile(fs::path path, int flags)
      : path_(std::move(path)),
        file_(::open(path_.c_str(), O_WRONLY | O_CREAT | O_CLOEXEC | O_NOFOLLOW | flags, 0600)) {
    if (!file_) throw IoError("create", path_, errno);
  }
  void write(ByteView bytes) {
    hash_.update(bytes);
    size_ += bytes.size();
    while (!bytes.empty()) {
      const ssize_t written = ::write(file_.number(), bytes.data(), bytes.size());
      if (written < 0 && errno == EINTR) continue;
      if (written < 0) throw IoError("write", path_, errno);
      bytes = bytes.subspan(static_cast<std::size_t>(written));
    }
  }
  std::string finish() {
    if (::fsync(file_.number()) != 0) throw IoError("flush", path_, errno);
    return crypto::to_hex(hash_.finish());
  }
  [[nodiscard]] std::uint64_t size() const { return size_; }

 private:
  fs::path path_;
  Descriptor file_;
  crypto::Sha256 hash_;
  std::uint64_t size_ = 0;
};

/// One case on its way into a folder.
class Fetching {
 public:
  Fetching(ObjectStore& store, std::string prefix, std::string case_id, fs::path folder)
      : store_(store), prefix_(std::move(prefix)), case_id_(std::move(case_id)), folder_(std::move(folder)) {}

  /// Its ledger alone; whether there is one.
  bool run_ledger() {
    const std::string ledger(archive::kLedgerFile);
    list_files(ledger);
    list_parts();
    make_folders(folder_);
    if (versions_.contains(ledger)) {
      take(ledger, versions_.at(ledger).front());
    } else if (!parts_.empty()) {
      join_parts();
    } else {
      return false;
    }
    return true;
  }

  FetchedCase run() {
    list_files("");
    list_parts();
    if (versions_.empty() && parts_.empty()) {
      if (case_id_ == kLog) throw UsageError("the store has no log of an appliance below '" + prefix_ + "'");
      throw UsageError("the store has nothing of case " + case_id_ + " below '" + prefix_ +
                       "': 'kiroku fetch --list' names the cases that it has");
    }
    make_folders(folder_);
    for (const auto& [path, versions] : versions_) take(path, versions.front());
    if (!versions_.contains(std::string(archive::kLedgerFile))) join_parts();
    if (case_id_ != kLog) take_what_the_ledger_names();
    return std::move(result_);
  }

 private:
  /// Those whose names begin with `beginning`.
  void list_files(const std::string& beginning) {
    const std::string of_case = prefix_ + case_id_ + "/";
    store_.for_each_version(of_case + beginning, [&](const ListedVersion& each) {
      const std::string path = each.key.substr(of_case.size());
      if (!is_name_below(path)) {
        result_.remarks.push_back("'" + printable(each.key) +
                                  "' was left out: nothing of Kiroku gives such a name");
        return;
      }
      std::vector<ListedVersion>& versions = versions_[path];
      versions.insert(each.newest ? versions.begin() : versions.end(), each);
    });
  }

  void list_parts() {
    const std::string of_parts = prefix_ + std::string(kGrowing) + case_id_ + "/";
    store_.for_each_version(of_parts, [&](const ListedVersion& each) {
      if (each.newest) parts_[each.key.substr(of_parts.size())] = each;
    });
  }

  void take(const std::string& path, const ListedVersion& version) {
    make_folders((folder_ / path).parent_path());
    NewFile file(folder_ / path, O_TRUNC);
    hashes_[path] = download(version, file);
  }

  /// Its SHA-256, hexadecimal.
  std::string download(const ListedVersion& version, NewFile& file) {
    const std::uint64_t before = file.size();
    const StoredObject told =
        store_.get(version.key, version.version, kLargestObject, [&](ByteView bytes) { file.write(bytes); });
    const std::uint64_t bytes = file.size() - before;
    if (bytes != told.bytes) {
      throw Error("of " + version.key + " the store sent " + std::to_string(bytes) +
                  " bytes where it told of " + std::to_string(told.bytes) + ": try again");
    }
    std::string hash = before == 0 ? file.finish() : "";
    if (before == 0 && !told.sha256.empty() && told.sha256 != hash) {
      result_.remarks.push_back(version.key + " is not what was put: the store tells of another SHA-256");
    }
    ++result_.objects;
    result_.bytes += bytes;
    return hash;
  }

  /// The ledger of a case that was not closed: each part's name is the byte that it begins with.
  void join_parts() {
    result_.growing = true;
    NewFile ledger(folder_ / archive::kLedgerFile, O_TRUNC);
    for (const auto& [name, part] : parts_) {
      std::uint64_t begin = 0;
      const auto [end, error] = std::from_chars(name.data(), name.data() + name.size(), begin);
      if (error != std::errc() || end != name.data() + name.size() || begin != ledger.size()) {
        result_.remarks.push_back("the ledger ends at byte " + std::to_string(ledger.size()) +
                                  ": the store's next part of it is '" + printable(name) +
                                  "', which does not follow");
        break;
      }
      download(part, ledger);
    }
    ledger.finish();
  }

  /// Whoever has the appliance's keys can put other versions; what the ledger names lies among the older
  /// ones.
  void take_what_the_ledger_names() {
    const auto want = [&](const std::string& path, const crypto::Sha256Digest& sha256) {
      const std::string hash = crypto::to_hex(sha256);
      const auto versions = versions_.find(path);
      if (versions == versions_.end() || hashes_[path] == hash) return;
      for (const ListedVersion& each : std::span(versions->second).subspan(1)) {
        take(path, each);
        if (hashes_[path] != hash) continue;
        result_.remarks.push_back("of " + path +
                                  " an older version was taken: the newest is not what the ledger names");
        return;
      }
      if (versions->second.size() > 1) take(path, versions->second.front());
    };
    try {
      const archive::CaseReader reader = archive::CaseReader::open(folder_);
      if (reader.opening().subject) want(reader.opening().subject->file, reader.opening().subject->sha256);
      reader.for_each([&](const archive::CaseEntry& entry) {
        if (const auto* segment = std::get_if<archive::SegmentEntry>(&entry.body)) {
          want(segment->file.file, segment->file.sha256);
        } else if (const auto* token = std::get_if<archive::TokenEntry>(&entry.body)) {
          want(token->file, token->sha256);
        }
      });
    } catch (const StoreError&) {
      throw;
    } catch (const IoError&) {
      throw;
    } catch (const Error& error) {
      // What is wrong with the ledger the verifier says.
      result_.remarks.push_back(std::string("older versions were not looked at: ") + error.what());
    }
  }

  ObjectStore& store_;
  const std::string prefix_, case_id_;
  const fs::path folder_;
  std::map<std::string, std::vector<ListedVersion>> versions_;  // by the file's name, newest first
  std::map<std::string, ListedVersion> parts_;  // by their names, which sort as their bytes do
  std::map<std::string, std::string> hashes_;   // of what was taken last, hexadecimal
  FetchedCase result_;
};

FetchedCase fetch(ObjectStore& store, const std::string& appliance, const std::string& name,
                  const fs::path& into) {
  const fs::path folder = into / name, part = into / (".fetching-" + name);
  if (std::error_code ignored; fs::exists(fs::symlink_status(folder, ignored))) {
    throw UsageError(folder.string() + " is there already: give another folder with -o");
  }
  std::error_code failed;
  fs::remove_all(part, failed);
  if (failed) throw IoError("remove", part, failed.value());
  FetchedCase result = Fetching(store, appliance + "/", name, part).run();
  fs::rename(part, folder, failed);
  if (failed) throw IoError("rename", part, failed.value());
  result.folder = folder;
  return result;
}

}  // namespace

std::vector<std::string> cases_in_store(ObjectStore& store, const std::string& appliance) {
  std::vector<std::string> cases = store.folders(appliance + "/");
  const std::vector<std::string> growing = store.folders(appliance + "/" + std::string(kGrowing));
  cases.insert(cases.end(), growing.begin(), growing.end());
  std::erase_if(cases, [](const std::string& name) { return !archive::is_case_id(name); });
  std::ranges::sort(cases);
  cases.erase(std::unique(cases.begin(), cases.end()), cases.end());  // Clang 14 knows no ranges::unique here
  return cases;
}

bool fetch_ledger(ObjectStore& store, const std::string& appliance, const std::string& case_id,
                  const fs::path& folder) {
  return Fetching(store, appliance + "/", case_id, folder).run_ledger();
}

FetchedCase fetch_case(ObjectStore& store, const std::string& appliance, const std::string& case_id,
                       const fs::path& into) {
  if (!archive::is_case_id(case_id)) {
    throw UsageError("'" + printable(case_id) + "' is no case identifier such as 20260805T091502Z-3f9c21ab");
  }
  return fetch(store, appliance, case_id, into);
}

FetchedCase fetch_log(ObjectStore& store, const std::string& appliance, const fs::path& into) {
  return fetch(store, appliance, std::string(kLog), into);
}

}  // namespace kiroku::fleet

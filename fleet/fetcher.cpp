#include "fleet/fetcher.h"

#include <algorithm>
#include <cerrno>
#include <charconv>
#include <fcntl.h>
#include <iterator>
#include <map>
#include <optional>
#include <set>
#include <unistd.h>
#include <utility>

#include "archive/format/case_layout.h"
#include "archive/format/consent_layout.h"
#include "archive/format/ledger_entry.h"
#include "archive/format/limits.h"
#include "archive/format/store_statement.h"
#include "archive/reading/case_reader.h"
#include "base/descriptor.h"
#include "base/error.h"
#include "base/printable.h"
#include "crypto/encoding.h"
#include "fleet/erased_segments.h"
#include "fleet/stored_case.h"

namespace kiroku::fleet {
namespace {

namespace fs = std::filesystem;

constexpr std::size_t kMostRemarks = 1'000;
/// Of a ledger's names that no version is: whoever writes one may name what never was.
constexpr std::size_t kMostUnfit = 10'000;
/// Of a ledger that is read for a list or a page, where it takes nine times as much memory. Ten hours of four
/// streams have 3 MB.
constexpr std::uint64_t kLargestLedger = std::uint64_t{32} << 20;
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

/// Whether files of cases lie so deep there: what lies elsewhere could keep a file of the case from its
/// place.
bool is_place_of_file(std::string_view path, bool of_log) {
  const std::size_t end = path.find('/');
  const std::string_view first = path.substr(0, end);
  const auto deep = std::ranges::count(path, '/');
  if (first == archive::kSegmentsFolder) return deep == 2;
  if (of_log && archive::hash_of_consent_path(path)) return true;
  const bool is_folder = first == archive::kCheckpointsFolder || first == archive::kTokensFolder ||
                         first == archive::kAuthoritiesFolder;
  return deep == (is_folder ? 1 : 0);
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
  std::string finish(bool flush) {
    if (flush && ::fsync(file_.number()) != 0) throw IoError("flush", path_, errno);
    return crypto::to_hex(hash_.finish());
  }
  /// Of an empty one: that many bytes, which take no room.
  void resize(std::uint64_t bytes) {
    if (::ftruncate(file_.number(), static_cast<off_t>(bytes)) != 0) throw IoError("write", path_, errno);
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
  Fetching(ObjectStore& store, std::string prefix, std::string case_id, fs::path folder, WhichVersions which,
           UnreadableObjects unreadable = UnreadableObjects::kThrow,
           SegmentBytes segments = SegmentBytes::kFetched)
      : store_(store),
        prefix_(std::move(prefix)),
        case_id_(std::move(case_id)),
        folder_(std::move(folder)),
        which_(which),
        unreadable_(unreadable),
        segments_(segments) {}

  /// Its ledger alone; whether there is one.
  bool run_ledger() {
    // Whoever looks at a ledger alone fetches it anew where it is gone: nobody waits for the disk.
    flushes_ = false;
    const std::string ledger(archive::kLedgerFile);
    list_files(ledger);
    list_parts();
    make_folders(folder_);
    if (versions_.contains(ledger)) {
      std::vector<ListedVersion>& versions = versions_.at(ledger);
      const std::uint64_t bytes = versions.front().bytes;
      std::erase_if(versions, [](const ListedVersion& each) { return each.bytes > kLargestLedger; });
      if (versions.empty()) throw_too_long(bytes);
      take_ledger(versions);
    } else if (!parts_.empty()) {
      std::uint64_t bytes = 0;
      for (const auto& each : parts_) {
        bytes += std::min(each.second.bytes, kLargestLedger + 1);
        if (bytes > kLargestLedger) throw_too_long(bytes);
      }
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
    require_room();
    make_folders(folder_);
    for (const auto& [path, versions] : versions_) {
      if (path == archive::kLedgerFile) {
        take_ledger(versions);
      } else if (stays_in_store(path, versions)) {
        leave_in_store(path, versions.front());
      } else if (is_left(path)) {
        leave_segment(path, versions);
      } else {
        take(path, of_first_choice(versions));
      }
    }
    if (!versions_.contains(std::string(archive::kLedgerFile))) join_parts();
    if (case_id_ == kLog) {
      take_consents_of_their_names();
    } else {
      take_what_the_ledger_names();
    }
    tell_of_choices();
    for (const auto& each : held_) {
      const bool held = each.second.second;
      if ((held ? result_.holds.held : result_.holds.free)++ == 0)
        (held ? result_.holds.first_held : result_.holds.first_free) = each.second.first;
    }
    return std::move(result_);
  }

 private:
  /// Those whose names begin with `beginning`.
  void list_files(const std::string& beginning) {
    const std::string of_case = prefix_ + case_id_ + "/";
    store_.for_each_version(of_case + beginning, [&](const ListedVersion& each) {
      const std::string path = each.key.substr(of_case.size());
      count();
      if (!is_name_below(path) || !is_place_of_file(path, case_id_ == kLog)) {
        if (result_.remarks.size() >= kMostRemarks) return;
        result_.remarks.push_back("'" + printable(each.key) +
                                  "' was left out: nothing of Kiroku gives such a name");
        return;
      }
      std::vector<ListedVersion>& versions = versions_[path];
      const bool is_first = each.newest && !versions.empty() && !versions.front().newest;
      versions.insert(is_first ? versions.begin() : versions.end(), each);
    });
  }

  void list_parts() {
    const std::string of_parts = prefix_ + std::string(kGrowing) + case_id_ + "/";
    store_.for_each_version(of_parts, [&](const ListedVersion& each) {
      count();
      ListedVersion& part = parts_[each.key.substr(of_parts.size())];
      // From the newest to the oldest.
      if (part.key.empty() || which_ == WhichVersions::kOldest) part = each;
    });
  }

  [[noreturn]] void throw_too_long(std::uint64_t bytes) const {
    throw Error("the store's ledger of case " + case_id_ + " has " + std::to_string(bytes) +
                " bytes or more, and no recording of a hundred hours has more than " +
                std::to_string(kLargestLedger) +
                ": it was not read; 'kiroku fetch' gets the case and verifies it");
  }

  void count() {
    if (++listed_ <= kMostVersions) return;
    throw Error("the store lists more than " + std::to_string(kMostVersions) + " objects of '" + case_id_ +
                "', which no recording has: nothing was fetched");
  }

  /// The store tells how much it will send, and is taken at its word.
  void require_room() {
    std::uint64_t needed = 0;
    const auto add = [&](std::uint64_t bytes) { needed += std::min(bytes, UINT64_MAX - needed); };
    for (const auto& each : versions_) {
      if (!stays_in_store(each.first, each.second) && !is_left(each.first))
        add(of_first_choice(each.second).bytes);
    }
    for (const auto& each : parts_) add(each.second.bytes);
    std::error_code unknown;
    const fs::space_info space = fs::space(folder_.parent_path(), unknown);
    if (unknown || needed <= space.available) return;
    throw UsageError("the store lists " + std::to_string(needed) + " bytes of '" + case_id_ + "', and " +
                     folder_.parent_path().string() + " has room for " + std::to_string(space.available) +
                     ": give another folder");
  }

  [[nodiscard]] const ListedVersion& of_first_choice(const std::vector<ListedVersion>& versions) const {
    return which_ == WhichVersions::kOldest ? versions.back() : versions.front();
  }

  /// Of a ledger nothing tells which version is the recorded one, but that it must be of this case.
  void take_ledger(const std::vector<ListedVersion>& versions) {
    const std::string ledger(archive::kLedgerFile);
    take(ledger, of_first_choice(versions));
    if (versions.size() > 1 && case_id_ != kLog && !is_of_this_case()) {
      for (const ListedVersion& each : versions_to_try(versions)) {
        take(ledger, each);
        if (!is_of_this_case()) continue;
        ledger_chosen_ = result_.ledger_is_older = true;
        result_.remarks.push_back("of " + ledger + " another version was taken: the " + words_of_choice() +
                                  " is no ledger of this case");
        return;
      }
      take(ledger, of_first_choice(versions));
    }
  }
  [[nodiscard]] bool is_of_this_case() const {
    try {
      return archive::CaseReader::open(folder_).opening().case_id == case_id_;
    } catch (const Error&) {
      return false;
    }
  }

  [[nodiscard]] bool is_left(const std::string& path) const {
    return segments_ == SegmentBytes::kLeftOut &&
           path.starts_with(std::string(archive::kSegmentsFolder) + "/");
  }
  void leave_segment(const std::string& path, const std::vector<ListedVersion>& versions) {
    make_folders((folder_ / path).parent_path());
    NewFile(folder_ / path, O_TRUNC).finish(flushes_);
    result_.segments_left[path].versions = versions;
  }

  void take(const std::string& path, const ListedVersion& version) {
    make_folders((folder_ / path).parent_path());
    if (unreadable_ == UnreadableObjects::kThrow) {
      write(path, version);
      return;
    }
    result_.unreadable.erase(path);
    for (bool again = false;; again = true) {
      try {
        write(path, version);
        return;
      } catch (const IoError&) {
        throw;
      } catch (const StoreError& error) {
        constexpr long kForbidden = 403;
        if (error.status() == kForbidden) throw;
        // A store that is away does not answer this either.
        store_.look(version.key, version.version);
        if (again || !error.passes()) return leave_out(path, error.what());
      } catch (const Error& error) {
        if (again) return leave_out(path, error.what());
      }
    }
  }
  [[nodiscard]] bool stays_in_store(const std::string& path,
                                    const std::vector<ListedVersion>& versions) const {
    return segments_ == SegmentBytes::kInStore && versions.size() == 1 &&
           path.starts_with(std::string(archive::kSegmentsFolder) + "/");
  }
  void leave_in_store(const std::string& path, const ListedVersion& version) {
    make_folders((folder_ / path).parent_path());
    NewFile(folder_ / path, O_TRUNC).resize(version.bytes);
    result_.in_store.emplace(path, version);
    ++result_.objects;
  }
  void write(const std::string& path, const ListedVersion& version) {
    NewFile file(folder_ / path, O_TRUNC);
    hashes_[path] = download(version, file);
  }
  void leave_out(const std::string& path, const std::string& why) {
    hashes_[path].clear();
    fs::remove(folder_ / path);
    result_.unreadable[path] = why;
  }

  /// Its SHA-256, hexadecimal.
  std::string download(const ListedVersion& version, NewFile& file) {
    const std::uint64_t before = file.size();
    const StoredObject told =
        store_.get(version.key, version.version, version.bytes, [&](ByteView bytes) { file.write(bytes); });
    const std::uint64_t bytes = file.size() - before;
    if (bytes != told.bytes || bytes != version.bytes) {
      throw Error("of " + version.key + " the store sent " + std::to_string(bytes) +
                  " bytes where it told of " +
                  std::to_string(bytes != told.bytes ? told.bytes : version.bytes) + ": try again");
    }
    held_.insert_or_assign(version.key, std::pair(version, told.legal_hold));
    result_.holds.are_locks_told = result_.holds.are_locks_told || told.lock_ends || told.legal_hold;
    std::string hash = before == 0 ? file.finish(flushes_) : "";
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
    ledger.finish(flushes_);
  }

  /// Whoever has the appliance's keys can put other versions; what is named by its hash lies among the older
  /// ones. `who_names_it` ends the sentence; what is
  /// longer than `most_bytes` is not fetched. Whether one was taken that is.
  bool take_version_of(const std::string& path, const crypto::Sha256Digest& sha256,
                       std::optional<std::uint64_t> bytes, const std::string& who_names_it,
                       std::uint64_t most_bytes = UINT64_MAX) {
    const std::string hash = crypto::to_hex(sha256);
    const auto versions = versions_.find(path);
    if (versions == versions_.end()) return false;
    if (hashes_[path] == hash) return true;
    const ListedVersion& first = of_first_choice(versions->second);
    std::vector<ListedVersion> others;
    for (const ListedVersion& each : versions->second) {
      if (&each == &first || (bytes && each.bytes != *bytes) || each.bytes > most_bytes) continue;
      others.push_back(each);
    }
    const bool are_too_many = others.size() > kMostVersionsTried;
    for (const ListedVersion& each : versions_to_try(std::move(others))) {
      take(path, each);
      if (hashes_[path] != hash) continue;
      result_.remarks.push_back("of " + path + " another version was taken: the " + words_of_choice() +
                                " is not what " + who_names_it);
      return true;
    }
    if (are_too_many) {
      result_.remarks.push_back("of " + path + " " + std::to_string(kMostVersionsTried) +
                                " other versions are not what " + who_names_it +
                                ", and the rest was not tried");
    }
    if (versions->second.size() > 1) take(path, first);
    return false;
  }

  /// Sealed statements of consent are named by their own hashes.
  void take_consents_of_their_names() {
    for (const auto& each : versions_) {
      if (const auto sha256 = archive::hash_of_consent_path(each.first))
        take_version_of(each.first, *sha256, std::nullopt, "its name says", archive::kMaximumConsentBytes);
    }
  }

  void take_what_the_ledger_names() {
    const auto want = [&](const std::string& path, const crypto::Sha256Digest& sha256,
                          std::optional<std::uint64_t> bytes, std::uint64_t line = 0) {
      // What has no such name was never in a store, and must not be sought or put under it.
      const bool may_be_there = may_be_file_of_case(path);
      if (!versions_.contains(path) && (!may_be_there || result_.unfit.size() >= kMostUnfit)) return;
      // Of a single version there is nothing to choose.
      if (result_.in_store.contains(path)) return;
      // What the first line says counts: others may stand behind all that the device signed.
      if (!wanted_.insert(path).second) return;
      if (const auto left = result_.segments_left.find(path); left != result_.segments_left.end()) {
        left->second.sha256 = sha256;
        left->second.bytes = bytes;
        return;
      }
      const auto taken = hashes_.find(path);
      if (taken != hashes_.end() && taken->second == crypto::to_hex(sha256)) return;
      const std::uint64_t most = bytes ? UINT64_MAX : archive::kMaximumTokenBytes;
      const bool fits = take_version_of(path, sha256, bytes, "the ledger names", most);
      if (result_.unfit.size() < kMostUnfit) result_.unfit.push_back({path, sha256, bytes, line, fits});
    };
    try {
      const archive::CaseReader reader = archive::CaseReader::open(folder_);
      if (reader.opening().subject)
        want(reader.opening().subject->file, reader.opening().subject->sha256,
             reader.opening().subject->bytes);
      ErasedSegments erased;
      reader.for_each([&](const archive::CaseEntry& entry) {
        if (const auto* each = std::get_if<archive::ErasedEntry>(&entry.body)) erased.add(*each);
      });
      erased.join();
      std::uint64_t line = 0;
      reader.for_each([&](const archive::CaseEntry& entry) {
        if (const auto* segment = std::get_if<archive::SegmentEntry>(&entry.body)) {
          if (versions_.contains(segment->file.file) || !erased.has(*segment))
            want(segment->file.file, segment->file.sha256, segment->file.bytes, line);
        } else if (const auto* token = std::get_if<archive::TokenEntry>(&entry.body)) {
          want(token->file, token->sha256, std::nullopt, line);
        }
        ++line;
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

  [[nodiscard]] std::string words_of_choice() const {
    return which_ == WhichVersions::kOldest ? "oldest" : "newest";
  }

  /// No ledger names itself, nor the notes that sign it: whether the version that was taken is the recorded
  /// one, verification alone tells.
  void tell_of_choices() {
    std::size_t several = 0;
    std::string one;
    for (const auto& [path, versions] : versions_) {
      if (path.starts_with(archive::kSegmentsFolder) || path.starts_with(archive::kTokensFolder) ||
          archive::hash_of_consent_path(path) || versions.size() == 1 ||
          (ledger_chosen_ && path == archive::kLedgerFile))
        continue;
      if (++several == 1) one = path;
    }
    if (several == 0) return;
    result_.remarks.push_back(
        "the store holds several versions of " + one +
        (several > 1 ? " and of " + std::to_string(several - 1) + " others that no ledger names" : "") +
        ", and the " + words_of_choice() + " was taken: where that does not hold, try the " +
        (which_ == WhichVersions::kOldest ? "newest, without --oldest" : "oldest with --oldest"));
  }

  ObjectStore& store_;
  const std::string prefix_, case_id_;
  const fs::path folder_;
  const WhichVersions which_;
  const UnreadableObjects unreadable_;
  const SegmentBytes segments_;
  std::uint64_t listed_ = 0;
  bool flushes_ = true;
  bool ledger_chosen_ = false;  // by the case that it names, and not as the first choice
  std::map<std::string, std::vector<ListedVersion>> versions_;  // by the file's name, newest first
  std::map<std::string, ListedVersion> parts_;  // by their names, which sort as their bytes do
  std::map<std::string, std::string> hashes_;   // of what was taken last, hexadecimal
  std::map<std::string, std::pair<ListedVersion, bool>> held_;  // by key, as the store told of it
  std::set<std::string> wanted_;  // lines may name one file as often as their writer likes
  FetchedCase result_;
};

FetchedCase fetch(ObjectStore& store, const std::string& appliance, const std::string& name,
                  const fs::path& into, WhichVersions which,
                  UnreadableObjects unreadable = UnreadableObjects::kThrow,
                  SegmentBytes segments = SegmentBytes::kFetched) {
  const fs::path folder = into / name, part = into / (".fetching-" + name);
  if (std::error_code ignored; fs::exists(fs::symlink_status(folder, ignored))) {
    throw UsageError(folder.string() + " is there already: give another folder with -o");
  }
  std::error_code failed;
  fs::remove_all(part, failed);
  if (failed) throw IoError("remove", part, failed.value());
  FetchedCase result = Fetching(store, appliance + "/", name, part, which, unreadable, segments).run();
  fs::rename(part, folder, failed);
  if (failed) throw IoError("rename", part, failed.value());
  result.folder = folder;
  return result;
}

void require_case_id(const std::string& case_id) {
  if (!archive::is_case_id(case_id)) {
    throw UsageError("'" + printable(case_id) + "' is no case identifier such as 20260805T091502Z-3f9c21ab");
  }
}

/// What other devices stated of the case, beside its folder. Nobody names these files by a hash. What was put
/// first counts, as nobody can put an older version. None of them keeps the case from its place.
void fetch_statements(ObjectStore& store, const std::string& appliance, const std::string& case_id,
                      FetchedCase& fetched) {
  const std::string prefix = store_statements_prefix(appliance, case_id);
  constexpr std::size_t kMost = archive::kMostStoreStatements * (1 + archive::kMostTokensOfStatement);
  std::map<std::string, ListedVersion> oldest;
  bool are_more = false;
  try {
    store.for_each_version(prefix, [&](const ListedVersion& each) {
      const std::string name = each.key.substr(prefix.size());
      const bool is_statement = archive::is_store_statement_name(name);
      const std::uint64_t most =
          is_statement ? archive::kMaximumStoreStatementBytes : archive::kMaximumTokenBytes;
      if ((!is_statement && !archive::is_store_statement_token_name(name)) || each.bytes > most) return;
      are_more = are_more || (oldest.size() == kMost && !oldest.contains(name));
      // From the newest to the oldest.
      if (oldest.size() < kMost || oldest.contains(name)) oldest.insert_or_assign(name, each);
    });
  } catch (const Error& error) {
    fetched.remarks.push_back(std::string("what other devices stated of the case was not all listed: ") +
                              error.what());
  }
  if (are_more) {
    fetched.remarks.push_back("of what other devices stated of the case, more than " + std::to_string(kMost) +
                              " files were left out");
  }
  const fs::path folder = archive::store_statements_folder(fetched.folder, case_id);
  for (const auto& [name, version] : oldest) {
    try {
      make_folders(folder);
      NewFile file(folder / name, O_TRUNC);
      store.get(version.key, version.version, version.bytes, [&](ByteView bytes) { file.write(bytes); });
      if (file.size() != version.bytes) throw Error("it has another length than the store told");
      file.finish(true);
      ++fetched.objects;
      fetched.bytes += version.bytes;
    } catch (const Error& error) {
      std::error_code ignored;
      fs::remove(folder / name, ignored);
      fetched.remarks.push_back("'" + version.key +
                                "', which another device stated, did not come: " + error.what());
    }
  }
}

}  // namespace

bool may_be_file_of_case(std::string_view path) {
  return is_name_below(path) && is_place_of_file(path, false);
}

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
  return Fetching(store, appliance + "/", case_id, folder, WhichVersions::kNewest).run_ledger();
}

FetchedCase fetch_case(ObjectStore& store, const std::string& appliance, const std::string& case_id,
                       const fs::path& into, WhichVersions which, UnreadableObjects unreadable,
                       SegmentBytes segments) {
  require_case_id(case_id);
  FetchedCase fetched = fetch(store, appliance, case_id, into, which, unreadable, segments);
  fetch_statements(store, appliance, case_id, fetched);
  return fetched;
}

FetchedCase fetch_case_without_segments(ObjectStore& store, const std::string& appliance,
                                        const std::string& case_id, const fs::path& into) {
  require_case_id(case_id);
  return fetch(store, appliance, case_id, into, WhichVersions::kNewest, UnreadableObjects::kThrow,
               SegmentBytes::kLeftOut);
}

FetchedCase fetch_log(ObjectStore& store, const std::string& appliance, const fs::path& into) {
  return fetch(store, appliance, std::string(kLog), into, WhichVersions::kNewest);
}

}  // namespace kiroku::fleet

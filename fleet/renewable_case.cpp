#include "fleet/renewable_case.h"

#include <algorithm>
#include <cerrno>
#include <cstdlib>
#include <fcntl.h>
#include <functional>
#include <sys/stat.h>
#include <type_traits>
#include <unistd.h>
#include <utility>

#include "archive/format/limits.h"
#include "base/descriptor.h"
#include "base/error.h"
#include "fleet/stored_records.h"

namespace kiroku::fleet {
namespace {

namespace fs = std::filesystem;

void write_all(const Descriptor& file, const fs::path& place, ByteView bytes) {
  while (!bytes.empty()) {
    const ssize_t written = ::write(file.number(), bytes.data(), bytes.size());
    if (written < 0 && errno == EINTR) continue;
    if (written < 0) throw IoError("write in", place, errno);
    bytes = bytes.subspan(static_cast<std::size_t>(written));
  }
}

/// Gone once it is closed.
Descriptor nameless_file(const fs::path& folder) {
  std::string name = (folder / "segment-XXXXXX").string();
  Descriptor file(::mkostemp(name.data(), O_CLOEXEC));
  if (!file) throw IoError("make a file in", folder, errno);
  ::unlink(name.c_str());
  return file;
}

}  // namespace

StreamedFiles::StreamedFiles(StoreConnections& store, fs::path scratch)
    : store_(store), scratch_(std::move(scratch)) {}

void StreamedFiles::show(const FetchedCase& fetched) {
  segments_.clear();
  for (const auto& [path, segment] : fetched.segments_left)
    segments_.emplace((fetched.folder / path).string(), segment);
}

std::string StreamedFiles::away() const {
  const std::lock_guard guard(mutex_);
  return away_;
}

std::uint64_t StreamedFiles::bytes() const {
  const std::lock_guard guard(mutex_);
  return bytes_;
}

int StreamedFiles::bring(const SegmentInStore& segment) const {
  std::vector<ListedVersion> versions{segment.versions.front()};
  if (segment.sha256 && segment.versions.size() > 1) versions = versions_to_try(segment.versions);
  const auto fits = [&](const ListedVersion& each) { return each.bytes == segment.bytes; };
  // One of another size is not what the ledger names; where all are, that is to be seen.
  if (std::ranges::any_of(versions, fits)) std::erase_if(versions, std::not_fn(fits));
  Descriptor first;
  for (const ListedVersion& each : versions) {
    if (each.bytes > archive::kMaximumSealedBytes)
      throw Error(each.key + " has more than 1 GiB: it was not read");
    Descriptor file = nameless_file(scratch_);
    crypto::Sha256 hash;
    try {
      store_.with([&](ObjectStore& store) {
        store.get(each.key, each.version, each.bytes, [&](ByteView bytes) {
          hash.update(bytes);
          write_all(file, scratch_, bytes);
        });
      });
    } catch (const StoreError& error) {
      // Whoever may put makes a version that nobody else can read: it hides no other one.
      if (!error.is_of_one_object() || (!first && &each == &versions.back())) throw;
      continue;
    }
    {
      const std::lock_guard guard(mutex_);
      bytes_ += each.bytes;
    }
    if (!segment.sha256 || hash.finish() == *segment.sha256) return file.release();
    if (!first) first = std::move(file);
  }
  return first.release();
}

int StreamedFiles::open_at(int folder, const std::string& name, int flags, const fs::path& path) const {
  const auto segment = segments_.find(path.string());
  if (segment == segments_.end()) return FileReading::open_at(folder, name, flags, path);
  const auto leave = [&](const std::string& why) {
    const std::lock_guard guard(mutex_);
    if (away_.empty()) away_ = why;
  };
  for (bool again = false;; again = true) {
    try {
      return bring(segment->second);
    } catch (const IoError& error) {
      leave(error.what());
      break;
    } catch (const Error& error) {
      if (again) break;
      // A store that is away does not answer this either: then nothing is said of the case.
      try {
        const ListedVersion& front = segment->second.versions.front();
        store_.with([&](ObjectStore& store) { store.look(front.key, front.version); });
      } catch (const StoreError& refusal) {
        if (!refusal.is_of_one_object()) leave(error.what());
        break;
      } catch (const Error&) {
        leave(error.what());
        break;
      }
    }
  }
  errno = EIO;
  return -1;
}

int StreamedFiles::status_at(int folder, const std::string& name, struct stat& status,
                             const fs::path& path) const {
  const int failed = FileReading::status_at(folder, name, status, path);
  const auto segment = segments_.find(path.string());
  if (failed == 0 && segment != segments_.end())
    status.st_size = static_cast<off_t>(segment->second.versions.front().bytes);
  return failed;
}

StoredRenewableCase::StoredRenewableCase(RenewalBatch& batch, std::string appliance, std::string case_id,
                                         std::optional<crypto::Sha256Digest> known)
    : batch_(batch),
      appliance_(std::move(appliance)),
      case_id_(std::move(case_id)),
      known_(known),
      files_(batch.store, batch.scratch) {}

/// What the store gives once it answers again is waited for; all others of the batch would fare the same.
template <typename Work>
auto StoredRenewableCase::ask(const Work& work) {
  if (!batch_.away.empty()) throw archive::RenewalWaits(batch_.away);
  try {
    return batch_.store.with(work);
  } catch (const StoreError& error) {
    if (!error.passes()) throw;
    batch_.away = error.what();
    throw archive::RenewalWaits(batch_.away);
  }
}

fs::path StoredRenewableCase::folder() {
  if (batch_.is_ended && batch_.is_ended()) throw archive::RenewalWaits("it was not looked at any more");
  const fs::path into = batch_.scratch / appliance_;
  std::error_code failed;
  fs::create_directories(into, failed);
  if (failed) throw IoError("create", into, failed.value());
  const FetchedCase fetched =
      ask([&](ObjectStore& store) { return fetch_case_without_segments(store, appliance_, case_id_, into); });
  files_.show(fetched);
  return fetched.folder;
}

std::string StoredRenewableCase::record_place(const std::string& /*case_id*/) const {
  return record_key(appliance_, case_id_) + " in the store";
}

void StoredRenewableCase::require_own(const std::string& case_id) const {
  if (case_id != case_id_)
    throw Error("the store's ledger of case " + case_id_ + " is of another one, " + case_id);
}

std::vector<Bytes> StoredRenewableCase::read_records(const std::string& case_id) {
  require_own(case_id);
  return ask([&](ObjectStore& store) { return stored_records(store, appliance_, case_id_); });
}

bool StoredRenewableCase::is_known_to_hold(const crypto::Sha256Digest& record) const {
  return known_ == record;
}

void StoredRenewableCase::write_record(const std::string& case_id, ByteView record) {
  require_own(case_id);
  ask([&](ObjectStore& store) { put_record(store, appliance_, case_id_, record); });
}

void StoredRenewableCase::let_go() {
  files_.hide();
  std::error_code ignored;
  fs::remove_all(batch_.scratch / appliance_ / case_id_, ignored);
  fs::remove_all(batch_.scratch / appliance_ / (".fetching-" + case_id_), ignored);
  if (std::string away = files_.away(); !away.empty()) {
    if (batch_.away.empty()) batch_.away = away;
    throw archive::RenewalWaits(away);
  }
}

}  // namespace kiroku::fleet

#include "fleet/case_shelf.h"

#include <algorithm>
#include <array>
#include <cerrno>
#include <fstream>
#include <iterator>
#include <utility>
#include <vector>

#include "archive/format/case_layout.h"
#include "archive/reading/case_reader.h"
#include "base/error.h"
#include "crypto/hash.h"
#include "fleet/fetcher.h"

namespace kiroku::fleet {
namespace {

namespace fs = std::filesystem;

/// A case that is not closed grows; one that is may be erased from, or renewed.
constexpr std::chrono::seconds kGrowingStays{15}, kClosedStays{600};
/// Hundreds of proofs would stand in the way of the segments that the first pictures need.
constexpr std::chrono::milliseconds kPicturesFirst{1000};
/// Before proofs that could not be fetched are tried again.
constexpr std::chrono::seconds kPause{15};
/// Of a day with a time-stamp a minute from each of ten authorities.
constexpr std::size_t kMostProofs = 20'000;
constexpr std::size_t kLargestProof = std::size_t{1} << 20;
constexpr std::size_t kAtOnce = 6;

void make_folder(const fs::path& folder) {
  std::error_code failed;
  fs::create_directories(folder, failed);
  if (failed) throw IoError("create", folder, failed.value());
}

void write_whole(const fs::path& path, ByteView bytes) {
  const fs::path part = path.string() + ".coming";
  std::ofstream file(part, std::ios::binary | std::ios::trunc);
  file.write(reinterpret_cast<const char*>(bytes.data()), static_cast<std::streamsize>(bytes.size()));
  file.close();
  if (!file) throw IoError("write", part, errno);
  fs::rename(part, path);
}

bool are_same(const fs::path& one, const fs::path& other) {
  std::error_code failed;
  if (fs::file_size(one, failed) != fs::file_size(other, failed) || failed) return false;
  std::ifstream first(one, std::ios::binary), second(other, std::ios::binary);
  return std::equal(std::istreambuf_iterator<char>(first), std::istreambuf_iterator<char>(),
                    std::istreambuf_iterator<char>(second));
}

/// A checkpoint or token file, and its versions, the newest in front.
struct Proof {
  std::string file;
  std::vector<std::string> versions = {};
};

bool is_proof(const std::string& file) {
  const std::string name = fs::path(file).filename().string();
  return archive::size_of_note_name(name) || archive::parse_token_name(name);
}

}  // namespace

struct CaseShelf::Kept {
  explicit Kept(fs::path case_folder) : folder(std::move(case_folder)) {}
  ~Kept() {
    end_fetching();
    std::error_code ignored;
    fs::remove_all(folder.parent_path().parent_path(), ignored);
  }
  Kept(const Kept&) = delete;
  Kept& operator=(const Kept&) = delete;

  /// Waits for the file that is being fetched.
  void end_fetching() {
    {
      const std::lock_guard guard(mutex);
      stop = true;
    }
    wake.notify_all();
    if (fetching.joinable()) fetching.join();
    stop = false;
  }

  const fs::path folder;
  std::mutex busy;  // guards what follows up to the next mutex
  bool is_there = false, is_closed = false;
  Clock::Time looked{};
  std::shared_ptr<const StoredSegments> segments;
  std::shared_ptr<const archive::CaseReader> ledger;
  std::thread fetching;
  std::mutex mutex;  // guards the three below
  Place::Proofs proofs = Place::Proofs::kComing;
  std::string problem;
  Clock::Time failed{};
  std::condition_variable wake;
  std::atomic<bool> stop{false};
};

CaseShelf::CaseShelf(fs::path folder, StoreConnections& store, const Clock& clock)
    : folder_(std::move(folder)), store_(store), clock_(clock) {}

CaseShelf::~CaseShelf() { stopping_ = true; }

std::shared_ptr<CaseShelf::Kept> CaseShelf::slot_of(const Name& name) {
  std::shared_ptr<Kept> gone;  // ends outside the lock: what is being fetched is waited for
  const std::lock_guard guard(mutex_);
  std::erase(in_order_, name);
  in_order_.push_front(name);
  std::shared_ptr<Kept>& slot = cases_[name];
  // Each in a folder of its own: what was let go of may still be in somebody's hands.
  if (!slot) slot = std::make_shared<Kept>(folder_ / std::to_string(++made_) / name.first / name.second);
  const std::shared_ptr<Kept> found = slot;
  if (in_order_.size() > kMostCases) {
    const auto last = cases_.find(in_order_.back());
    gone = std::move(last->second);
    cases_.erase(last);
    in_order_.pop_back();
  }
  return found;
}

std::optional<CaseShelf::Place> CaseShelf::find(const std::string& appliance, const std::string& case_id) {
  if (!archive::is_short_name(appliance) || !archive::is_case_id(case_id)) return {};
  const Name name{appliance, case_id};
  const std::shared_ptr<Kept> kept = slot_of(name);
  const std::lock_guard busy(kept->busy);
  const bool is_old =
      !kept->is_there || clock_.now() - kept->looked > (kept->is_closed ? kClosedStays : kGrowingStays);
  bool has_changed = false;
  if (is_old) {
    has_changed = bring_ledger(*kept, name);
    if (!kept->is_there) return {};
    kept->looked = clock_.now();
  }
  Place place{kept->folder, kept->segments, kept->ledger, Place::Proofs::kComing, {}};
  {
    const std::lock_guard guard(kept->mutex);
    has_changed =
        has_changed || (kept->proofs == Place::Proofs::kMissing && clock_.now() - kept->failed > kPause);
    if (has_changed) kept->proofs = Place::Proofs::kComing;
    place.proofs = kept->proofs;
    place.problem = kept->problem;
  }
  if (has_changed) {
    kept->end_fetching();
    {
      // What was cut off just now has said that it failed.
      const std::lock_guard guard(kept->mutex);
      kept->proofs = Place::Proofs::kComing;
    }
    kept->fetching = std::thread(
        [this, &of = *kept, name, ledger = kept->ledger] { bring_proofs(of, name, ledger.get()); });
  }
  return place;
}

/// Whether it is another than before.
bool CaseShelf::bring_ledger(Kept& kept, const Name& name) {
  const fs::path coming = kept.folder / "coming", ledger = kept.folder / archive::kLedgerFile;
  make_folder(kept.folder);
  const bool is_known =
      store_.with([&](ObjectStore& store) { return fetch_ledger(store, name.first, name.second, coming); });
  if (!is_known) return false;
  const bool is_same = kept.is_there && are_same(coming / archive::kLedgerFile, ledger);
  // Whoever judges by the file's time sees no change where there is none.
  if (!is_same) fs::rename(coming / archive::kLedgerFile, ledger);
  kept.is_there = true;
  if (is_same) return false;
  kept.segments =
      std::make_shared<StoredSegments>(store_, cache_, ahead_, name.first + "/" + name.second + "/");
  read_ledger(kept);
  return true;
}

void CaseShelf::read_ledger(Kept& kept) {
  kept.ledger = nullptr;
  try {
    kept.ledger = std::make_shared<const archive::CaseReader>(archive::CaseReader::open(kept.folder));
  } catch (const IoError&) {
    throw;
  } catch (const Error&) {
    return;  // whoever opens the case is told why its ledger cannot be read
  }
  kept.is_closed = kept.ledger->closing().has_value();
  bring_subject(kept);
}

void CaseShelf::bring_subject(Kept& kept) {
  const std::optional<archive::FileReference>& subject = kept.ledger->opening().subject;
  if (!subject || subject->bytes > kLargestProof || subject->file != archive::kSubjectFile) return;
  try {
    const auto source = kept.segments->open(*subject);
    Bytes bytes(static_cast<std::size_t>(source->size()));
    source->read_at(0, bytes);
    write_whole(kept.folder / subject->file, bytes);
  } catch (const StoreError& error) {
    if (error.passes()) throw;
  } catch (const IoError&) {
    throw;
  } catch (const Error&) {
    // Without it the case can be watched: whoever asks for the subject is told that it is not there.
  }
}

void CaseShelf::bring_proofs(Kept& kept, const Name& name, const archive::CaseReader* ledger) {
  const auto is_over = [&] { return kept.stop || stopping_; };
  const auto end = [&](Place::Proofs proofs, const std::string& problem) {
    const std::lock_guard guard(kept.mutex);
    kept.proofs = proofs;
    kept.problem = problem;
    kept.failed = clock_.now();
  };
  try {
    {
      std::unique_lock lock(kept.mutex);
      clock_.wait_for(kept.wake, lock, kPicturesFirst, [&kept] { return kept.stop.load(); });
    }
    const std::string prefix = name.first + "/" + name.second + "/";
    std::vector<Proof> proofs;
    std::map<std::string, std::size_t> at;
    for (const std::string_view folder : {archive::kCheckpointsFolder, archive::kTokensFolder}) {
      make_folder(kept.folder / folder);
      store_.with([&](ObjectStore& store) {
        store.for_each_version(prefix + std::string(folder) + "/", [&](const ListedVersion& each) {
          const std::string file = each.key.substr(prefix.size());
          if (!is_plain_key(file) || fs::path(file).parent_path() != folder || !is_proof(file)) return;
          if (is_over()) throw Error("it was not fetched to its end");
          const auto [found, is_new] = at.try_emplace(file, proofs.size());
          if (is_new) proofs.push_back({file});
          if (proofs.size() > kMostProofs)
            throw Error("the store has more than " + std::to_string(kMostProofs) +
                        " checkpoints and time-stamps of this case: verify it");
          std::vector<std::string>& versions = proofs[found->second].versions;
          if (versions.size() >= kMostVersionsTried) return;
          versions.insert(each.newest ? versions.begin() : versions.end(), each.version);
        });
      });
    }
    std::map<std::string, crypto::Sha256Digest> stated;
    if (ledger != nullptr) {
      for (const auto& each : ledger->tokens()) stated[each.entry.file] = each.entry.sha256;
    }
    std::atomic<std::size_t> next{0};
    const auto bring = [&] {
      store_.with([&](ObjectStore& store) {
        for (std::size_t i = next++; i < proofs.size() && !is_over(); i = next++) {
          const Proof& proof = proofs[i];
          const auto hash = stated.find(proof.file);
          Bytes newest;
          for (std::size_t v = 0; v < proof.versions.size(); ++v) {
            Bytes bytes = store.get(prefix + proof.file, proof.versions[v], kLargestProof);
            const bool is_stated = hash == stated.end() || crypto::sha256(bytes) == hash->second;
            if (v == 0 || is_stated) newest = std::move(bytes);
            if (is_stated) break;
          }
          write_whole(kept.folder / proof.file, newest);
        }
      });
    };
    std::array<std::exception_ptr, kAtOnce> failures;
    std::vector<std::thread> others;
    for (std::exception_ptr& failure : failures) {
      others.emplace_back([&bring, &failure, &next, &proofs] {
        try {
          bring();
        } catch (...) {
          failure = std::current_exception();
          next = proofs.size();
        }
      });
    }
    for (std::thread& each : others) each.join();
    for (const std::exception_ptr& failure : failures) {
      if (failure) std::rethrow_exception(failure);
    }
    end(is_over() ? Place::Proofs::kMissing : Place::Proofs::kThere, "");
  } catch (const std::exception& error) {
    end(Place::Proofs::kMissing, error.what());
  }
}

}  // namespace kiroku::fleet

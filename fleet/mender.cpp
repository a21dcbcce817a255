#include "fleet/mender.h"

#include <algorithm>
#include <map>
#include <optional>
#include <utility>

#include "archive/format/case_folder.h"
#include "archive/format/case_layout.h"
#include "archive/format/limits.h"
#include "archive/format/line_reader.h"
#include "base/error.h"
#include "base/printable.h"
#include "crypto/encoding.h"
#include "crypto/file_hash.h"
#include "crypto/merkle_tree.h"

namespace kiroku::fleet {
namespace {

namespace fs = std::filesystem;

/// Of a ledger; ten hours of four streams have 3 MB.
constexpr std::uint64_t kMostOfLedger = std::uint64_t{256} << 20;

/// The tree over a ledger's whole lines; nothing where it is not there or has a line that no ledger has.
std::optional<crypto::MerkleTree> tree_of(const fs::path& ledger) {
  if (!archive::real_reading().exists(ledger)) return {};
  const archive::ReadableFile file = archive::real_reading().open_to_read(ledger);
  if (file.size() > kMostOfLedger) return {};
  crypto::MerkleTree tree;
  archive::LineReader lines(file);
  archive::LedgerLine line;
  while (lines.next(line)) {
    if (line.torn) break;
    if (line.too_long) return {};
    tree.append(crypto::merkle_leaf_hash(bytes_of(line.text)));
  }
  return tree;
}

bool is_over(const std::optional<crypto::MerkleTree>& tree, const crypto::Checkpoint& checkpoint) {
  return tree && tree->size() >= checkpoint.size && tree->root(checkpoint.size) == checkpoint.root;
}

}  // namespace

/// One look at one case.
class Mender::Pass {
 public:
  Pass(Mender& mender, const std::string& appliance, const std::string& case_id,
       const std::vector<crypto::VerifierKey>& devices, const FetchedCase& fetched, const StateMending& state)
      : mender_(mender),
        appliance_(appliance),
        case_id_(case_id),
        devices_(devices),
        fetched_(fetched),
        state_(state) {}

  Mending run() {
    read_notes();
    if (signed_.empty()) {
      if (is_anything_unfit())
        leave(std::string(archive::kLedgerFile),
              "the store has no checkpoint of the case that its device signed by all its keys, so nothing "
              "tells which bytes were recorded");
      return std::move(result_);
    }
    const crypto::Checkpoint& newest = signed_.rbegin()->second;
    const std::optional<crypto::MerkleTree> tree = tree_of(fetched_.folder / archive::kLedgerFile);
    if (!is_over(tree, newest)) {
      mend_ledger(newest);
      return std::move(result_);
    }
    if (fetched_.ledger_is_older && tree->size() == newest.size)
      put_from_folder(std::string(archive::kLedgerFile));
    const std::uint64_t believed = believed_lines(*tree);
    mend_notes(*tree);
    for (const UnfitFile& each : fetched_.unfit) mend_file(each, believed);
    return std::move(result_);
  }

 private:
  struct Candidate {
    fs::path file;
    std::string from;
  };

  [[nodiscard]] bool is_anything_unfit() const {
    return !fetched_.unfit.empty() || !unsigned_.empty() || fetched_.ledger_is_older ||
           !fetched_.unreadable.empty();
  }

  /// What the note says, where a device of the case signed it over so many lines.
  [[nodiscard]] std::optional<crypto::Checkpoint> signed_checkpoint(std::string_view note,
                                                                    std::uint64_t size) const {
    const crypto::OpenedNote opened = crypto::open_note(note, devices_);
    // Hardware need not have answered.
    if (opened.failure && *opened.failure != crypto::NoteFailure::kLacksHardware) return {};
    std::optional<crypto::Checkpoint> checkpoint = crypto::Checkpoint::parse(opened.text);
    if (!checkpoint || checkpoint->size != size) return {};
    const bool is_of_case = std::ranges::any_of(devices_, [&](const crypto::VerifierKey& device) {
      return checkpoint->origin == archive::case_origin(device.name(), case_id_);
    });
    return is_of_case ? checkpoint : std::nullopt;
  }

  [[nodiscard]] std::optional<crypto::Checkpoint> signed_file(const fs::path& file,
                                                              std::uint64_t size) const {
    const archive::ReadableFile note = archive::real_reading().open_to_read(file);
    const auto text = archive::read_small(note, archive::kMaximumNoteBytes);
    return text ? signed_checkpoint(*text, size) : std::nullopt;
  }

  void read_notes() {
    const std::string folder(archive::kCheckpointsFolder);
    const archive::FileReading& files = archive::real_reading();
    if (files.is_folder(fetched_.folder / folder)) {
      for (const std::string& name : files.names_in(fetched_.folder / folder)) {
        if (const auto size = archive::size_of_note_name(name)) read_note(*size);
      }
    }
    for (const auto& each : fetched_.unreadable) {
      if (!each.first.starts_with(folder + "/")) continue;
      if (const auto size = archive::size_of_note_name(each.first.substr(folder.size() + 1)))
        unsigned_.push_back(*size);
    }
    for (const std::uint64_t size : unsigned_) seek_note(size);
  }
  void read_note(std::uint64_t size) {
    if (auto checkpoint = signed_file(fetched_.folder / archive::note_path(size), size)) {
      signed_.emplace(size, std::move(*checkpoint));
    } else {
      unsigned_.push_back(size);
    }
  }
  /// Another one under that name that the device signed.
  void seek_note(std::uint64_t size) {
    std::optional<crypto::Checkpoint> found;
    const auto candidate =
        seek(archive::note_path(size), {}, archive::kMaximumNoteBytes, [&](const fs::path& file) {
          found = signed_file(file, size);
          return found.has_value();
        });
    if (!candidate) return;
    signed_.emplace(size, std::move(*found));
    notes_.emplace(size, *candidate);
  }

  /// Of a closed case whose last lines no checkpoint in the store is over, that checkpoint may have been
  /// lost.
  std::uint64_t believed_lines(const crypto::MerkleTree& tree) {
    if (!fetched_.growing && !signed_.contains(tree.size()) &&
        std::ranges::find(unsigned_, tree.size()) == unsigned_.end()) {
      seek_note(tree.size());
      if (const auto found = signed_.find(tree.size());
          found != signed_.end() && !is_over(tree, found->second)) {
        notes_.erase(tree.size());
        signed_.erase(found);
      }
    }
    return signed_.rbegin()->first;
  }

  void mend_ledger(const crypto::Checkpoint& newest) {
    const std::string path(archive::kLedgerFile);
    if (fetched_.growing) {
      leave(path, "it does not fit the checkpoint over " + std::to_string(newest.size) +
                      " lines, and lies in parts, as of a case that is not closed");
      return;
    }
    const auto candidate = seek(path, {}, kMostOfLedger, [&](const fs::path& file) {
      const std::optional<crypto::MerkleTree> tree = tree_of(file);
      return tree && tree->size() == newest.size && tree->root(newest.size) == newest.root;
    });
    if (!candidate) {
      leave(path, "no copy fits the checkpoint that the device signed over " + std::to_string(newest.size) +
                      " lines" + doubts());
      return;
    }
    put(path, *candidate);
  }

  void mend_notes(const crypto::MerkleTree& tree) {
    for (const auto& [size, candidate] : notes_) {
      if (is_over(tree, signed_.at(size))) {
        put(archive::note_path(size), candidate);
      } else {
        leave(archive::note_path(size), "what copies have is not of these lines");
      }
    }
    for (const std::uint64_t size : unsigned_) {
      if (!notes_.contains(size))
        leave(archive::note_path(size), "no copy has one that the device signed" + doubts());
    }
  }

  void mend_file(const UnfitFile& file, std::uint64_t believed) {
    if (file.entry >= believed) {
      leave(file.path, "the line that names it is behind the " + std::to_string(believed) +
                           " lines that the device signed");
      return;
    }
    if (file.older_fits) {
      put_from_folder(file.path);
      return;
    }
    const auto candidate =
        seek(file.path, file.bytes, archive::kMaximumSealedBytes,
             [&](const fs::path& found) { return crypto::hash_file(found).sha256 == file.sha256; });
    if (candidate) {
      put(file.path, *candidate);
    } else {
      leave(file.path, "no copy has the bytes that the ledger names" + doubts());
    }
  }

  /// The first copy's file of which `is_right` says so.
  std::optional<Candidate> seek(const std::string& path, std::optional<std::uint64_t> bytes,
                                std::uint64_t most_bytes,
                                const std::function<bool(const fs::path&)>& is_right) {
    doubts_.clear();
    const fs::path into = mender_.scratch_ / std::to_string(++sought_);
    for (const auto& copy : mender_.copies_) {
      try {
        const FileOfCase file{appliance_, case_id_, path, bytes, most_bytes};
        if (copy->bring(file, into, [&] { return is_right(into); })) return Candidate{into, copy->name()};
      } catch (const Error& error) {
        // One copy that is away keeps no other from being asked; the store itself is waited for.
        const auto* of_store = dynamic_cast<const StoreError*>(&error);
        if (copy == mender_.copies_.front() && of_store != nullptr && of_store->passes()) throw;
        doubts_ += "; " + copy->name() + " could not be asked: " + error.what();
      }
    }
    fs::remove(into);
    return {};
  }
  [[nodiscard]] std::string doubts() const { return doubts_; }

  void put_from_folder(const std::string& path) {
    put(path, {fetched_.folder / path, mender_.copies_.front()->name()});
  }

  /// As long and as firmly as what was there.
  PutLock lock_like(const std::string& path) {
    PutLock lock;
    const std::string prefix = appliance_ + "/" + case_id_ + "/";
    for (const std::string& key : {prefix + path, prefix + std::string(archive::kLedgerFile)}) {
      std::vector<std::string> versions;
      mender_.store_->for_each_version(key, [&](const ListedVersion& each) {
        if (each.key == key && versions.size() < kMostVersionsTried) versions.push_back(each.version);
      });
      for (const std::string& version : versions) {
        const std::optional<StoredObject> there = mender_.store_->look(key, version);
        if (!there) continue;
        lock.legal_hold = lock.legal_hold || there->legal_hold;
        if (there->compliance && there->lock_ends)
          lock.ends = std::max(lock.ends.value_or(*there->lock_ends), *there->lock_ends);
      }
    }
    if (!lock.ends || *lock.ends <= mender_.clock_.utc())
      throw Error(
          "nothing locks what the store has of the case any more, so nothing says how long to lock it");
    return lock;
  }

  void put(const std::string& path, const Candidate& candidate) {
    try {
      const std::string key = appliance_ + "/" + case_id_ + "/" + path;
      const crypto::FileHash hash = crypto::hash_file(candidate.file);
      const PutLock lock = lock_like(path);
      state_("mends " + path + " from " + candidate.from);
      const std::string version =
          mender_.store_->put(key, *crypto::open_file_source(candidate.file), hash.sha256, lock);
      require_there(key, version, hash, lock);
      state_("mended " + path + " from " + candidate.from + ", sha256 " + crypto::to_hex(hash.sha256) +
             ", version " + printable(version));
      result_.mended.push_back({path, hash.sha256, candidate.from, version});
      // Whoever judges the folder judges what the store has now.
      if (candidate.file != fetched_.folder / path) {
        fs::create_directories((fetched_.folder / path).parent_path());
        fs::rename(candidate.file, fetched_.folder / path);
      }
    } catch (const StoreError& error) {
      if (error.passes()) throw;
      leave(path, error.what());
    } catch (const IoError&) {
      throw;
    } catch (const Error& error) {
      leave(path, error.what());
    }
  }

  void require_there(const std::string& key, const std::string& version, const crypto::FileHash& hash,
                     const PutLock& lock) {
    const std::optional<StoredObject> told = mender_.store_->look(key, version);
    crypto::Sha256 read;
    if (told) {
      mender_.store_->get(key, version, hash.bytes, [&](ByteView bytes) { read.update(bytes); });
    }
    if (!told || told->bytes != hash.bytes || read.finish() != hash.sha256 || !told->compliance ||
        !told->lock_ends || *told->lock_ends < std::chrono::floor<std::chrono::seconds>(*lock.ends) ||
        (lock.legal_hold && !told->legal_hold))
      throw Error("the store took " + key +
                  ", and does not hold it as it was put: its locks or its disks "
                  "cannot be relied on");
  }

  void leave(const std::string& path, const std::string& why) {
    result_.left.push_back({path, why});
    state_("could not mend " + path + ": " + why);
  }

  Mender& mender_;
  const std::string &appliance_, &case_id_;
  const std::vector<crypto::VerifierKey>& devices_;
  const FetchedCase& fetched_;
  const StateMending& state_;
  std::map<std::uint64_t, crypto::Checkpoint> signed_;  // by size: of the store, and of copies where its own
  std::vector<std::uint64_t> unsigned_;                 // is none that the device signed
  std::map<std::uint64_t, Candidate> notes_;            // to be put
  std::uint64_t sought_ = 0;
  std::string doubts_;  // of the copies that were asked last
  Mending result_;
};

Mender::Mender(std::shared_ptr<ObjectStore> store, std::vector<std::unique_ptr<CaseCopy>> copies,
               fs::path scratch, const Clock& clock)
    : store_(std::move(store)), scratch_(std::move(scratch)), clock_(clock) {
  copies_.push_back(copy_in_store("an older version", store_));
  for (auto& each : copies) copies_.push_back(std::move(each));
}

Mending Mender::mend(const std::string& appliance, const std::string& case_id,
                     const std::vector<crypto::VerifierKey>& devices, const FetchedCase& fetched,
                     const StateMending& state) {
  fs::remove_all(scratch_);
  fs::create_directories(scratch_);
  Mending result = Pass(*this, appliance, case_id, devices, fetched, state).run();
  fs::remove_all(scratch_);
  return result;
}

}  // namespace kiroku::fleet

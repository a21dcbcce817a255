#include "fleet/mender.h"

#include <algorithm>
#include <map>
#include <optional>
#include <set>
#include <type_traits>
#include <utility>
#include <variant>

#include "archive/format/case_folder.h"
#include "archive/format/case_layout.h"
#include "archive/format/ledger_entry.h"
#include "archive/format/limits.h"
#include "archive/format/line_reader.h"
#include "base/error.h"
#include "base/printable.h"
#include "crypto/encoding.h"
#include "crypto/file_hash.h"
#include "crypto/merkle_tree.h"
#include "fleet/erased_segments.h"
#include "fleet/held_objects.h"

namespace kiroku::fleet {
namespace {

namespace fs = std::filesystem;

/// Of a ledger; ten hours of four streams have 3 MB.
constexpr std::uint64_t kMostOfLedger = std::uint64_t{256} << 20;
// Whoever has the appliance's keys to the store puts as many names as they like, and a taken appliance signs
// as many lines: what is sought, named and stated of one case is bounded.
/// So many notes, and as many files, are sought in vain in one look.
constexpr std::uint64_t kMostInVain = 1'000;
/// So many notes over more lines than the ledger has: one of them may say that the ledger was cut.
constexpr std::uint64_t kMostBeyond = 100;
constexpr std::size_t kMostNamed = 1'000;
constexpr std::size_t kMostStated = 20;

struct Ledger {
  crypto::MerkleTree tree;  // over its whole lines
  std::string opening;      // the first of them
  bool is_torn = false;     // bytes stand behind the last line
};

/// A hash tree takes 64 bytes of memory for each line, however short that is. A case of ten hours has some
/// 80,000.
constexpr std::uint64_t kMostLines = 4'000'000;

/// Nothing where it is not there, has a line that no ledger has, or more lines than `most`.
std::optional<Ledger> read_ledger(const fs::path& path, std::uint64_t most = kMostLines) {
  if (!archive::real_reading().exists(path)) return {};
  const archive::ReadableFile file = archive::real_reading().open_to_read(path);
  if (file.size() > kMostOfLedger) return {};
  Ledger ledger;
  archive::LineReader lines(file);
  archive::LedgerLine line;
  while (!ledger.is_torn && lines.next(line)) {
    ledger.is_torn = line.torn;
    if (line.torn) continue;
    if (line.too_long || ledger.tree.size() == most) return {};
    if (ledger.tree.size() == 0) ledger.opening = std::string(line.text);
    ledger.tree.append(crypto::merkle_leaf_hash(bytes_of(line.text)));
  }
  return ledger;
}

/// Whether the device may have left the lines from `first` on unsigned: it died before it signed how the case
/// ended, or what it entered behind that.
bool may_be_of_device(const fs::path& ledger, std::uint64_t first) {
  const archive::ReadableFile file = archive::real_reading().open_to_read(ledger);
  archive::LineReader lines(file);
  archive::LedgerLine line;
  bool closed = false;
  for (std::uint64_t number = 0; lines.next(line) && !line.torn; ++number) {
    const archive::EntryParse parse =
        line.too_long ? archive::EntryParse{} : archive::parse_case_entry(line.text);
    const auto is = [&](const auto& kind) {
      return parse.entry && std::holds_alternative<std::decay_t<decltype(kind)>>(parse.entry->body);
    };
    if (number < first) {
      closed = closed || is(archive::CloseEntry{});
    } else if (!is(archive::TokenEntry{}) && !is(archive::TokenMissedEntry{}) &&
               !is(archive::ErasedEntry{})) {
      return !closed;
    }
  }
  return true;
}

/// By which keys of its device a checkpoint is signed. Hardware need not have answered; Ed25519 alone signed
/// cases from before the device had an ML-DSA key.
enum class SignedBy { kEd25519Alone, kAllButHardware, kAll };

struct SignedCheckpoint {
  crypto::Checkpoint checkpoint;
  const crypto::VerifierKey* device = nullptr;
  SignedBy by = SignedBy::kAll;
};

/// As the verifier has it: the log's entry that states a key comes behind as many as the device had signed
/// without it.
bool is_from_before_ml_dsa(const Ledger& ledger, const crypto::VerifierKey& device) {
  const archive::EntryParse parse = archive::parse_case_entry(ledger.opening);
  const auto* open = parse.entry ? std::get_if<archive::OpenEntry>(&parse.entry->body) : nullptr;
  if (open == nullptr || device.ml_dsa_since() == 0 || open->appliance_log_size > device.ml_dsa_since())
    return false;
  try {
    return crypto::VerifierKey::parse(open->device) == device;
  } catch (const UsageError&) {
    return false;
  }
}

/// Whether it is over these lines, and signed as these need it.
bool is_over(const Ledger& ledger, const SignedCheckpoint& of) {
  return ledger.tree.size() >= of.checkpoint.size &&
         ledger.tree.root(of.checkpoint.size) == of.checkpoint.root &&
         (of.by != SignedBy::kEd25519Alone || is_from_before_ml_dsa(ledger, *of.device));
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
    look();
    if (!result_.has_other_ledger) leave_unreadable();
    state_what_is_left();
    return std::move(result_);
  }

 private:
  struct Candidate {
    fs::path file;
    std::string from;
  };
  struct FoundNote {
    SignedCheckpoint is;
    Candidate candidate;
  };

  void look() {
    const std::string path(archive::kLedgerFile);
    const std::optional<Ledger> ledger = read_ledger(fetched_.folder / path);
    read_notes();
    seek_notes(ledger ? ledger->tree.size() : UINT64_MAX);
    // Somebody may have put notes again without their lines by ML-DSA.
    if (signed_.empty() && !alone_.empty() && !(ledger && is_over(*ledger, alone_.rbegin()->second)))
      seek_whole();
    if (signed_.empty() && alone_.empty()) {
      if (is_anything_unfit())
        leave(path,
              "the store has no checkpoint of the case that its device signed by all its keys, so nothing "
              "tells which bytes were recorded");
      return;
    }
    const SignedCheckpoint newest = signed_.empty() ? alone_.rbegin()->second : signed_.rbegin()->second;
    if (!ledger || !is_over(*ledger, newest)) {
      mend_ledger(newest);
      return;
    }
    take_alone(*ledger);
    const std::uint64_t believed = believed_lines(*ledger);
    judge_end(*ledger, believed);
    if (result_.has_other_ledger) return;
    read_erased(believed);
    for (const UnfitFile& each : fetched_.unfit) {
      if (each.entry < believed && !erased_files_.contains(each.path)) mend_file(each);
    }
    mend_falsely_erased(believed);
    leave_out_erased();
    mend_notes(*ledger);
    for (const UnfitFile& each : fetched_.unfit) {
      if (each.entry >= believed)
        leave(each.path, "the line that names it is behind the " + std::to_string(believed) +
                             " lines that the device signed");
    }
  }

  [[nodiscard]] bool is_anything_unfit() const {
    return !fetched_.unfit.empty() || !unsigned_.empty() || fetched_.ledger_is_older ||
           !fetched_.unreadable.empty();
  }

  /// What the note says, where a device of the case signed it over so many lines.
  [[nodiscard]] std::optional<SignedCheckpoint> signed_checkpoint(std::string_view note,
                                                                  std::uint64_t size) const {
    for (const crypto::VerifierKey& device : devices_) {
      const crypto::OpenedNote opened = crypto::open_note(note, {device});
      SignedCheckpoint found{{}, &device, SignedBy::kAll};
      if (opened.failure == crypto::NoteFailure::kLacksHardware) {
        found.by = SignedBy::kAllButHardware;
      } else if (opened.failure == crypto::NoteFailure::kLacksMlDsa && device.ml_dsa_since() > 0) {
        found.by = SignedBy::kEd25519Alone;
      } else if (opened.failure) {
        continue;
      }
      std::optional<crypto::Checkpoint> checkpoint = crypto::Checkpoint::parse(opened.text);
      if (!checkpoint || checkpoint->size != size ||
          checkpoint->origin != archive::case_origin(device.name(), case_id_))
        continue;
      found.checkpoint = std::move(*checkpoint);
      return found;
    }
    return {};
  }

  [[nodiscard]] std::optional<SignedCheckpoint> signed_file(const fs::path& file, std::uint64_t size) const {
    const archive::ReadableFile note = archive::real_reading().open_to_read(file);
    const auto text = archive::read_small(note, archive::kMaximumNoteBytes);
    return text ? signed_checkpoint(*text, size) : std::nullopt;
  }

  void read_notes() {
    const std::string folder(archive::kCheckpointsFolder);
    const archive::FileReading& files = archive::real_reading();
    if (files.is_folder(fetched_.folder / folder)) {
      for (const std::string& name : files.names_in(fetched_.folder / folder)) {
        const auto size = archive::size_of_note_name(name);
        if (!size) continue;
        if (const auto found = signed_file(fetched_.folder / archive::note_path(*size), *size)) {
          enter(*size, *found);
        } else {
          unsigned_[*size];
        }
      }
    }
    for (const auto& each : fetched_.unreadable) {
      if (!each.first.starts_with(folder + "/")) continue;
      if (const auto size = archive::size_of_note_name(each.first.substr(folder.size() + 1)))
        unsigned_[*size];
    }
  }
  void enter(std::uint64_t size, const SignedCheckpoint& what) {
    (what.by == SignedBy::kEd25519Alone ? alone_ : signed_).insert_or_assign(size, what);
  }

  /// In place of those that no device signed. The ledger has so many lines: the largest note over them first.
  void seek_notes(std::uint64_t lines) {
    std::vector<std::uint64_t> sizes;
    for (const auto& each : unsigned_) sizes.push_back(each.first);
    const auto beyond = std::ranges::upper_bound(sizes, lines);
    std::reverse(sizes.begin(), beyond);
    const auto seen = static_cast<std::uint64_t>(beyond - sizes.begin()) + kMostBeyond;
    for (std::uint64_t at = 0; at < sizes.size(); ++at) {
      const std::uint64_t size = sizes[at];
      if (at >= seen) {
        unsigned_[size] = "it is not of the ledger, which has fewer lines";
      } else if (const auto found = seek_note(size, unsigned_[size])) {
        enter(size, found->is);
        notes_.insert_or_assign(size, found->candidate);
      }
    }
  }
  /// The largest note in whose place a copy has one by all keys.
  void seek_whole() {
    std::vector<std::uint64_t> sizes;
    for (const auto& each : alone_) sizes.push_back(each.first);
    for (auto size = sizes.rbegin(); size != sizes.rend() && signed_.empty(); ++size) {
      std::string why;
      const auto found = seek_note(*size, why);
      if (!found && notes_in_vain_ == kMostInVain) return;
      if (!found || found->is.by == SignedBy::kEd25519Alone) continue;
      alone_.erase(*size);
      enter(*size, found->is);
      notes_.insert_or_assign(*size, found->candidate);
    }
  }

  /// Another one under that name that the device signed: the first one by all keys, else one by fewer.
  std::optional<FoundNote> seek_note(std::uint64_t size, std::string& why) {
    if (notes_in_vain_ == kMostInVain) {
      why = "it was not looked for, after " + std::to_string(kMostInVain) + " others that no copy has";
      return {};
    }
    std::optional<FoundNote> best;
    seek(archive::note_path(size), {}, archive::kMaximumNoteBytes, [&](const Candidate& candidate) {
      const auto found = signed_file(candidate.file, size);
      if (!found || (best && found->by <= best->is.by)) return false;
      const fs::path kept = mender_.scratch_ / ("note-" + std::to_string(size));
      fs::copy_file(candidate.file, kept, fs::copy_options::overwrite_existing);
      best = FoundNote{*found, {kept, candidate.from}};
      return found->by == SignedBy::kAll;
    });
    if (!best) {
      ++notes_in_vain_;
      why = "no copy has one that the device signed" + doubts_;
    }
    return best;
  }

  /// Behind a note by both keys none is from before: a device that has both uses both.
  [[nodiscard]] bool is_taken(const Ledger& ledger, const SignedCheckpoint& what) const {
    const auto first = std::ranges::find_if(
        signed_, [](const auto& each) { return each.second.by != SignedBy::kEd25519Alone; });
    return is_over(ledger, what) && (what.by != SignedBy::kEd25519Alone || first == signed_.end() ||
                                     what.checkpoint.size < first->first);
  }

  /// Those by Ed25519 alone count where the case is from before the ML-DSA key.
  void take_alone(const Ledger& ledger) {
    for (const auto& [size, what] : std::exchange(alone_, {})) {
      if (is_taken(ledger, what)) {
        signed_.emplace(size, what);
        continue;
      }
      std::string& why = unsigned_[size];
      if (notes_.erase(size) > 0) {
        why = "what copies have was not signed by the ML-DSA key of the device";
      } else if (const auto found = seek_note(size, why); found && is_taken(ledger, found->is)) {
        signed_.emplace(size, found->is);
        notes_.emplace(size, found->candidate);
      } else if (found) {
        why = "no copy has one that the device signed by its ML-DSA key" + doubts_;
      }
    }
  }

  /// Of a closed case whose last lines no checkpoint in the store is over, that checkpoint may have been
  /// lost.
  std::uint64_t believed_lines(const Ledger& ledger) {
    const std::uint64_t size = ledger.tree.size();
    if (!fetched_.growing && !signed_.contains(size) && !unsigned_.contains(size)) {
      std::string why;
      if (const auto found = seek_note(size, why); found && is_taken(ledger, found->is)) {
        signed_.emplace(size, found->is);
        notes_.emplace(size, found->candidate);
      }
    }
    return signed_.rbegin()->first;
  }

  /// A closed ledger ends with its last signed line.
  void judge_end(const Ledger& ledger, std::uint64_t believed) {
    const std::string path(archive::kLedgerFile);
    const std::uint64_t lines = ledger.tree.size();
    if (fetched_.growing) {
      if (ledger.is_torn) leave(path, "bytes stand behind its last line, and it lies in parts");
    } else if (lines > believed && may_be_of_device(fetched_.folder / path, believed)) {
      leave(path, "the device signed " + std::to_string(believed) + " of its " + std::to_string(lines) +
                      " lines, and may have died before it signed the others");
    } else if (lines > believed || ledger.is_torn) {
      mend_ledger(signed_.at(believed));
    } else if (fetched_.ledger_is_older) {
      put_from_folder(path);
    }
  }

  void mend_ledger(const SignedCheckpoint& newest) {
    const std::string path(archive::kLedgerFile);
    const std::string lines = std::to_string(newest.checkpoint.size) + " lines";
    if (fetched_.growing) {
      leave(path, "it does not fit the checkpoint over " + lines +
                      ", and lies in parts, as of a case that is not closed");
      return;
    }
    const auto candidate = seek(path, {}, kMostOfLedger, [&](const Candidate& each) {
      const std::optional<Ledger> ledger = read_ledger(each.file, newest.checkpoint.size);
      return ledger && !ledger->is_torn && ledger->tree.size() == newest.checkpoint.size &&
             is_over(*ledger, newest);
    });
    if (candidate) {
      result_.has_other_ledger = put(path, *candidate);
    } else {
      leave(path, "no copy fits the checkpoint that the device signed over " + lines + doubts_, details_);
    }
  }

  void mend_notes(const Ledger& ledger) {
    for (const auto& [size, candidate] : notes_) {
      if (is_over(ledger, signed_.at(size))) {
        put(archive::note_path(size), candidate);
      } else {
        leave(archive::note_path(size), "what copies have is not of these lines");
      }
    }
    for (const auto& [size, why] : unsigned_) {
      if (!notes_.contains(size)) leave(archive::note_path(size), why);
    }
  }

  /// Each whole line of the ledger that is an entry, with its number.
  void for_each_entry(const std::function<void(std::uint64_t, const archive::CaseEntryBody&)>& visit) const {
    const archive::ReadableFile file =
        archive::real_reading().open_to_read(fetched_.folder / archive::kLedgerFile);
    archive::LineReader lines(file);
    archive::LedgerLine line;
    for (std::uint64_t number = 0; lines.next(line) && !line.torn; ++number) {
      const archive::EntryParse parse =
          line.too_long ? archive::EntryParse{} : archive::parse_case_entry(line.text);
      if (parse.entry) visit(number, parse.entry->body);
    }
  }

  /// What signed lines say to be erased, and what the others do.
  void read_erased(std::uint64_t believed) {
    for_each_entry([&](std::uint64_t number, const archive::CaseEntryBody& body) {
      const auto* erased = std::get_if<archive::ErasedEntry>(&body);
      if (erased == nullptr) return;
      (number < believed ? erased_ : said_erased_).add(*erased);
      is_any_said_ = is_any_said_ || number >= believed;
    });
    erased_.join();
    said_erased_.join();
    std::set<std::string> unfit;
    for (const UnfitFile& each : fetched_.unfit) unfit.insert(each.path);
    if (unfit.empty()) return;
    for_each_entry([&](std::uint64_t number, const archive::CaseEntryBody& body) {
      const auto* segment = std::get_if<archive::SegmentEntry>(&body);
      if (segment != nullptr && number < believed && erased_.has(*segment) &&
          unfit.contains(segment->file.file))
        erased_files_.insert(segment->file.file);
    });
  }

  /// Film that was erased comes back from no copy. Of what an older version has the case is judged as before.
  void leave_out_erased() {
    for (const UnfitFile& each : fetched_.unfit) {
      if (!erased_files_.contains(each.path) || each.older_fits) continue;
      fs::remove(fetched_.folder / each.path);
      result_.erased.insert(each.path);
      std::string why;
      try {
        why = why_the_store_was_to_keep(each.path);
      } catch (const StoreError& error) {
        if (error.passes()) throw;
        why = error.what();
      }
      if (why.empty()) {
        told_.insert(each.path);
      } else {
        leave(each.path, why);
      }
    }
  }
  /// The appliance erased its own on the strength of the store's lock. "" where none holds any more.
  std::string why_the_store_was_to_keep(const std::string& path) {
    const std::string erased = "the appliance erased it, so that no copy is put again, and the store ";
    if (erased_looked_at_ == kMostInVain) return erased + "has other bytes, or none";
    ++erased_looked_at_;
    const std::string prefix = appliance_ + "/" + case_id_ + "/";
    const ObjectLocks own = locks_of(*mender_.store_, prefix + path);
    if (own.legal_hold) return erased + "has other bytes, under legal hold";
    if (own.longest) {
      if (*own.longest <= mender_.clock_.utc()) return "";
      return erased + "has other bytes, locked until " + format_utc(*own.longest);
    }
    // Of what it lists and does not give it tells no lock. The ledger came when the case was closed.
    const ObjectLocks ledger = locks_of(*mender_.store_, prefix + std::string(archive::kLedgerFile));
    if (ledger.legal_hold) return erased + "lists it and does not give it, of a case under legal hold";
    if (!ledger.first || *ledger.first <= mender_.clock_.utc()) return "";
    return erased + "lists it and does not give it, though it keeps the case's ledger until " +
           format_utc(*ledger.first);
  }

  /// Segments that only lines behind the signed ones say to be erased: whoever can put makes such lines.
  void mend_falsely_erased(std::uint64_t believed) {
    if (!is_any_said_) return;
    for_each_entry([&](std::uint64_t number, const archive::CaseEntryBody& body) {
      const auto* segment = std::get_if<archive::SegmentEntry>(&body);
      if (segment == nullptr || number >= believed || !said_erased_.has(*segment) || erased_.has(*segment) ||
          told_.contains(segment->file.file) || !may_be_file_of_case(segment->file.file) ||
          archive::real_reading().exists(fetched_.folder / segment->file.file)) {
        return;
      }
      mend_file({segment->file.file, segment->file.sha256, segment->file.bytes, number, false});
    });
  }

  void mend_file(const UnfitFile& file) {
    if (file.older_fits) {
      put_from_folder(file.path);
      return;
    }
    if (files_in_vain_ == kMostInVain) {
      leave(file.path,
            "it was not looked for, after " + std::to_string(kMostInVain) + " others that no copy has");
      return;
    }
    // Of a token alone no ledger says how long it is.
    const std::uint64_t most = file.bytes ? archive::kMaximumSealedBytes : archive::kMaximumTokenBytes;
    const auto candidate = seek(file.path, file.bytes, most, [&](const Candidate& found) {
      return crypto::hash_file(found.file).sha256 == file.sha256;
    });
    if (candidate) {
      put(file.path, *candidate);
    } else {
      ++files_in_vain_;
      leave(file.path, "no copy has the bytes that the ledger names" + doubts_, details_);
    }
  }

  /// The first copy's file of which `is_right` says so.
  std::optional<Candidate> seek(const std::string& path, std::optional<std::uint64_t> bytes,
                                std::uint64_t most_bytes,
                                const std::function<bool(const Candidate&)>& is_right) {
    doubts_.clear();
    details_.clear();
    const fs::path into = mender_.scratch_ / std::to_string(++sought_);
    for (const auto& copy : mender_.copies_) {
      const Candidate candidate{into, copy->name()};
      try {
        const FileOfCase file{appliance_, case_id_, path, bytes, most_bytes};
        if (copy->bring(file, into, [&] { return is_right(candidate); })) return candidate;
      } catch (const Error& error) {
        // One copy that is away keeps no other from being asked; the store itself is waited for.
        const auto* of_store = dynamic_cast<const StoreError*>(&error);
        if (copy == mender_.copies_.front() && of_store != nullptr && of_store->passes()) throw;
        doubts_ += "; " + copy->name() + " could not be asked";
        details_ += std::string(details_.empty() ? "" : "; ") + copy->name() + ": " + error.what();
      }
    }
    fs::remove(into);
    return {};
  }
  void put_from_folder(const std::string& path) {
    put(path, {fetched_.folder / path, mender_.copies_.front()->name()});
  }

  /// As long and as firmly as what was there first. Where the store does not tell of that any more, as long
  /// as the ledger. Nothing that is sealed stays for longer than the ledger that closed the case: not by a
  /// version that somebody put since, and not by a ledger that tells of an erasure.
  PutLock lock_like(const std::string& path) {
    const std::string prefix = appliance_ + "/" + case_id_ + "/";
    const ObjectLocks own = locks_of(*mender_.store_, prefix + path);
    const ObjectLocks ledger = path == archive::kLedgerFile
                                   ? own
                                   : locks_of(*mender_.store_, prefix + std::string(archive::kLedgerFile));
    PutLock lock{.legal_hold = own.legal_hold || ledger.legal_hold};
    if (is_sealed(path)) {
      const std::optional<UtcTime> closed = ledger.first ? ledger.first : ledger.longest;
      lock.ends = own.first ? own.first : closed;
      if (closed) lock.ends = std::min(lock.ends, closed);
    } else {
      lock.ends = own.first ? own.longest : std::max(own.longest, ledger.longest);
    }
    if (!lock.ends)
      throw Error("nothing locks what the store has of the case, so nothing says how long to lock it");
    if (*lock.ends > mender_.clock_.utc()) return lock;
    if (!lock.legal_hold)
      throw Error("the lock of what was there ended on " + format_utc(*lock.ends) +
                  ", so that nothing of it is to be kept any more");
    return {.legal_hold = true};
  }
  /// Pictures, sound, measurements, and whom they are of.
  static bool is_sealed(const std::string& path) {
    return path.starts_with(std::string(archive::kSegmentsFolder) + "/") || path == archive::kSubjectFile;
  }

  /// Whether the store has it now.
  bool put(const std::string& path, const Candidate& candidate) {
    if (!refused_.empty()) {
      leave(path, "it was not tried, since another was refused: " + refused_);
      return false;
    }
    bool is_put = false;
    try {
      const std::string key = appliance_ + "/" + case_id_ + "/" + path;
      const crypto::FileHash hash = crypto::hash_file(candidate.file);
      const PutLock lock = lock_like(path);
      state_("mends " + path + " from " + candidate.from);
      const std::string version =
          mender_.store_->put(key, *crypto::open_file_source(candidate.file), hash.sha256, lock);
      is_put = true;
      require_held(*mender_.store_, key, version, hash, lock);
      state_("mended " + path + " from " + candidate.from + ", sha256 " + crypto::to_hex(hash.sha256) +
             ", version " + printable(version));
      result_.mended.push_back({path, hash.sha256, candidate.from, version});
      told_.insert(path);
      // Whoever judges the folder judges what the store has now.
      if (candidate.file != fetched_.folder / path) {
        fs::create_directories((fetched_.folder / path).parent_path());
        fs::rename(candidate.file, fetched_.folder / path);
      }
      return true;
    } catch (const StoreError& error) {
      if (error.passes()) throw;
      if (!error.is_of_one_object()) refused_ = error.what();
      leave(path, error.what());
    } catch (const IoError&) {
      throw;
    } catch (const Error& error) {
      // Each further one would be one more version that nobody can rely on.
      if (is_put) refused_ = error.what();
      leave(path, error.what());
    }
    return false;
  }

  /// `detail` is told to whoever looks now, and not stated: with each look the log would say it once more.
  void leave(const std::string& path, const std::string& why, const std::string& detail = "") {
    if (!told_.insert(path).second) return;
    if (result_.left.size() < kMostNamed) {
      result_.left.push_back({path, why, detail});
    } else {
      ++result_.more_left;
    }
  }
  /// What no line names by its hash, as the device's key and the certificates beside a case.
  void leave_unreadable() {
    for (const auto& [path, why] : fetched_.unreadable)
      leave(path, "the store lists it and does not give it, and no signed line names its bytes", why);
  }
  void state_what_is_left() {
    const std::size_t named = std::min(result_.left.size(), kMostStated);
    for (std::size_t at = 0; at < named; ++at)
      state_("could not mend " + result_.left[at].path + ": " + result_.left[at].why);
    if (const std::uint64_t more = result_.left_count() - named; more > 0)
      state_("could not mend more: " + std::to_string(more) + (more == 1 ? " other file" : " other files"));
  }

  Mender& mender_;
  const std::string &appliance_, &case_id_;
  const std::vector<crypto::VerifierKey>& devices_;
  const FetchedCase& fetched_;
  const StateMending& state_;
  // By size, of the store, and of copies where its own is none that the device signed:
  std::map<std::uint64_t, SignedCheckpoint> signed_, alone_;  // as they must be; by Ed25519 alone
  std::map<std::uint64_t, std::string> unsigned_;             // and why they stay so
  std::map<std::uint64_t, Candidate> notes_;                  // to be put
  std::uint64_t sought_ = 0, notes_in_vain_ = 0, files_in_vain_ = 0, erased_looked_at_ = 0;
  std::string doubts_, details_;         // of the copies that were asked last
  std::string refused_;                  // why nothing more is put
  std::set<std::string> told_;           // mended, left or erased
  ErasedSegments erased_, said_erased_;  // by signed lines; by the others
  bool is_any_said_ = false;
  std::set<std::string> erased_files_;  // of what does not fit
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

#include "witness/following.h"

#include <algorithm>
#include <map>
#include <memory>
#include <string_view>
#include <utility>

#include "archive/format/case_layout.h"
#include "archive/verify/checkpoint_rules.h"
#include "base/error.h"
#include "crypto/encoding.h"
#include "crypto/merkle_tree.h"
#include "crypto/note_format.h"

namespace kiroku::witness {
namespace {

namespace fs = std::filesystem;
using Leaves = std::vector<crypto::Sha256Digest>;

// What a copy has beside the published log itself.
constexpr std::string_view kLockFile = ".following";
constexpr std::string_view kBeginningFile = ".beginning";  // while first tiles are written, also of evidence
constexpr std::string_view kForked = "forked-";            // a history that one key signed beside the copy's
constexpr std::string_view kDoubted = "doubted-";          // one that a key of the device did not sign
constexpr std::string_view kUnplaced = "unplaced-";  // a signed checkpoint whose tiles were not to be had
constexpr std::size_t kMostUnplaced = 16;
// Whoever holds a key of the device can show another history each time, as long as they like.
constexpr std::size_t kMostHistories = 16;             // of each kind
constexpr std::uint64_t kMostTiledEntries = 1U << 20;  // of all but the first: five years of an appliance

/// A checkpoint as it was found.
struct FoundNote {
  std::string text;
  crypto::Checkpoint checkpoint;
};

/// Throws kiroku::Error where it is there and is none.
std::optional<FoundNote> read_note(const TileSource& source, std::string_view name = kPublishedCheckpoint) {
  const std::optional<Bytes> bytes = source.read(std::string(name), archive::kMaximumNoteBytes);
  if (!bytes) return std::nullopt;
  FoundNote found{std::string(text_of(*bytes)), {}};
  const auto checkpoint = crypto::Checkpoint::parse(crypto::open_note(found.text, {}).text);
  if (!checkpoint) throw Error("the file '" + std::string(name) + "' is no signed checkpoint");
  if (checkpoint->size > kMostPublishedEntries)
    throw Error("the log has " + std::to_string(checkpoint->size) + " entries, and at most " +
                std::to_string(kMostPublishedEntries) + " are read");
  found.checkpoint = *checkpoint;
  return found;
}

constexpr const char* kLacksSome =
    "its checkpoint has signatures for which the one that is kept has others, or no room";

/// What is kept of a note that is shown once more.
struct Joined {
  std::string text;         // the kept one, with the lines of keys that it had none of
  bool lacks_some = false;  // of the shown one's lines some found no place
};

/// Of two notes of one text: cosignatures come one after the other. A key has one line, the first that was
/// shown: whoever shows them can have made up either, and a note with two is none.
Joined joined(const FoundNote& kept, const FoundNote& shown) {
  Joined out{kept.text, false};
  const crypto::NoteParts there = crypto::parse_note(kept.text), more = crypto::parse_note(shown.text);
  if (there.text != more.text) return out;
  for (const crypto::SignatureLine& line : more.lines) {
    const auto of_that_key = std::ranges::find_if(there.lines, [&](const crypto::SignatureLine& each) {
      return each.name == line.name && each.key_id == line.key_id;
    });
    if (of_that_key != there.lines.end()) {
      out.lacks_some = out.lacks_some || of_that_key->signature != line.signature;
      continue;
    }
    const std::string longer = out.text + crypto::signature_line(line.name, line.key_id, line.signature);
    const bool fits = longer.size() <= archive::kMaximumNoteBytes && crypto::parse_note(longer).why.empty();
    if (fits) out.text = longer;
    out.lacks_some = out.lacks_some || !fits;
  }
  return out;
}

/// Who signed a note for the log of the same name.
struct Signature {
  std::vector<std::size_t> holds;   // of the devices' keys, as the log was signed when it had that size
  std::vector<std::size_t> by_all;  // of these, with every key that the device has beside it
};

Signature signature_of(const FoundNote& note, const std::vector<crypto::VerifierKey>& devices) {
  Signature signature;
  for (std::size_t device = 0; device < devices.size(); ++device) {
    if (note.checkpoint.origin != archive::log_origin(devices[device].name())) continue;
    const crypto::OpenedNote opened = crypto::open_note(note.text, {devices[device]});
    if (!crypto::is_signed_for_log(opened, devices[device], note.checkpoint.size)) continue;
    signature.holds.push_back(device);
    if (!opened.failure) signature.by_all.push_back(device);
  }
  return signature;
}

bool share_one(const std::vector<std::size_t>& some, const std::vector<std::size_t>& others) {
  return std::ranges::find_first_of(some, others) != some.end();
}

std::string name_of(std::string_view kind, const crypto::Checkpoint& checkpoint) {
  constexpr std::size_t kDigits = 16;
  return std::string(kind) + std::to_string(checkpoint.size) + "-" +
         crypto::to_hex(checkpoint.root).substr(0, kDigits);
}

/// The roots of a tree at sizes that were asked for.
class Roots {
 public:
  void ask(std::uint64_t size) {
    if (size == 0)
      roots_[0] = tree_.root();
    else
      roots_.try_emplace(size);
  }
  void append(const crypto::Sha256Digest& leaf) {
    tree_.append(leaf);
    if (const auto asked = roots_.find(tree_.size()); asked != roots_.end()) asked->second = tree_.root();
  }
  /// Nothing where the tree did not get so far.
  [[nodiscard]] std::optional<crypto::Sha256Digest> at(std::uint64_t size) const {
    const auto asked = roots_.find(size);
    return asked == roots_.end() ? std::nullopt : asked->second;
  }

 private:
  crypto::MerkleFrontier tree_;
  std::map<std::uint64_t, std::optional<crypto::Sha256Digest>> roots_;
};

class Follower {
 public:
  Follower(const TileSource& source, archive::FileSystem& files, fs::path copy,
           const std::vector<crypto::VerifierKey>& devices, KeepEvidence keep,
           const std::function<void(std::uint64_t)>& progress)
      : source_(source),
        files_(files),
        copy_(std::move(copy)),
        devices_(devices),
        keep_evidence_(keep == KeepEvidence::kYes),
        progress_(progress) {}

  Followed follow() {
    prepare_folder();
    const std::unique_ptr<TileSource> own = tiles_in_folder(copy_);
    std::optional<FoundNote> kept;
    try {
      kept = read_note(*own);
    } catch (const Error& error) {
      return could_not_tell("the copy does not hold: " + std::string(error.what()));
    }
    if (kept) result_.kept = kept->checkpoint;
    if (!kept && files_.exists(copy_ / "tile") && !files_.exists(copy_ / kBeginningFile))
      return could_not_tell("the copy does not hold: it has tiles, and its checkpoint was taken away");
    find_what_was_kept(*own);
    return compare(*own, kept);
  }

 private:
  Followed could_not_tell(const std::string& why) {
    result_.what = Following::kCouldNotTell;
    result_.why = why;
    return result_;
  }

  /// Made where it is not there; one process at a time: what it compares with must not change.
  void prepare_folder() {
    if (!files_.exists(copy_)) {
      files_.make_folder(copy_);
      files_.sync_folder(fs::absolute(copy_).parent_path());
    }
    refuse_foreign_folder();
    const fs::path lock = copy_ / kLockFile;
    if (!files_.exists(lock)) files_.create(lock);
    turn_ = files_.append_to(lock);
    if (!turn_->try_lock())
      throw UsageError("another process is at work in " + copy_.string() + ": wait until it has ended");
  }

  void refuse_foreign_folder() const {
    if (files_.exists(copy_ / kPublishedCheckpoint)) return;
    for (const std::string& name : files_.names_in(copy_)) {
      if (name != kLockFile && name != kBeginningFile && name != "tile" && !name.starts_with(kUnplaced))
        throw UsageError(copy_.string() + " is not empty, and no published log: name another folder");
    }
  }

  /// Other histories, and checkpoints that wait for the copy to have as many entries.
  void find_what_was_kept(const TileSource& own) {
    for (const std::string& name : files_.names_in(copy_)) {
      if (name.starts_with(kForked)) result_.earlier_forks.push_back(copy_ / name);
      if (!name.starts_with(kUnplaced)) continue;
      try {
        if (auto note = read_note(own, name)) unplaced_.emplace_back(name, std::move(*note));
      } catch (const Error&) {
        continue;  // whoever can write there can also take it away
      }
    }
  }

  Followed compare(const TileSource& own, const std::optional<FoundNote>& kept) {
    std::optional<FoundNote> shown;
    try {
      shown = read_note(source_);
    } catch (const Error& error) {
      return could_not_tell(error.what());
    }
    if (!shown) return could_not_tell("no log is published there: the file 'checkpoint' is not there");
    const Signature signature = signature_of(*shown, devices_);
    if (signature.holds.empty())
      return could_not_tell("its checkpoint, of \"" + shown->checkpoint.origin +
                            "\", is not signed for the log of the device that was named");
    result_.shown = shown->checkpoint;
    result_.lacks_signature = signature.by_all.empty();
    const std::uint64_t old = kept ? kept->checkpoint.size : 0;
    const std::uint64_t size = shown->checkpoint.size;
    if (kept && kept->checkpoint.origin != shown->checkpoint.origin)
      return could_not_tell("the copy is of another log, \"" + kept->checkpoint.origin + "\"");

    Roots roots;
    roots.ask(old);
    roots.ask(size);
    for (const auto& [name, note] : unplaced_) roots.ask(note.checkpoint.size);
    const auto take = [&](const crypto::Sha256Digest& leaf) {
      roots.append(leaf);
      tell_progress();
    };
    try {
      for_each_leaf(own, old, 0, old, take);
    } catch (const Error& error) {
      return could_not_tell("the copy does not hold: " + std::string(error.what()));
    }
    if (kept && roots.at(old) != kept->checkpoint.root)
      return could_not_tell("the copy does not hold: its tiles are not those of its checkpoint");
    Leaves more;
    try {
      for_each_leaf(source_, size, std::min(old, size), size, [&](const crypto::Sha256Digest& leaf) {
        more.push_back(leaf);
        take(leaf);
      });
    } catch (const Error& error) {
      return not_placed(*shown, error.what());
    }
    if (roots.at(size) != shown->checkpoint.root) {
      if (!kept) return could_not_tell("its tiles are not those of its checkpoint");
      return judge_parting(own, *kept, *shown, signature);
    }
    if (size < old) {
      result_.what = Following::kOlder;
      return result_;
    }
    if (!kept || size > old) keep(own, *shown, old, more);
    if (kept && size == old) add_lines(copy_ / kPublishedCheckpoint, *kept, *shown);
    result_.what = !kept ? Following::kBegun : size == old ? Following::kSame : Following::kGoesOn;
    return place_what_waited(roots, kept && size == old ? *kept : *shown);
  }

  /// A signed checkpoint of more entries than the copy has, whose tiles do not tell what it is of.
  Followed not_placed(const FoundNote& shown, const std::string& why) {
    if (!keep_evidence_) return could_not_tell(why);
    const fs::path kept = copy_ / name_of(kUnplaced, shown.checkpoint);
    const bool is_new = !files_.exists(kept);
    if (is_new && unplaced_.size() >= kMostUnplaced) {
      return could_not_tell(why + "; its checkpoint is not kept, as " + std::to_string(kMostUnplaced) +
                            " such wait already");
    }
    const auto before =
        std::ranges::find(unplaced_, kept.filename().string(), &std::pair<std::string, FoundNote>::first);
    if (is_new)
      files_.write_durably(kept, bytes_of(shown.text));
    else if (before != unplaced_.end())
      add_lines(kept, before->second, shown);
    result_.evidence = kept;
    return could_not_tell(why);
  }

  /// What was shown without its tiles, now that the copy has as many entries. `covering` is the copy's.
  Followed place_what_waited(const Roots& roots, const FoundNote& covering) {
    for (const auto& [name, note] : unplaced_) {
      const auto root = roots.at(note.checkpoint.size);
      if (!root) continue;
      if (root != note.checkpoint.root) {
        if (note.checkpoint.origin != covering.checkpoint.origin ||
            !share_one(signature_of(note, devices_).by_all, signature_of(covering, devices_).by_all))
          continue;
        result_.what = Following::kTwoHistories;
        result_.kept = covering.checkpoint;
        result_.shown = note.checkpoint;
        result_.evidence = keep_history(kForked, note, nullptr);
        if (result_.evidence.empty()) continue;  // it stays where it is
      }
      files_.remove(copy_ / name);
    }
    return result_;
  }

  /// The source's checkpoint is not of what the copy has, with or without what the source has behind it.
  Followed judge_parting(const TileSource& own, const FoundNote& kept, const FoundNote& shown,
                         const Signature& signature) {
    const std::uint64_t size = shown.checkpoint.size, old = kept.checkpoint.size;
    Leaves all;
    Roots roots;
    roots.ask(old);
    roots.ask(size);
    std::string misfit;
    try {
      for_each_leaf(source_, size, 0, size, [&](const crypto::Sha256Digest& leaf) {
        all.push_back(leaf);
        roots.append(leaf);
        tell_progress();
      });
      if (roots.at(size) != shown.checkpoint.root) misfit = "its tiles are not those of its checkpoint";
    } catch (const Error& error) {
      misfit = error.what();
    }
    // Of a longer one nothing follows without its tiles. That a shorter or equal one is no beginning of the
    // copy its root alone shows.
    if (size > old && !misfit.empty()) return not_placed(shown, misfit);
    // Whoever gives out a wrong tile once, and the right one then, has shown one history.
    if (size > old && roots.at(old) == kept.checkpoint.root)
      return could_not_tell("its tiles changed while they were read: ask once more");
    const Signature before = signature_of(kept, devices_);
    if (before.holds.empty())
      return could_not_tell(
          "they part, and the copy's own checkpoint is not signed by the device that was named");
    if (!share_one(signature.holds, before.holds))
      return could_not_tell("they part, and the copy is signed by another key of the same name");
    const bool accuses = share_one(signature.by_all, before.by_all);
    result_.evidence = keep_history(accuses ? kForked : kDoubted, shown, misfit.empty() ? &all : nullptr);
    if (!accuses)
      return could_not_tell(
          "they part, and one of the two checkpoints lacks the signature by a key that the device has beside "
          "Ed25519: somebody who has its other keys can have made it");
    if (misfit.empty()) {
      std::uint64_t at = 0;
      bool is_same = true;
      for_each_leaf(own, old, 0, std::min(old, size), [&](const crypto::Sha256Digest& leaf) {
        is_same = is_same && leaf == all[at];
        if (is_same) ++at;
      });
      result_.common = at;
    }
    result_.what = Following::kTwoHistories;
    return result_;
  }

  /// Tiles first: the checkpoint counts only with them.
  void keep(const TileSource& own, const FoundNote& shown, std::uint64_t old, const Leaves& more) {
    if (!result_.kept) files_.write_durably(copy_ / kBeginningFile, {});
    if (!more.empty()) {
      TileWriter tiles(files_, copy_, old);
      for_each_leaf(own, old, 0, old, [&](const crypto::Sha256Digest& leaf) { tiles.append(leaf); });
      for (const crypto::Sha256Digest& leaf : more) tiles.append(leaf);
      tiles.finish();
    }
    files_.write_durably(copy_ / kPublishedCheckpoint, bytes_of(shown.text));
    if (files_.exists(copy_ / kBeginningFile)) files_.remove(copy_ / kBeginningFile);
  }

  /// Of a checkpoint that is kept in `file` and was shown once more.
  void add_lines(const fs::path& file, const FoundNote& kept, const FoundNote& shown) {
    const Joined both = joined(kept, shown);
    if (both.lacks_some) result_.not_kept = kLacksSome;
    if (both.text != kept.text) files_.write_durably(file, bytes_of(both.text));
  }

  /// The same of another history, whose cosignatures say which witness cosigned it: that one found no place,
  /// or the disk has no room, is said. Whatever became of the kept one is somebody else's: it stays.
  void add_lines_of_history(const fs::path& folder, const FoundNote& shown) {
    std::optional<FoundNote> kept;
    try {
      kept = read_note(*tiles_in_folder(folder));
    } catch (const Error&) {
      return;
    }
    if (!kept) return;
    const Joined both = joined(*kept, shown);
    if (both.lacks_some) result_.not_kept = kLacksSome;
    if (both.text != kept->text) files_.write_durably(folder / kPublishedCheckpoint, bytes_of(both.text));
  }

  /// A published log of its own, so far as its tiles fit. Empty where nothing is to be kept, or can be: what
  /// was found does not hang on the room that the other history needs.
  fs::path keep_history(std::string_view kind, const FoundNote& shown, const Leaves* leaves) {
    if (!keep_evidence_) return {};
    const fs::path folder = copy_ / name_of(kind, shown.checkpoint);
    const auto others =
        static_cast<std::size_t>(std::ranges::count_if(files_.names_in(copy_), [&](const std::string& name) {
          return name.starts_with(kind) && name != folder.filename();
        }));
    if (others >= kMostHistories && !files_.exists(folder / kPublishedCheckpoint)) {
      result_.not_kept = std::to_string(others) + " others are kept already";
      return {};
    }
    try {
      if (!files_.exists(folder)) {
        files_.make_folder(folder);
        files_.sync_folder(copy_);
      }
      // Shown once more it may lack a cosignature, or have one more, and the disk may be full.
      if (files_.exists(folder / kPublishedCheckpoint))
        add_lines_of_history(folder, shown);
      else
        files_.write_durably(folder / kPublishedCheckpoint, bytes_of(shown.text));
    } catch (const Error& error) {
      result_.not_kept = error.what();
      return {};
    }
    keep_tiles(folder, leaves, others == 0);
    return folder;
  }

  /// Those that a crash or a full disk cut off are written anew the next time. Without `leaves` none can be.
  void keep_tiles(const fs::path& folder, const Leaves* leaves, bool is_first) {
    const fs::path beginning = folder / kBeginningFile;
    const bool is_cut_off = files_.exists(beginning);
    if (files_.exists(folder / "tile") && !is_cut_off) return;
    if (leaves == nullptr) {
      if (is_cut_off)
        result_.not_kept = "of its hashes not all are kept, and they were not to be had this time";
      return;
    }
    if (!is_first && !is_cut_off && leaves->size() > kMostTiledEntries) {
      result_.not_kept = "of its hashes nothing is kept, as they are more than " +
                         std::to_string(kMostTiledEntries) + ", and of another history they are";
      return;
    }
    try {
      if (!is_cut_off) files_.write_durably(beginning, {});
      TileWriter tiles(files_, folder, 0);
      for (const crypto::Sha256Digest& leaf : *leaves) tiles.append(leaf);
      tiles.finish();
      files_.remove(beginning);
    } catch (const Error& error) {
      result_.not_kept = "of its hashes not all are kept: " + std::string(error.what());
    }
  }

  void tell_progress() {
    ++looked_at_;
    if (progress_) progress_(looked_at_);
  }

  const TileSource& source_;
  archive::FileSystem& files_;
  const fs::path copy_;
  const std::vector<crypto::VerifierKey>& devices_;
  const bool keep_evidence_;
  const std::function<void(std::uint64_t)>& progress_;
  std::unique_ptr<archive::WritableFile> turn_;
  std::vector<std::pair<std::string, FoundNote>> unplaced_;
  std::uint64_t looked_at_ = 0;
  Followed result_;
};

}  // namespace

std::string_view following_name(Following what) {
  switch (what) {
    case Following::kBegun:
      return "begun";
    case Following::kSame:
      return "same";
    case Following::kGoesOn:
      return "goes-on";
    case Following::kOlder:
      return "older";
    case Following::kTwoHistories:
      return "two-histories";
    case Following::kCouldNotTell:
      break;
  }
  return "could-not-tell";
}

Followed follow_log(const TileSource& source, archive::FileSystem& files, const fs::path& copy,
                    const std::vector<crypto::VerifierKey>& devices, KeepEvidence keep,
                    const std::function<void(std::uint64_t)>& progress) {
  return Follower(source, files, copy, devices, keep, progress).follow();
}

}  // namespace kiroku::witness

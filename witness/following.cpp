#include "witness/following.h"

#include <algorithm>
#include <memory>
#include <string_view>
#include <utility>

#include "archive/format/case_layout.h"
#include "archive/verify/checkpoint_rules.h"
#include "base/error.h"
#include "crypto/encoding.h"
#include "crypto/merkle_tree.h"

namespace kiroku::witness {
namespace {

namespace fs = std::filesystem;
using Leaves = std::vector<crypto::Sha256Digest>;

constexpr std::string_view kLockFile = ".following";

/// A checkpoint as it was found.
struct FoundNote {
  std::string text;
  crypto::Checkpoint checkpoint;
};

/// Throws kiroku::Error where it is there and is none.
std::optional<FoundNote> read_note(const TileSource& source) {
  const std::optional<Bytes> bytes =
      source.read(std::string(kPublishedCheckpoint), archive::kMaximumNoteBytes);
  if (!bytes) return std::nullopt;
  FoundNote found{std::string(text_of(*bytes)), {}};
  const auto checkpoint = crypto::Checkpoint::parse(crypto::open_note(found.text, {}).text);
  if (!checkpoint) throw Error("the file 'checkpoint' is no signed checkpoint");
  if (checkpoint->size > kMostPublishedEntries)
    throw Error("the log has " + std::to_string(checkpoint->size) + " entries, and at most " +
                std::to_string(kMostPublishedEntries) + " are read");
  found.checkpoint = *checkpoint;
  return found;
}

/// How a note is signed for one of the devices' logs.
struct Signature {
  bool holds = false;
  /// By every key that the device had then. What lacks one accuses nobody: whoever has or can forge the
  /// others can have made it.
  bool by_all = false;
};

Signature signature_of(const FoundNote& note, const std::vector<crypto::VerifierKey>& devices) {
  Signature best;
  for (const crypto::VerifierKey& device : devices) {
    const std::uint64_t size = note.checkpoint.size;
    if (note.checkpoint.origin != archive::log_origin(device.name())) continue;
    const crypto::OpenedNote opened = crypto::open_note(note.text, {device});
    if (!crypto::is_signed_for_log(opened, device, size)) continue;
    const bool lacks_hardware =
        opened.failure == crypto::NoteFailure::kLacksHardware && size > device.hardware_since();
    best.holds = true;
    best.by_all = best.by_all || !lacks_hardware;
  }
  return best;
}

crypto::MerkleFrontier tree_of(const Leaves& leaves) {
  crypto::MerkleFrontier tree;
  for (const crypto::Sha256Digest& leaf : leaves) tree.append(leaf);
  return tree;
}

class Follower {
 public:
  Follower(const TileSource& source, archive::FileSystem& files, fs::path copy,
           const std::vector<crypto::VerifierKey>& devices,
           const std::function<void(std::uint64_t)>& progress)
      : source_(source), files_(files), copy_(std::move(copy)), devices_(devices), progress_(progress) {}

  Followed follow() {
    take_turn();
    const std::unique_ptr<TileSource> own = tiles_in_folder(copy_);
    std::optional<FoundNote> kept;
    try {
      kept = read_note(*own);
    } catch (const Error& error) {
      return could_not_tell("the copy does not hold: " + std::string(error.what()));
    }
    if (kept)
      result_.kept = kept->checkpoint;
    else
      refuse_foreign_folder();
    return compare(*own, kept);
  }

 private:
  Followed could_not_tell(const std::string& why) {
    result_.what = Following::kCouldNotTell;
    result_.why = why;
    return result_;
  }

  /// One process at a time: what it compares with must not change.
  void take_turn() {
    if (!files_.exists(copy_)) {
      files_.make_folder(copy_);
      files_.sync_folder(fs::absolute(copy_).parent_path());
    }
    const fs::path lock = copy_ / kLockFile;
    if (!files_.exists(lock)) files_.create(lock);
    turn_ = files_.append_to(lock);
    if (!turn_->try_lock())
      throw UsageError("another process is at work in " + copy_.string() + ": wait until it has ended");
  }

  /// What was begun and not finished has tiles alone.
  void refuse_foreign_folder() const {
    for (const std::string& name : files_.names_in(copy_)) {
      if (name != kLockFile && name != "tile")
        throw UsageError(copy_.string() + " is not empty, and no published log: name another folder");
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
    if (!signature.holds)
      return could_not_tell("its checkpoint, of \"" + shown->checkpoint.origin +
                            "\", is not signed for the log of the device that was named");
    result_.shown = shown->checkpoint;
    const std::uint64_t old = kept ? kept->checkpoint.size : 0;
    const std::uint64_t size = shown->checkpoint.size;
    if (kept && kept->checkpoint.origin != shown->checkpoint.origin)
      return could_not_tell("the copy is of another log, \"" + kept->checkpoint.origin + "\"");

    crypto::MerkleFrontier tree;
    std::optional<crypto::Sha256Digest> root_at_shown;
    const auto take = [&](const crypto::Sha256Digest& leaf) {
      tree.append(leaf);
      if (tree.size() == size) root_at_shown = tree.root();
      tell_progress();
    };
    if (size == 0) root_at_shown = tree.root();
    try {
      for_each_leaf(own, old, 0, old, take);
    } catch (const Error& error) {
      return could_not_tell("the copy does not hold: " + std::string(error.what()));
    }
    if (kept && tree.root() != kept->checkpoint.root)
      return could_not_tell("the copy does not hold: its tiles are not those of its checkpoint");
    Leaves more;
    if (size > old) {
      try {
        for_each_leaf(source_, size, old, size, [&](const crypto::Sha256Digest& leaf) {
          more.push_back(leaf);
          take(leaf);
        });
      } catch (const Error& error) {
        return could_not_tell(error.what());
      }
    }
    if (root_at_shown == shown->checkpoint.root) {
      if (size < old) {
        result_.what = Following::kOlder;
      } else {
        // Of the same entries the copy's own checkpoint may have more signatures.
        if (!kept || size > old) keep(own, *shown, old, more);
        result_.what = !kept ? Following::kBegun : size == old ? Following::kSame : Following::kGoesOn;
      }
      return result_;
    }
    if (!kept) return could_not_tell("its tiles are not those of its checkpoint");
    return judge_parting(own, *kept, *shown, signature);
  }

  /// The source's checkpoint is not of what the copy has, with or without what the source has behind it.
  Followed judge_parting(const TileSource& own, const FoundNote& kept, const FoundNote& shown,
                         const Signature& signature) {
    const std::uint64_t size = shown.checkpoint.size, old = kept.checkpoint.size;
    Leaves all;
    std::string misfit;
    try {
      for_each_leaf(source_, size, 0, size, [&](const crypto::Sha256Digest& leaf) {
        all.push_back(leaf);
        tell_progress();
      });
      if (tree_of(all).root() != shown.checkpoint.root) misfit = "its tiles are not those of its checkpoint";
    } catch (const Error& error) {
      misfit = error.what();
    }
    // Of a longer one nothing follows without its tiles. That a shorter or equal one is no beginning of the
    // copy its root alone shows.
    if (!misfit.empty() && size > old) return could_not_tell(misfit);
    const Signature before = signature_of(kept, devices_);
    if (!before.holds)
      return could_not_tell(
          "they part, and the copy's own checkpoint is not signed by the device that was named");
    result_.evidence = keep_evidence(shown, misfit.empty() ? &all : nullptr);
    if (!signature.by_all || !before.by_all)
      return could_not_tell(
          "they part, and one of the two checkpoints lacks the signature by the key in the device's "
          "hardware: "
          "somebody who has its other keys can have made it");
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
    if (!more.empty()) {
      TileWriter tiles(files_, copy_, old);
      for_each_leaf(own, old, 0, old, [&](const crypto::Sha256Digest& leaf) { tiles.append(leaf); });
      for (const crypto::Sha256Digest& leaf : more) tiles.append(leaf);
      tiles.finish();
    }
    files_.write_durably(copy_ / kPublishedCheckpoint, bytes_of(shown.text));
  }

  /// A published log of its own, so far as its tiles fit.
  fs::path keep_evidence(const FoundNote& shown, const Leaves* leaves) {
    constexpr std::size_t kDigits = 16;
    const fs::path folder = copy_ / ("forked-" + std::to_string(shown.checkpoint.size) + "-" +
                                     crypto::to_hex(shown.checkpoint.root).substr(0, kDigits));
    if (!files_.exists(folder)) {
      files_.make_folder(folder);
      files_.sync_folder(copy_);
    }
    if (leaves != nullptr) {
      TileWriter tiles(files_, folder, 0);
      for (const crypto::Sha256Digest& leaf : *leaves) tiles.append(leaf);
      tiles.finish();
    }
    files_.write_durably(folder / kPublishedCheckpoint, bytes_of(shown.text));
    return folder;
  }

  void tell_progress() {
    ++looked_at_;
    if (progress_) progress_(looked_at_);
  }

  const TileSource& source_;
  archive::FileSystem& files_;
  fs::path copy_;
  const std::vector<crypto::VerifierKey>& devices_;
  const std::function<void(std::uint64_t)>& progress_;
  std::unique_ptr<archive::WritableFile> turn_;
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
                    const std::vector<crypto::VerifierKey>& devices,
                    const std::function<void(std::uint64_t)>& progress) {
  return Follower(source, files, copy, devices, progress).follow();
}

}  // namespace kiroku::witness

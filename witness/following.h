// Keeps a copy of a published log, and sees whether it still is one history. Functions; one thread at a time.
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "archive/storage/file_system.h"
#include "crypto/signed_note.h"
#include "witness/tiles.h"

namespace kiroku::witness {

enum class Following {
  kBegun,         // there was no copy; now there is
  kSame,          // nothing came since
  kGoesOn,        // the copy has what came since
  kOlder,         // a beginning of what the copy has: nothing was taken
  kTwoHistories,  // one device signed both, and they cannot be one
  kCouldNotTell,  // nothing was taken
};
std::string_view following_name(Following what);  // "goes-on"
/// Whether the copy has what was shown, and nothing speaks against it.
constexpr bool is_up_to_date(Following what) {
  return what == Following::kBegun || what == Following::kSame || what == Following::kGoesOn;
}

struct Followed {
  Following what = Following::kCouldNotTell;
  std::optional<crypto::Checkpoint> kept;   // what the copy had before
  std::optional<crypto::Checkpoint> shown;  // what the source shows now, signed by the device
  /// Of kTwoHistories: so many entries are the same, from the first on; nothing where tiles do not tell.
  std::optional<std::uint64_t> common;
  /// Where in the copy the other history was put, or its signed checkpoint alone; empty: nothing was.
  std::filesystem::path evidence;
  /// Of what was to be kept: why it was not, or not whole, in half a sentence.
  std::string not_kept;
  std::string why;  // kCouldNotTell, in half a sentence
  /// Of what was shown: a key that the device has beside Ed25519 did not sign it. Against such a checkpoint
  /// nothing that is shown later accuses anybody.
  bool lacks_signature = false;
  /// Folders of the copy with other histories that were shown here before. None of them goes away.
  std::vector<std::filesystem::path> earlier_forks;
};

/// Whether a history that is not the copy's is kept in it.
enum class KeepEvidence { kYes, kNo };

/// Compares what `source` shows with the copy in `copy`, and brings the copy up to date where it goes on from
/// there. The copy is a published log itself; its parent must be there. Of its checkpoint the signature is
/// asked for only where it is to accuse somebody: then one key must have signed both, with every key that the
/// device is known to have beside it. A signed checkpoint of more entries, whose tiles are not to be had, is
/// kept, and compared once the copy has as many. Of other histories 16 are kept; that there is one is said
/// also where nothing can be written. Of a checkpoint that is kept and shown once more, signature lines of
/// further keys are added; of one key the first line stays, whichever holds. `progress` is told how many leaf
/// hashes were looked at. Throws kiroku::UsageError where the folder holds something else or another process
/// is at work in it, and kiroku::IoError where it cannot be written. Whatever the source does is in the
/// answer.
Followed follow_log(const TileSource& source, archive::FileSystem& files, const std::filesystem::path& copy,
                    const std::vector<crypto::VerifierKey>& devices, KeepEvidence keep = KeepEvidence::kYes,
                    const std::function<void(std::uint64_t)>& progress = {});

}  // namespace kiroku::witness

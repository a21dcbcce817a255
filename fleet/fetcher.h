// A case out of a store, as a folder that kiroku-verify judges: what remains where an appliance was
// destroyed. Functions; one thread at a time.
#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "crypto/hash.h"
#include "fleet/object_store.h"

namespace kiroku::fleet {

/// Identifiers of the cases that the store has anything of under an appliance's name, in their order. Throws
/// StoreError.
std::vector<std::string> cases_in_store(ObjectStore& store, const std::string& appliance);

/// What a ledger names, where the newest version in the store is something else; of what it says to be erased
/// only where the store lists it still.
struct UnfitFile {
  std::string path;
  crypto::Sha256Digest sha256{};       // as the ledger has it,
  std::optional<std::uint64_t> bytes;  // where it says how many
  std::uint64_t entry = 0;  // which line names it, from 0; what it states of itself is not believed
  bool older_fits = false;  // an older version is what the ledger names, and was taken
};

/// What the store told of the legal hold of the objects that were taken, the last version of each.
struct HoldsSeen {
  std::uint64_t held = 0, free = 0;
  ListedVersion first_held, first_free;  // in the order of their keys
  bool are_locks_told = false;           // any lock of any of them; else this access key may not see them
};

/// A segment that was left in the store: its place in the folder has an empty file.
struct SegmentInStore {
  std::vector<ListedVersion> versions;           // that may be it; the one that was chosen in front
  std::optional<crypto::Sha256Digest> sha256{};  // as the ledger has it, as is
  std::optional<std::uint64_t> bytes{};
};

struct FetchedCase {
  std::filesystem::path folder;
  std::uint64_t objects = 0, bytes = 0;
  /// The store has, or gives, the ledger only as far as it had grown.
  bool growing = false;
  /// What was left out or taken otherwise than as the newest version, a sentence each.
  std::vector<std::string> remarks;
  std::vector<UnfitFile> unfit;
  /// The newest version of the ledger is of no case or of another one, and an older one was taken.
  bool ledger_is_older = false;
  /// Segments whose bytes were left in the store, by their paths: the version that they are. In the folder
  /// are files of their sizes without them (fleet/stored_reading.h).
  std::map<std::string, ListedVersion> in_store;
  HoldsSeen holds;
  /// What was left out as the store lists it and does not give it, by its path, and why.
  std::map<std::string, std::string> unreadable;
  std::map<std::string, SegmentInStore> segments_left;  // by the path, of fetch_case_without_segments()
};
/// Whether a store may have a file of a case by that path: else it is neither sought nor put.
bool may_be_file_of_case(std::string_view path);
/// Which version is taken of an object that has several. Whoever has the appliance's keys can put newer ones
/// under each key, and nobody can put an older one.
enum class WhichVersions { kNewest, kOldest };
/// What becomes of an object that the store lists and does not give, while it answers otherwise.
enum class UnreadableObjects { kThrow, kLeaveOut };
/// Whether segments come with their bytes. With kInStore those of several versions do: which of them the
/// ledger names is told by their bytes alone. With kLeftOut none does (FetchedCase::segments_left).
enum class SegmentBytes { kFetched, kInStore, kLeftOut };
/// Makes `into`/<case>, which must not be there. Of a file that the ledger names with a hash, where the
/// version that was chosen has another, the one that has it is taken; of a ledger that is of another case,
/// one of this case. What other devices stated of the case (archive/format/store_statement.h) comes into
/// `into`/store-statements/<case>. What is there is no verdict: verify it. Throws StoreError, kiroku::Error
/// where the store's answers contradict each other or are more than any case has, kiroku::UsageError where
/// the store has nothing of the case or the folder is there, kiroku::IoError; nothing is left behind then but
/// a folder
/// ".fetching-<case>", which the next try removes.
FetchedCase fetch_case(ObjectStore& store, const std::string& appliance, const std::string& case_id,
                       const std::filesystem::path& into, WhichVersions which = WhichVersions::kNewest,
                       UnreadableObjects unreadable = UnreadableObjects::kThrow,
                       SegmentBytes segments = SegmentBytes::kFetched);

/// Likewise, but that segments stay in the store, and that nothing comes that other devices stated.
FetchedCase fetch_case_without_segments(ObjectStore& store, const std::string& appliance,
                                        const std::string& case_id, const std::filesystem::path& into);

/// Likewise `into`/log, an appliance's log as far as it is in the store.
FetchedCase fetch_log(ObjectStore& store, const std::string& appliance, const std::filesystem::path& into);
/// The ledger of a case alone, in `folder`, which is made where it is not there: the newest one, or as far as
/// it had grown; of versions that are longer than any recording's the next older one. False where the store
/// has none. Throws StoreError, kiroku::IoError; kiroku::Error where all that there are are so long.
bool fetch_ledger(ObjectStore& store, const std::string& appliance, const std::string& case_id,
                  const std::filesystem::path& folder);

}  // namespace kiroku::fleet

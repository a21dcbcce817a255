// Bit rot in a store: what does not fit a case's ledger is put again, as a new version, from a copy that
// does. Nothing is removed. Not thread-safe.
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <set>
#include <string>
#include <vector>

#include "base/clock.h"
#include "crypto/signed_note.h"
#include "fleet/case_copies.h"
#include "fleet/fetcher.h"
#include "fleet/object_store.h"

namespace kiroku::fleet {

/// A file of which the store now has the recorded bytes as its newest version.
struct MendedFile {
  std::string path;
  crypto::Sha256Digest sha256{};
  std::string from;     // "an older version", or CaseCopy::name()
  std::string version;  // the new one
};
/// One that stays as it is.
struct UnmendedFile {
  std::string path, why;
  std::string detail = {};  // as a disk or a library told it: the next time in other words
  [[nodiscard]] std::string told() const { return detail.empty() ? why : why + " (" + detail + ")"; }
};
struct Mending {
  std::vector<MendedFile> mended;
  std::vector<UnmendedFile> left;
  std::uint64_t more_left = 0;  // beyond those that are named
  /// Files that signed lines say to be erased, and of which the store has other bytes than the recorded ones,
  /// or gives none: they are not put again. What lay in their place is not in the folder any more. Those that
  /// the store was to keep, by a lock that has not ended or by a legal hold, are left, too.
  std::set<std::string> erased = {};
  bool has_other_ledger = false;  // put in place of the one that was looked at
  [[nodiscard]] std::uint64_t left_count() const { return left.size() + more_left; }
};

/// States a deed about a case, durably, before it returns; throws kiroku::Error where that cannot be. What
/// could not be mended need not be stated where that is known already.
using StateMending = std::function<void(const std::string& what)>;

class Mender {
 public:
  /// `store` may list, get and put. The copies are asked in their order, after the store's own older
  /// versions. `scratch` is a folder of the mender's own; `clock` must outlive it.
  Mender(std::shared_ptr<ObjectStore> store, std::vector<std::unique_ptr<CaseCopy>> copies,
         std::filesystem::path scratch, const Clock& clock = Clock::system());

  /// Looks at a case that was fetched with UnreadableObjects::kLeaveOut, and mends what does not fit. The
  /// ledger counts as far as the largest checkpoint that one of `devices` signed reaches. Where the result
  /// has another ledger, nothing else was looked at: fetch the case anew. Mended files are in the folder,
  /// too. What is put is locked for no longer than its first version was, and what is sealed never for longer
  /// than the first version of the case's ledger, which came when the case was closed. `state` hears of each
  /// file before it is put, and once it was; then of the first that stay, and how many more do. Throws
  /// StoreError where the store is away, kiroku::IoError.
  Mending mend(const std::string& appliance, const std::string& case_id,
               const std::vector<crypto::VerifierKey>& devices, const FetchedCase& fetched,
               const StateMending& state);

 private:
  class Pass;
  const std::shared_ptr<ObjectStore> store_;
  std::vector<std::unique_ptr<CaseCopy>> copies_;  // the store's own older versions in front
  const std::filesystem::path scratch_;
  const Clock& clock_;
};

}  // namespace kiroku::fleet

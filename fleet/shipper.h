// Copying an archive into a store, object by object, while it grows. Object keys are the archive's own paths
// below the appliance's name, so that a copy of that prefix is an archive, which kiroku-verify judges alone:
//
//   or-1/20261126T091502Z-3f9c21ab/segments/endoscope/00000000.ts.age   a file of a case
//   or-1/20261126T091502Z-3f9c21ab/ledger.jsonl                         its ledger, once the case is closed
//   or-1/growing/20261126T091502Z-3f9c21ab/000000004096                 its lines from byte 4096 on
//   or-1/log/checkpoints/00000042.note, or-1/growing/log/...            the appliance log, which always grows
//   or-1/evidence/20261126T091502Z-3f9c21ab.ers                         evidence records
//   or-1/store-statements/<case>/...                                   another device's (fleet/stored_case.h)
//   or-1/search/20260805T091502Z-3f9c21ab.json                         by what it is found, where a site asks
//   or-1/published/checkpoint, or-1/published/tile/0/000                the log's tree, where it is published
//
// Lines go after the files that they name, and checkpoints after the lines that they are of. So a copy,
// whenever it is made, is what a recorder that was cut off could have left. An object counts once the store
// has told of it with its size, its SHA-256 and its lock. What the appliance log says of legal holds is set
// in the store, on every version of the case's objects, and asked back; each day it is looked at again, and
// what somebody lifted in the store meanwhile is set again and told. Where locks of longer are asked for than
// before, those of what is there are lengthened. Not thread-safe.
#pragma once

#include <chrono>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "archive/upkeep/holds.h"
#include "base/clock.h"
#include "crypto/signed_note.h"
#include "fleet/lock_lengthening.h"
#include "fleet/object_store.h"
#include "fleet/shipping_list.h"

namespace kiroku::fleet {

struct ShippingTerms {
  std::string appliance;  // [a-z0-9-], what its keys begin with
  /// How long each object is locked, from when it is put.
  std::chrono::hours retention{0};
  /// Whose appliance log it is: by that, cases are under legal hold.
  crypto::VerifierKey device;
  /// A published log (C2SP tlog-tiles), which goes below "published/"; empty: none does.
  std::filesystem::path published = {};
  /// Search notes of cases (archive/search/note_writer.h), which go below "search/"; empty: none do.
  std::filesystem::path search = {};
  /// Throws kiroku::Error where the log in the archive is not the appliance's: its holds are not set or
  /// lifted then. May be null.
  std::function<void()> require_log = {};
  /// States in the appliance log what was found of a case. Throws kiroku::Error where that cannot be. May be
  /// null.
  std::function<void(const std::string& case_id, const std::string& what)> state = {};
  /// So many objects are looked at again in one pass, to see that they are still under legal hold, and
  /// locked for as long as is asked for now; the next pass goes on. What comes is shipped between.
  std::uint64_t looked_at_again = UINT64_MAX;
};

/// What one pass did, and what it left.
struct ShippingReport {
  std::uint64_t sent = 0, sent_bytes = 0;        // put, and confirmed
  std::uint64_t found = 0;                       // were in the store already, which the list did not know
  std::uint64_t waiting = 0, waiting_bytes = 0;  // not in the store yet
  std::optional<UtcTime> waiting_since;          // when the oldest of them was written
  /// Cases of which the store has not confirmed what the log says of their legal hold.
  std::vector<std::string> holds_waiting;
  /// Of cases under legal hold, what the store no longer held or locked as it had confirmed, a sentence each.
  /// Nothing of Kiroku lifts it so.
  std::vector<std::string> lifted;
  std::uint64_t lengthened = 0;  // versions in the store whose locks ended earlier than is asked for
  /// Where it is not known yet that none ends earlier: how far that was looked at.
  std::optional<ShippingList::LockLook> locks_left;
  /// What could not be shipped, a sentence each; the rest was.
  std::vector<std::string> problems;
};

class Shipper {
 public:
  /// What is given must outlive it. `time` says when locks end.
  Shipper(ObjectStore& store, ShippingList& list, ShippingTerms terms, const Clock& time = Clock::system());

  /// Ships what is not in the store yet: of every case and of the appliance log in `archive`, oldest first.
  /// What is under legal hold is looked at again where its holds changed, and each day; all locks are where
  /// longer ones are asked for than before. Ends early once `is_ended`. Throws StoreError where the store
  /// does not take anything, what is not away is shipped next time.
  ShippingReport ship(const std::filesystem::path& archive, const std::function<bool()>& is_ended);
  /// The same without asking the store.
  ShippingReport look(const std::filesystem::path& archive);

 private:
  struct Pass;
  /// One case's objects, being looked at again.
  struct HoldLook {
    std::string case_id, entries;
    std::vector<ListedVersion> left;  // the next one last
  };
  const archive::Holds& holds_in(const std::filesystem::path& log);
  ObjectStore& store_;
  ShippingList& list_;
  const ShippingTerms terms_;
  const Clock& time_;
  /// The holds as they were read last, and how the log was then.
  std::string holds_read_of_;
  archive::Holds holds_;
  std::optional<HoldLook> look_;
  std::vector<std::string> lifted_;  // found, and in no report yet
  LockLengthening lengthening_;
};

/// What became of an object that was put under a lock of a minute, to find out whether the store's locks
/// hold.
struct LockProbe {
  std::string key, version;
  bool may_remove = false;    // the store removed an object without a lock: its refusals say something
  bool removed = false;       // the store removed the locked version
  bool replaced = false;      // after another put of the same key, the first version's bytes were others
  bool unlocked = false;      // the store told of no lock, of another mode, or of an earlier end
  bool hold_removed = false;  // the store removed an object under legal hold, or told of no such hold
  [[nodiscard]] bool fails() const { return removed || replaced || unlocked || hold_removed; }
  [[nodiscard]] bool holds() const { return may_remove && !fails(); }
};
/// Puts it below "probe/" of the appliance, asks the store to remove and to replace it, and looks; before,
/// the same with an object that nothing locks, and with one under legal hold, which is lifted then. Neither
/// fails() nor holds(): the access key may remove nothing, or the bucket locks everything by itself, and
/// nothing was shown. Throws StoreError.
LockProbe probe_lock(ObjectStore& store, const std::string& appliance, const Clock& time = Clock::system());

}  // namespace kiroku::fleet

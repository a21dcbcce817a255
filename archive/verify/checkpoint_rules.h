// Signed notes of a ledger against its tree. Not thread-safe.
#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "archive/format/case_folder.h"
#include "archive/format/limits.h"
#include "archive/verify/finding_list.h"
#include "archive/verify/notes_ahead.h"
#include "archive/verify/report.h"
#include "archive/verify/verify_options.h"
#include "crypto/signed_note.h"

namespace kiroku::archive {

/// The note files of `checkpoints/`, by tree size, from the folder's listing. Files there with other names
/// are not in it.
std::vector<std::uint64_t> note_sizes(const std::vector<ListedFile>& listing);

/// Whether the folder of notes could be listed, if there is one.
bool are_notes_listed(const std::vector<ListedFile>& listing);

/// The bytes of one note; adds a finding and gives nothing where it cannot be had.
std::optional<std::string> read_note(const CaseFolder& folder, std::uint64_t size,
                                     std::optional<std::uint64_t> entry, FindingList& findings);

/// Whether a root is that of the tree as it stands.
using RootTest = std::function<bool(const crypto::Sha256Digest& root)>;

/// Numbers of entries, from entry 0 on, one for each key with which a device may sign beside Ed25519.
struct EntriesBy {
  std::uint64_t ml_dsa = 0, hardware = 0;
};

/// Takes the tree's root at each size that a note has, in rising order, and checks that note.
class CheckpointRules {
 public:
  /// `all_listed`: there can be no others than of these sizes.
  CheckpointRules(const CaseFolder& folder, const VerifyOptions& options, FindingList& findings,
                  std::vector<std::uint64_t> sizes, bool all_listed = true);

  /// Who must sign from here on, and the origin line; before the first call signatures and origins are not
  /// checked (the ledger has no usable `open`, which is a finding of its own). Of a device that is known to
  /// sign by ML-DSA, too, notes of up to `alone_until` entries may lack that signature, as long as none
  /// before them has it: a device that has both keys uses both. Hardware may not answer, so a note without
  /// its signature is none that was tampered with; what nothing by hardware covers is unproven (judge_keys).
  void set_signer(crypto::VerifierKey device, std::string origin, EntriesBy alone_until);
  /// Whether a note of this size is there.
  [[nodiscard]] bool has(std::uint64_t size) const;
  /// Whether notes can be there that has() does not know of.
  [[nodiscard]] bool all_listed() const { return all_listed_; }
  /// Whether a note over more than covered() may be there that nobody could read: then nothing says that none
  /// is.
  [[nodiscard]] bool may_cover_more() const { return !all_listed_ || unread_ > covered_; }
  /// A note that came to be after the listing.
  void appeared(std::uint64_t size);
  /// The tree has `size` entries, and `fits` tells whether a root is its. `tree_known` is false once a line
  /// could not be hashed. `mono_ns` is the case clock of the last entry, where known. What does not fit is a
  /// finding, but where the caller says so itself (`is_told`).
  void reached(std::uint64_t size, const RootTest& fits, bool tree_known, std::optional<std::int64_t> mono_ns,
               bool is_told = false);
  /// The ledger ends with `size` entries: notes beyond are findings.
  void finish(std::uint64_t size);

  /// Largest size whose note fits the tree; 0 if none.
  [[nodiscard]] std::uint64_t covered() const { return covered_; }
  /// Whether the note of this size was reached, is signed as it must be, and is of the entries that are here.
  [[nodiscard]] bool fits(std::uint64_t size) const { return fitting_.contains(size); }
  /// The same of notes whose signature was checked: without a device's key none is.
  [[nodiscard]] std::uint64_t signed_entries() const {
    return signatures_checked() == SignaturesChecked::kNone ? 0 : covered_;
  }
  /// Largest sizes whose notes fit the tree and were checked by each key beside Ed25519 of the device that
  /// signs now; 0 if none.
  [[nodiscard]] EntriesBy covered_by() const { return covered_by_; }
  /// The largest note that fits and is signed as it must be by the device that the lines name; nothing if
  /// none.
  [[nodiscard]] const std::optional<JudgedNote>& newest_fitting() const { return newest_fitting_; }
  /// After finish(): says what was signed, or checked, by fewer keys than the device has. The first `vouched`
  /// entries are known otherwise to be those of a device that signed them by these keys; `claims`: how many
  /// there are to vouch for.
  void judge_keys(std::uint64_t claims, EntriesBy vouched);
  /// By which keys of the device all that is covered was checked, once judge_keys() was called; kNone where
  /// any note is not signed as it must be.
  [[nodiscard]] SignaturesChecked signatures_checked() const { return signatures_checked_; }
  /// Largest size that any note has by its name; 0 if none.
  [[nodiscard]] std::uint64_t newest() const { return sizes_.empty() ? 0 : sizes_.back(); }
  [[nodiscard]] std::uint64_t count() const { return count_; }
  /// Hash of the bytes that were judged as the note of this size; nothing where none were. Whoever reads the
  /// note again compares it: its file may have changed meanwhile.
  [[nodiscard]] std::optional<crypto::Sha256Digest> hash_at(std::uint64_t size) const;
  /// Case clock when the tree had this size; nothing for a size without a note.
  [[nodiscard]] std::optional<std::int64_t> mono_at(std::uint64_t size) const;

 private:
  [[nodiscard]] ReadNote open(const std::string& note) const;
  /// Reads the note of this size, adding a finding where it cannot be had.
  std::optional<crypto::OpenedNote> opened(std::uint64_t size);
  /// From now on opens the notes from this size on in several threads, if they are many.
  void open_ahead(std::uint64_t size);
  /// Form, signature and size; the checkpoint if all hold. Its origin is the caller's to check.
  std::optional<crypto::Checkpoint> check_note(std::uint64_t size, const crypto::OpenedNote& opened);
  /// Whether signatures by the device's ML-DSA key, or by its hardware, cover what is claimed.
  bool judge_ml_dsa(std::uint64_t claims, std::uint64_t vouched);
  bool judge_hardware(std::uint64_t claims, std::uint64_t vouched);

  const CaseFolder* folder_;
  const VerifyOptions* options_;
  FindingList* findings_;
  std::vector<std::uint64_t> sizes_;  // ascending
  bool all_listed_;
  std::uint64_t unread_ = 0;  // the largest size of a note that is there and could not be read
  std::optional<crypto::VerifierKey> device_;
  std::string origin_;
  EntriesBy alone_until_;
  bool all_signed_ = true;              // each note that was looked at, by all keys that it needs
  EntriesBy unchecked_;                 // how many notes have a line in the name of a key that was not given
  std::uint64_t hardware_missing_ = 0;  // notes that hardware was to sign and did not
  SignaturesChecked signatures_checked_ = SignaturesChecked::kNone;
  std::map<std::uint64_t, std::int64_t> mono_;
  std::map<std::uint64_t, crypto::Sha256Digest> hashes_;  // by size
  std::set<std::uint64_t> fitting_;                       // sizes
  std::optional<JudgedNote> newest_fitting_;
  std::uint64_t covered_ = 0;
  EntriesBy covered_by_;
  std::uint64_t count_ = 0;
  bool changed_ = false;  // a root did not fit: all later ones cannot either
  bool may_open_ahead_ = true;
  std::optional<NotesAhead> ahead_;  // last: reads the rest
};

/// Sizes of all regular files together.
std::uint64_t bytes_in(const std::vector<ListedFile>& listing);

/// The device with the keys beside Ed25519 that it is known to have; `device` itself if none is known.
crypto::VerifierKey known_device(const crypto::VerifierKey& device,
                                 const std::vector<crypto::VerifierKey>& known);

/// Adds "no-trusted-device" or "device-not-trusted" unless `device` is trusted.
void judge_device(const crypto::VerifierKey& device, const VerifyOptions& options, FindingList& findings);

}  // namespace kiroku::archive

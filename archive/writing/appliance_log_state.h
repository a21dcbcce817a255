// What an ApplianceLog holds: shared by its parts (appliance_log.cpp, appliance_log_entries.cpp,
// appliance_log_settling.cpp, appliance_log_checkpoints.cpp), of no use to anybody else. append() and
// append_and_checkpoint() take `mutex` and the log's turn themselves. All others want `mutex` held, but for
// open(), which has the object alone; those that read or write the log's files want the turn, too.
#pragma once

#include <cstdint>
#include <deque>
#include <filesystem>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "archive/format/log_entry.h"
#include "archive/storage/file_system.h"
#include "archive/storage/space_reserve.h"
#include "archive/writing/appliance_log.h"
#include "archive/writing/ledger.h"
#include "archive/writing/own_checkpoints.h"
#include "archive/writing/stated_in_log.h"
#include "archive/writing/unsigned_lines.h"
#include "crypto/hardware_key.h"
#include "crypto/signed_note.h"
#include "crypto/tpm_quote.h"

namespace kiroku::archive {

/// Throws kiroku::IoError.
void make_folder_unless_there(FileSystem& files, const std::filesystem::path& folder);

struct ApplianceLog::State {
  State(FileSystem& the_files, std::filesystem::path the_folder, const crypto::SigningKey& the_key,
        const std::string& name);

  // Entering lines (appliance_log_entries.cpp).
  /// What asks the TPM for quotes; null where this program was given none.
  [[nodiscard]] const crypto::BootAttester* attester() const;
  [[nodiscard]] bool lacks_attestation() const;
  /// Of the boot of now, for the entry of number `size`, which is the next one.
  [[nodiscard]] crypto::BootAttester::Answer quote(const crypto::BootAttester& asked,
                                                   std::uint64_t size) const;
  [[nodiscard]] BootEntry boot_entry(std::uint64_t size) const;
  /// Has the log state the attestation key with a first quote, or takes note of why not. Once for each
  /// object: a TPM that does not answer must not hold up each entry.
  void state_attestation_locked();
  /// The entries that must come first (a boot, keys, a cut made good), then `body` if there is one.
  void append_locked(const std::optional<LogEntryBody>& body);
  /// What was found of lines that nobody of this device signed, each with a checkpoint of its own. One that
  /// finds no room stays to be stated.
  void state_unsigned_locked();
  void told_of(const SetAside& kept);
  /// With the turn, of a log that was just opened. Where a program ends between cutting lines off and
  /// entering that, a file beside the log is all that tells of them. Whoever can write to the archive makes
  /// such files, too: the entry says no more than that one lies there, and few are told of at a time.
  void take_up_untold_locked();
  /// Without those of which an entry tells, whose program ended before it gave them their name.
  std::vector<UntoldAside> without_told(std::vector<UntoldAside> untold);
  void append_lines_locked(const std::optional<LogEntryBody>& body);
  std::vector<std::string> lines_before(std::uint64_t size, const std::optional<LogEntryBody>& body);
  void append(const std::optional<LogEntryBody>& body);
  /// A line whose checkpoint finds no room is taken back before anybody else sees it. Its number.
  std::uint64_t append_and_checkpoint(const LogEntryBody& body);
  /// What somebody relies on who asked for it. A recorder goes on where its own entries are not signed.
  [[nodiscard]] static bool is_statement(const LogEntryBody& body);
  /// Whether the device signed no checkpoint of the log's size: whatever else lies in its place is none.
  /// Where that cannot be told there is one.
  [[nodiscard]] bool lacks_note() const;
  /// A statement counts if it has a checkpoint of its own. Whoever can write to the disk adds two, of which
  /// none is taken back; a checkpoint over the last would sign it. Behind another entry it stays unsigned.
  void require_no_unsigned_statement() const;
  void take_back_newest();
  void take_back_unsigned_line();

  // What stands behind the newest checkpoint, and lines that were changed (appliance_log_settling.cpp).
  /// With the turn: takes in what others wrote, and puts aside what no writer of this device left. Throws
  /// where the device's own log states a key that this program does not have.
  void settle_locked();
  /// Why this program must not sign in this log, whose device has other keys; "" where it may.
  [[nodiscard]] std::string why_other_keys() const;
  /// With the turn: what stands behind the newest checkpoint of this device's that fits is a crash's, or
  /// somebody else's.
  ///
  /// - Lines that no writer of this device leaves are put aside with all behind them.
  /// - One that lacks the checkpoint which was to follow it is taken back. A writer tells whoever asked of
  ///   nothing but what is signed, so nobody counts on that line.
  /// - What the device stands on stays, and so do several that lack theirs: somebody took those away. The
  ///   next entry says so.
  ///
  /// Where lines that were signed are others now, all stays as it is found, for whoever asks what happened.
  void look_behind_locked();
  [[nodiscard]] UnsignedLines lines_behind() const;
  /// Somebody may change lines while the log is open, and add one: what would be cut off and signed then were
  /// the changed lines. They are read anew, and the next entry says that they are others.
  bool were_changed(const UnsignedLines& behind);
  /// `is_unread`: the device may have signed more than is known here.
  void settle(const UnsignedLines& behind, bool damaged, bool is_unread);
  void leave_unsigned(std::uint64_t end);
  /// A crash leaves one line without its checkpoint. Of a disk without room for the copy it is taken back all
  /// the same, if it is the last.
  void take_back_from(const UnsignedLine& line, std::uint64_t lines);
  /// Lines from number `seq` on, at byte `offset`; false where they cannot be kept elsewhere.
  bool put_aside(std::uint64_t seq, std::uint64_t offset);
  bool keep_aside(std::uint64_t seq, std::uint64_t offset);
  /// Of a line that is too long or holds a zero byte, and of what stands behind it, while lines are read.
  Ledger::Aside put_no_entry_aside(std::uint64_t seq, std::uint64_t offset, const Ledger::Replace& replace);
  void cut_off_no_entry(std::uint64_t seq, std::uint64_t offset);
  /// Lines that the device signed, and that no reader would get beyond: they are kept elsewhere, with a mark
  /// in the place of each. All other lines stay, under their numbers.
  Ledger::Aside mark_changed(std::uint64_t seq, std::uint64_t offset, std::uint64_t covered,
                             const Ledger::Replace& replace);
  /// Whoever fills the disk does not keep what they added in the log: the reserve has room for a copy of it,
  /// unless it is long.
  SetAside set_aside_with_room(std::uint64_t seq, std::uint64_t offset, Telling telling);
  void with_room(std::uint64_t offset, const std::function<void()>& write);
  /// Whether lines are others than those that were signed, and the log does not say so yet.
  [[nodiscard]] bool is_damage_open() const;
  [[nodiscard]] bool is_that_damage(const LogDamageEntry& stated) const;
  /// Of the lines of this log: of keys that this program does not have those for which the device stands.
  [[nodiscard]] LogKeys keys_of_lines() const;
  void remark(const std::string& sentence);
  /// Of a log that was read anew: whether the lines that were signed last, as far as it is known here, are
  /// others now. The next entry says so.
  bool are_others_than_signed();
  void state_damage(const std::optional<crypto::Sha256Digest>& root);
  [[nodiscard]] std::string words_of_damage() const;

  // Checkpoints of this device (appliance_log_checkpoints.cpp).
  /// Until the log states the device's ML-DSA key, the device signed by Ed25519 alone.
  [[nodiscard]] crypto::VerifierKey device_of_log() const;
  /// Whatever other keys it has: a note with the line of another key in the device's name is none by all of
  /// its keys, and what that key signed is the device's all the same.
  [[nodiscard]] crypto::VerifierKey by_ed25519() const;
  [[nodiscard]] std::optional<OwnCheckpoint> own_checkpoint(std::uint64_t size) const;
  /// With the turn: the newest checkpoint of this device's. Whoever puts other files there, of whatever size,
  /// or lines behind it, however many, does not hide it.
  [[nodiscard]] std::optional<OwnCheckpoint> newest_own_checkpoint() const;
  [[nodiscard]] std::uint64_t newest_own_size() const;
  /// With the turn: how many lines the device signed, as far as anybody knows here, whether they are those
  /// that stand there or not, and whether its checkpoint is there still. Where the checkpoints cannot be
  /// read, and the home remembers none, it may be any line.
  [[nodiscard]] std::uint64_t covered_size() const;
  /// What a process of this home signed last.
  [[nodiscard]] std::optional<OwnCheckpoint> remembered() const;
  /// With the turn: what another process of this home signed is the device's, though its checkpoint is not
  /// there any more. It is put back: without it the lines count for less.
  void take_remembered();
  /// The checkpoint of the log's size. Whether it could be looked for.
  bool read_own_of_now(bool& damaged);
  /// The newest one that fits. Whether those could be looked at.
  bool read_newest_fitting();
  /// With the turn: how many lines the newest checkpoint of this device's covers that is over the lines which
  /// are there; 0 if none is over more than `known`.
  [[nodiscard]] std::uint64_t newest_fitting(std::uint64_t known, const crypto::VerifierKey& by) const;
  /// The root of the first `size` lines; nothing where there are fewer.
  [[nodiscard]] std::optional<crypto::Sha256Digest> root_of_first(std::uint64_t size) const;
  void is_signed_until(std::uint64_t size, const std::optional<crypto::Sha256Digest>& root);
  /// With the turn, of a log that was just opened. A checkpoint that cannot be read is left to whoever
  /// verifies: it keeps nobody from recording.
  void compare_locked(const std::optional<crypto::Checkpoint>& expected);
  [[nodiscard]] std::string what_lacks(const crypto::Checkpoint& expected,
                                       const std::optional<crypto::Sha256Digest>& root) const;
  /// Whether a checkpoint of this device's, over these very lines, lies in its place then. What else lies
  /// there than a checkpoint of this device's is overwritten; one of its own over other lines is kept, as it
  /// shows that lines were changed, and so is what cannot be read. Whoever can write to the archive may have
  /// made the folder one that nobody can write to: that keeps nobody from recording.
  bool checkpoint_locked();
  bool write_checkpoint();

  FileSystem& files;
  std::filesystem::path folder;
  const crypto::SigningKey& key;
  crypto::VerifierKey device;
  SpaceReserve reserve;
  std::string boot_id;  // of this machine, as far as known
  LogKeys own_keys;     // of what this program was given
  StatedInLog in_log;
  bool keys_unsigned = false;  // lines that state own keys were written, and no checkpoint yet
  std::string not_attested;    // why the TPM did not quote when its attestation key was to be stated
  std::string silence;         // why the newest checkpoint lacks the line by hardware
  bool silence_stated = false;
  std::optional<LogDamageEntry> damage;
  bool damage_stated = false;
  std::string lacks;             // as of lacks()
  std::string newest_note_text;  // of the newest checkpoint by this device when the log was opened
  struct Unstated {
    std::string deed;
    std::optional<SetAside> kept;  // of which it tells
  };
  std::deque<Unstated> unstated;     // what the log is to say next of lines that nobody signed
  bool was_put_aside = false;        // and is not stated yet
  bool was_read_anew = false;        // the ledger, since it was looked at
  bool is_unsignable_told = false;   // that no checkpoint can be written
  bool is_remembered_here = false;   // what the home remembers is of these lines
  std::vector<std::string> remarks;  // as of remarks()
  std::size_t handed_out = 0;        // so many of them were told, or asked for
  std::function<void(const std::string& remark)> tell;   // may be null
  std::function<void(std::string_view note)> keep_note;  // may be null
  LogMemory memory;
  std::uint64_t kept_size = 0;  // of the checkpoint that was kept elsewhere
  /// So many lines a checkpoint of this device's covers that fits them, as far as known.
  std::uint64_t signed_until = 0;
  std::optional<crypto::Sha256Digest> signed_root;  // of these lines, once it is known
  /// So many lines were looked at, or written here. Should a note of them vanish now, nothing is cut off.
  std::uint64_t looked_at = 0;
  std::unique_ptr<Ledger> ledger;
  std::mutex mutex;
};

}  // namespace kiroku::archive

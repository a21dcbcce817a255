#include "archive/writing/appliance_log.h"

#include <algorithm>
#include <chrono>
#include <deque>
#include <fstream>
#include <limits>
#include <mutex>
#include <unordered_map>
#include <utility>

#include "archive/format/boot_quote.h"
#include "archive/format/case_folder.h"
#include "archive/format/case_layout.h"
#include "archive/format/line_reader.h"
#include "archive/format/log_entry.h"
#include "archive/storage/file_system.h"
#include "archive/storage/space_reserve.h"
#include "archive/verify/found_files.h"
#include "archive/writing/ledger.h"
#include "base/error.h"
#include "crypto/encoding.h"
#include "crypto/hardware_key.h"
#include "crypto/merkle_tree.h"
#include "crypto/tpm_quote.h"

namespace kiroku::archive {

namespace {

namespace fs = std::filesystem;

Moment machine_now() {
  const auto since_boot = std::chrono::steady_clock::now().time_since_epoch();
  return {utc_now(), std::chrono::duration_cast<std::chrono::nanoseconds>(since_boot).count()};
}

void make_folder_unless_there(FileSystem& files, const fs::path& folder) {
  if (!files.exists(folder)) {
    files.make_folder(folder);
    files.sync_folder(folder.parent_path());
  }
}

std::string base64_of(ByteView bytes) { return crypto::to_base64(bytes, crypto::Base64Padding::kPadded); }

void check_case_id(const std::string& case_id) {
  if (!is_case_id(case_id)) {
    throw UsageError("\"" + case_id + "\" is no case identifier such as 20260805T091502Z-3f9c21ab");
  }
}

struct OwnCheckpoint {
  crypto::Checkpoint checkpoint;
  std::string note;
};

/// The checkpoint of that size, if it is one that the device signed. Anybody who can write to the disk makes
/// others. Throws kiroku::IoError.
std::optional<OwnCheckpoint> checkpoint_of(const fs::path& folder, const crypto::VerifierKey& device,
                                           std::uint64_t size, const FileReading& files) {
  const FileOpening opening = CaseFolder::open(folder, files).open_file(note_path(size));
  std::optional<std::string> note =
      opening.file ? read_small(*opening.file, kMaximumNoteBytes) : std::nullopt;
  if (!note) {
    return std::nullopt;
  }
  const crypto::OpenedNote opened = crypto::open_note(*note, {device});
  if (!crypto::is_signed_for_log(opened, device, size)) {
    return std::nullopt;
  }
  std::optional<crypto::Checkpoint> checkpoint = crypto::Checkpoint::parse(opened.text);
  if (!checkpoint || checkpoint->origin != log_origin(device.name()) || checkpoint->size != size) {
    return std::nullopt;
  }
  return OwnCheckpoint{std::move(*checkpoint), std::move(*note)};
}

/// Of the first `size` lines, whatever they say; nothing where there are fewer.
std::optional<crypto::Sha256Digest> root_of_lines(const FileReading& files, const fs::path& file,
                                                  std::uint64_t size) {
  const ReadableFile input = files.open_to_read(file);
  crypto::MerkleFrontier tree;
  LineReader reader(input);
  for (LedgerLine line; tree.size() < size && reader.next(line) && !line.torn && !line.too_long;) {
    tree.append(crypto::merkle_leaf_hash(bytes_of(line.text)));
  }
  return tree.size() == size ? std::optional(tree.root()) : std::nullopt;
}

}  // namespace

struct ApplianceLog::State {
  State(FileSystem& the_files, fs::path the_folder, const crypto::SigningKey& the_key,
        const std::string& name)
      : files(the_files),
        folder(std::move(the_folder)),
        key(the_key),
        device(crypto::verifier_key_of(name, the_key)),
        reserve(the_files, reserve_file(folder.parent_path())),
        boot_id(kernel_boot_id()) {}

  /// Keeps track of the newest boot and of which cases are open, in what stands in the file, whoever wrote
  /// it. Most lines are checkpoints of cases, which tell nothing of either.
  void look_at(std::uint64_t seq, std::string_view line) {
    if (seq == 0) {
      cases.clear();
      newest_boot_id.clear();
      signing.clear();
      stated_ml_dsa.reset();
      stated_hardware.reset();
      stated_attestation.reset();
      stated_damage.reset();
    }
    constexpr std::string_view kType = R"("type":")";
    const std::size_t at = line.find(kType);
    const std::string_view type = at == std::string_view::npos ? "" : line.substr(at + kType.size());
    signing.push_back(signing_of(type));
    if (signing.size() > kMostRemembered) {
      signing.pop_front();
    }
    if (!type.starts_with("boot\"") && !type.starts_with("device-") && !type.starts_with("case-opened\"") &&
        !type.starts_with("case-closed\"") && !type.starts_with("damage-found\"")) {
      return;
    }
    const LogEntryParse parsed = parse_log_entry(line);
    if (!parsed.entry) {
      return;
    }
    if (const auto* boot = std::get_if<BootEntry>(&parsed.entry->body)) {
      newest_boot_id = boot->boot_id;
    } else if (const auto* added = std::get_if<DeviceMlDsaEntry>(&parsed.entry->body)) {
      stated_ml_dsa = {seq, added->ml_dsa};
    } else if (const auto* hardware = std::get_if<DeviceHardwareEntry>(&parsed.entry->body)) {
      stated_hardware = {seq, hardware->hardware};
    } else if (const auto* attests = std::get_if<DeviceAttestationEntry>(&parsed.entry->body)) {
      stated_attestation = {seq, attests->attestation};
    } else if (std::holds_alternative<DeviceKeyChangedEntry>(parsed.entry->body)) {
      stated_ml_dsa.reset();
      stated_hardware.reset();
      stated_attestation.reset();
    } else if (const auto* found = std::get_if<LogDamageEntry>(&parsed.entry->body)) {
      stated_damage = found->size;
    } else if (const auto* opened = std::get_if<CaseOpenedEntry>(&parsed.entry->body)) {
      cases.try_emplace(opened->case_id, CaseState::kOpened);
    } else if (const auto* closed = std::get_if<CaseClosedEntry>(&parsed.entry->body)) {
      cases[closed->case_id] = CaseState::kClosed;
    }
  }

  /// What asks the TPM for quotes; null where this program was given none.
  [[nodiscard]] const crypto::BootAttester* attester() const {
    return key.hardware() == nullptr ? nullptr : key.hardware()->attester();
  }

  [[nodiscard]] bool lacks_attestation() const { return attester() != nullptr && !stated_attestation; }

  /// Of the boot of now, for the entry of number `size`, which is the next one.
  [[nodiscard]] crypto::BootAttester::Answer quote(const crypto::BootAttester& asked,
                                                   std::uint64_t size) const {
    return asked.quote(qualifying_data({device.to_string(), size, ledger->root(), boot_id}));
  }

  [[nodiscard]] BootEntry boot_entry(std::uint64_t size) const {
    BootEntry boot{boot_id, device.to_string()};
    if (!stated_attestation) {
      return boot;
    }
    if (attester() == nullptr) {
      boot.no_quote = "the program that started was given no attestation key";
    } else if (base64_of(attester()->public_area()) != stated_attestation->key) {
      boot.no_quote = "the program that started was given another attestation key than the log states";
    } else {
      crypto::BootAttester::Answer answer = quote(*attester(), size);
      if (answer.quote) {
        boot.quote = to_stated(*answer.quote);
      } else {
        boot.no_quote = std::move(answer.why);
      }
    }
    return boot;
  }

  /// Has the log state the attestation key with a first quote, or takes note of why not. Once for each
  /// object: a TPM that does not answer must not hold up each entry.
  void state_attestation_locked() {
    ledger->append([&](std::uint64_t size) {
      crypto::BootAttester::Answer answer = quote(*attester(), size);
      if (!answer.quote) {
        not_attested = std::move(answer.why);
        return std::vector<std::string>();
      }
      return std::vector{to_line(
          LogEntry{size, machine_now(),
                   DeviceAttestationEntry{base64_of(attester()->public_area()), to_stated(*answer.quote)}})};
    });
  }

  /// The entries that must come first (a boot, keys, a cut made good), then `body` if there is one.
  void append_locked(const std::optional<LogEntryBody>& body) {
    if (lacks_attestation() && not_attested.empty()) {
      // Its quote is bound to all before it.
      append_lines_locked(std::nullopt);
      state_attestation_locked();
    }
    append_lines_locked(body);
  }

  void append_lines_locked(const std::optional<LogEntryBody>& body) {
    ledger->append([&](std::uint64_t size) {
      std::vector<LogEntryBody> bodies;
      if (newest_boot_id != boot_id) {
        bodies.emplace_back(boot_entry(size));
      }
      if (device.ml_dsa() && !stated_ml_dsa) {
        bodies.emplace_back(DeviceMlDsaEntry{device.ml_dsa()->to_string()});
      }
      if (device.hardware() && !stated_hardware) {
        bodies.emplace_back(DeviceHardwareEntry{device.hardware()->to_string()});
      }
      if (!silence.empty() && !silence_stated) {
        bodies.emplace_back(DeviceHardwareSilentEntry{silence});
      }
      if (const std::uint64_t torn = ledger->torn_bytes(); torn > 0) {
        bodies.emplace_back(LogRecoveredEntry{torn});
      }
      if (damage && !damage_stated) {
        bodies.emplace_back(*damage);
      }
      if (body) {
        bodies.push_back(*body);
      }
      const Moment now = machine_now();
      std::vector<std::string> lines;
      lines.reserve(bodies.size());
      for (const LogEntryBody& each : bodies) {
        lines.push_back(to_line(LogEntry{size + lines.size(), now, each}));
      }
      return lines;
    });
    silence_stated = !silence.empty();
    damage_stated = damage.has_value();
  }

  void append(const std::optional<LogEntryBody>& body) {
    const std::lock_guard guard(mutex);
    const Ledger::Turn turn(*ledger);
    settle_locked();
    append_locked(body);
  }

  /// A line whose checkpoint finds no room is taken back before anybody else sees it. Its number.
  std::uint64_t append_and_checkpoint(const LogEntryBody& body) {
    const std::lock_guard guard(mutex);
    const Ledger::Turn turn(*ledger);
    settle_locked();
    append_locked(body);
    bool is_signed = false;
    try {
      is_signed = checkpoint_locked();
    } catch (const IoError&) {
      take_back_unsigned_line();
      throw;
    }
    if (!is_signed && is_statement(body)) {
      const std::string file = (folder / note_path(ledger->size())).string();
      ledger->take_back(ledger->size() - 1, false);
      throw Error(
          "what was to be entered into the appliance log cannot be signed: " + file +
          " is in the way, which is a folder, cannot be read, or is a checkpoint of other lines: 'kiroku log "
          "--verify' tells more. Nothing was entered");
    }
    return ledger->size() - 1;
  }

  /// What somebody relies on who asked for it. A recorder goes on where its own entries are not signed.
  [[nodiscard]] static bool is_statement(const LogEntryBody& body) {
    return std::holds_alternative<CaseHeldEntry>(body) || std::holds_alternative<CaseReleasedEntry>(body) ||
           std::holds_alternative<ConsentGivenEntry>(body) ||
           std::holds_alternative<ConsentWithdrawnEntry>(body) ||
           std::holds_alternative<CaseErasedEntry>(body);
  }

  /// Whether the device signed no checkpoint of the log's size: whatever else lies in its place is none.
  /// Where that cannot be told there is one.
  [[nodiscard]] bool lacks_note() const {
    try {
      return !own_checkpoint(ledger->size());
    } catch (const Error&) {
      return false;
    }
  }

  /// A statement counts if it has a checkpoint of its own. Whoever can write to the disk adds two, of which
  /// none is taken back; a checkpoint over the last would sign it. Behind another entry it stays unsigned.
  void require_no_unsigned_statement() const {
    if (ledger->size() == 0 || signing.back() == Signing::kNone || !lacks_note()) {
      return;
    }
    throw Error(
        "the newest entry of the appliance log in " + folder.string() +
        " was not signed by whoever wrote it, so nothing is signed over it: 'kiroku log --verify' tells "
        "more. Any later entry of the device makes an end of it: start kirokud, then try again");
  }

  void take_back_unsigned_line() {
    if (!lacks_note()) {
      return;
    }
    try {
      ledger->take_back(ledger->size() - 1, false);
    } catch (const Error&) {  // NOLINT(bugprone-empty-catch): the first error is the one to tell
    }
  }

  /// With the turn: takes in what others wrote, and back the last line where its writer died before it was
  /// signed, or anybody made it up. A writer tells whoever asked only of what is signed, so nobody counts on
  /// that line. One crash leaves one: where more lack their checkpoint, somebody took those away, and nothing
  /// is removed. Nor is what the device stands on: a case's opening, another key.
  void settle_locked() {
    ledger->catch_up();
    if (stated_ml_dsa && (!device.ml_dsa() || device.ml_dsa()->to_string() != stated_ml_dsa->key)) {
      throw Error("the appliance log in " + folder.string() + " states in its entry " +
                  std::to_string(stated_ml_dsa->entry) + " that " + device.name() +
                  " signs with an ML-DSA key, too, which was not given: put device-ml-dsa.key of this home "
                  "back, and start whatever runs from before it was made anew");
    }
    if (stated_hardware && device.hardware() && device.hardware()->to_string() != stated_hardware->key) {
      throw Error(
          "the appliance log in " + folder.string() + " states in its entry " +
          std::to_string(stated_hardware->entry) + " another key in the hardware of " + device.name() +
          " than device-hardware.json: put the file back that belongs to this home. After hardware was "
          "replaced, make a new home (docs/how-to/keep-a-key-in-hardware.md)");
    }
    if (stated_hardware && !device.hardware()) {
      silence = "the program that signed was given no key in hardware";
    }
    const std::uint64_t size = ledger->size();
    if (size == 0 || size <= known_signed || signing.back() != Signing::kFollows) {
      return;
    }
    if (!lacks_note()) {
      known_signed = size;
      return;
    }
    const std::optional<OwnCheckpoint> newest = newest_own_checkpoint();
    const std::uint64_t unsigned_lines = size - std::min(size, newest ? newest->checkpoint.size : 0);
    const bool alone = unsigned_lines > 0 && unsigned_lines <= signing.size() &&
                       std::all_of(signing.end() - static_cast<std::ptrdiff_t>(unsigned_lines),
                                   signing.end() - 1, [](Signing each) { return each == Signing::kNone; });
    if (alone) {
      ledger->take_back(size - 1, true);
    }
  }

  /// Until the log states the device's ML-DSA key, the device signed by Ed25519 alone.
  [[nodiscard]] std::optional<OwnCheckpoint> own_checkpoint(std::uint64_t size) const {
    if (!device.ml_dsa()) return checkpoint_of(folder, device, size, files);
    const std::uint64_t since =
        stated_ml_dsa ? stated_ml_dsa->entry : std::numeric_limits<std::uint64_t>::max();
    return checkpoint_of(folder, device.with_ml_dsa(*device.ml_dsa(), since), size, files);
  }

  /// With the turn: the newest checkpoint of this device's. Whoever puts other files there, of whatever size,
  /// or lines behind it, however many, does not hide it.
  [[nodiscard]] std::optional<OwnCheckpoint> newest_own_checkpoint() const {
    std::vector<std::uint64_t> sizes;
    for (const std::string& name : files.names_in(folder / kCheckpointsFolder)) {
      const std::uint64_t size = size_of_note_name(name).value_or(0);
      if (size > 0) sizes.push_back(size);
    }
    std::ranges::sort(sizes, std::greater<>());
    for (const std::uint64_t size : sizes) {
      if (std::optional<OwnCheckpoint> own = own_checkpoint(size)) return own;
    }
    return std::nullopt;
  }

  /// The root of the first `size` lines; nothing where there are fewer.
  [[nodiscard]] std::optional<crypto::Sha256Digest> root_of_first(std::uint64_t size) const {
    if (size == ledger->size()) return ledger->root();
    if (size > ledger->size()) return std::nullopt;
    return root_of_lines(files, ledger->file(), size);
  }

  /// With the turn, of a log that was just opened. A checkpoint that cannot be read is left to whoever
  /// verifies: it keeps nobody from recording.
  void compare_locked(const std::optional<crypto::Checkpoint>& expected) {
    try {
      std::optional<OwnCheckpoint> newest = newest_own_checkpoint();
      std::optional<crypto::Sha256Digest> root;
      if (newest) {
        root = root_of_first(newest->checkpoint.size);
        if (root != newest->checkpoint.root) {
          damage = LogDamageEntry{newest->checkpoint.size, newest->checkpoint.root, root};
          damage_stated = stated_damage == newest->checkpoint.size;
        }
        newest_note_text = std::move(newest->note);
      }
      if (expected && expected->size > 0) {
        const bool is_newest = newest && newest->checkpoint.size == expected->size;
        lacks = what_lacks(*expected, is_newest ? root : root_of_first(expected->size));
      }
    } catch (const Error& error) {
      if (expected) lacks = std::string("it could not be compared: ") + error.what();
    }
  }

  [[nodiscard]] std::string what_lacks(const crypto::Checkpoint& expected,
                                       const std::optional<crypto::Sha256Digest>& root) const {
    if (!root) return "it has " + std::to_string(ledger->size()) + " entries";
    return *root == expected.root ? "" : "its entries are others";
  }

  /// Whether a checkpoint of this device's, over these very lines, lies in its place then. What else lies
  /// there than a checkpoint of this device's is overwritten; one of its own over other lines is kept, as it
  /// shows that lines were changed, and so is what cannot be read.
  bool checkpoint_locked() {
    const crypto::Checkpoint text{log_origin(device.name()), ledger->size(), ledger->root()};
    const fs::path file = folder / note_path(text.size);
    known_signed = text.size;
    if (text.size == 0) {
      return true;
    }
    if (files.exists(file)) {
      try {
        if (files.is_folder(file)) {
          return false;
        }
        if (const std::optional<OwnCheckpoint> there = own_checkpoint(text.size)) {
          return there->checkpoint == text;
        }
      } catch (const Error&) {
        return false;
      }
    }
    crypto::SignedNote written = crypto::sign_note_by_all(text.to_text(), device.name(), key);
    reserve.write_durably(file, bytes_of(written.note));
    if (keep_note) {
      keep_note(written.note);
    }
    if (device.hardware()) {
      silence = std::move(written.hardware_silent);
      silence_stated = silence_stated && !silence.empty();
    }
    return true;
  }

  [[nodiscard]] std::string words_of_damage() const {
    if (!damage) {
      return "";
    }
    return "the appliance log in " + folder.string() +
           (damage->root ? " has other lines than those over which its checkpoint of " +
                               std::to_string(damage->size) + " entries was signed"
                         : " has fewer lines than the " + std::to_string(damage->size) +
                               " over which a checkpoint of it was signed") +
           ": it was changed on the disk. Holds and consents cannot be told from it, and nothing is erased: "
           "put back a "
           "copy that holds; 'kiroku log --verify' tells more";
  }

  /// What becomes of an entry's checkpoint: it follows at once, it does for an entry on which the device
  /// stands, or none is written (the next entry's covers it).
  enum class Signing { kFollows, kKept, kNone };
  static Signing signing_of(std::string_view type) {
    if (type.starts_with("boot\"") || type.starts_with("config-changed\"") ||
        type.starts_with("device-ml-dsa-added\"") || type.starts_with("device-hardware-") ||
        type.starts_with("device-attestation-added\"") || type.starts_with("recovered\"") ||
        type.starts_with("damage-found\"")) {
      return Signing::kNone;
    }
    return type.starts_with("case-opened\"") || type.starts_with("device-key-changed\"") ? Signing::kKept
                                                                                         : Signing::kFollows;
  }
  /// A crash leaves a start of the machine, a cut that was made good and one line.
  static constexpr std::size_t kMostRemembered = 8;

  FileSystem& files;
  fs::path folder;
  const crypto::SigningKey& key;
  crypto::VerifierKey device;
  SpaceReserve reserve;
  std::string boot_id;         // of this machine, as far as known
  std::string newest_boot_id;  // that the log states
  struct StatedKey {
    std::uint64_t entry = 0;
    std::string key;
  };
  std::optional<StatedKey> stated_ml_dsa, stated_hardware, stated_attestation;  // the device's, in the log
  std::string not_attested;  // why the TPM did not quote when its attestation key was to be stated
  std::string silence;       // why the newest checkpoint lacks the line by hardware
  bool silence_stated = false;
  std::optional<LogDamageEntry> damage;
  bool damage_stated = false;
  std::optional<std::uint64_t> stated_damage;  // the size that the log's newest damage-found names
  std::string lacks;                           // as of lacks()
  std::string newest_note_text;  // of the newest checkpoint by this device when the log was opened
  std::function<void(std::string_view note)> keep_note;  // may be null
  std::unordered_map<std::string, CaseState> cases;
  std::deque<Signing> signing;     // of the newest lines
  std::uint64_t known_signed = 0;  // a note of this size was there: should it vanish now, nothing is cut off
  std::unique_ptr<Ledger> ledger;
  std::mutex mutex;
};

ApplianceLog::ApplianceLog(std::unique_ptr<State> state) : state_(std::move(state)) {}
ApplianceLog::~ApplianceLog() = default;
const fs::path& ApplianceLog::folder() const { return state_->folder; }

std::unique_ptr<ApplianceLog> ApplianceLog::open(FileSystem& files, const fs::path& folder,
                                                 const crypto::SigningKey& key,
                                                 const std::string& device_name,
                                                 const std::optional<crypto::Checkpoint>& expected) {
  auto state = std::make_unique<State>(files, folder, key, device_name);
  make_folder_unless_there(files, folder);
  make_folder_unless_there(files, folder / kCheckpointsFolder);
  state->ledger = Ledger::open(
      files, folder / kLedgerFile, Ledger::Sharing::kShared, &state->reserve,
      [&log = *state](std::uint64_t seq, std::string_view line) { log.look_at(seq, line); },
      [folder, &files] { return newest_note(folder, files); });
  const Ledger::Turn turn(*state->ledger);
  state->settle_locked();
  state->compare_locked(expected);
  return std::unique_ptr<ApplianceLog>(new ApplianceLog(std::move(state)));
}

std::string ApplianceLog::damage() const {
  const std::lock_guard guard(state_->mutex);
  return state_->words_of_damage();
}

std::string ApplianceLog::lacks() const {
  const std::lock_guard guard(state_->mutex);
  return state_->lacks;
}

void ApplianceLog::boot(const std::string& boot_id) {
  {
    const std::lock_guard guard(state_->mutex);
    state_->boot_id = boot_id;
  }
  state_->append(std::nullopt);
}

void ApplianceLog::shutdown() { state_->append_and_checkpoint(ShutdownEntry{}); }

void ApplianceLog::config_changed(const crypto::Sha256Digest& sha256) {
  state_->append(ConfigChangedEntry{sha256});
}

void ApplianceLog::device_key_changed() {
  state_->append_and_checkpoint(DeviceKeyChangedEntry{state_->device.to_string()});
}

ApplianceLog::StatedKeys ApplianceLog::state_keys() {
  const crypto::VerifierKey& device = state_->device;
  if (!device.ml_dsa() && !device.hardware()) {
    throw UsageError("the device " + device.name() + " has no key beside Ed25519 to state in its log");
  }
  if (device.hardware()) {
    // The log must not state a key for good that has never signed: that of a TPM that was cleared, or another
    // machine's.
    const std::string silent = crypto::why_silent(*state_->key.hardware());
    if (!silent.empty()) throw Error("the hardware does not sign: " + silent);
  }
  {
    const std::lock_guard guard(state_->mutex);
    const Ledger::Turn turn(*state_->ledger);
    state_->settle_locked();
    const bool all_stated = (!device.ml_dsa() || state_->stated_ml_dsa) &&
                            (!device.hardware() || state_->stated_hardware) && !state_->lacks_attestation();
    if (!all_stated) {
      state_->append_locked(std::nullopt);
    }
    state_->require_no_unsigned_statement();
    state_->checkpoint_locked();
  }
  return stated_keys();
}

ApplianceLog::StatedKeys ApplianceLog::stated_keys() const {
  const std::lock_guard guard(state_->mutex);
  StatedKeys stated;
  if (state_->stated_ml_dsa) stated.ml_dsa = state_->stated_ml_dsa->entry;
  if (state_->stated_hardware) stated.hardware = state_->stated_hardware->entry;
  if (state_->stated_attestation) stated.attestation = state_->stated_attestation->entry;
  stated.not_attested = state_->not_attested;
  return stated;
}

void ApplianceLog::plan_sealed(const crypto::Sha256Digest& sha256) {
  state_->append_and_checkpoint(PlanSealedEntry{sha256});
}

void ApplianceLog::case_opened(const std::string& case_id, const crypto::Sha256Digest& entry0) {
  check_case_id(case_id);
  state_->append_and_checkpoint(CaseOpenedEntry{case_id, entry0});
}

void ApplianceLog::case_checkpoint(const std::string& case_id, std::uint64_t size,
                                   const crypto::Sha256Digest& root) {
  check_case_id(case_id);
  state_->append_and_checkpoint(CaseCheckpointEntry{case_id, size, root});
}

void ApplianceLog::case_closed(const std::string& case_id, std::uint64_t size,
                               const crypto::Sha256Digest& root,
                               const std::optional<crypto::Sha256Digest>& final_token) {
  check_case_id(case_id);
  state_->append_and_checkpoint(CaseClosedEntry{case_id, size, root, final_token});
}

void ApplianceLog::replicated(const std::string& case_id, const std::string& target) {
  check_case_id(case_id);
  state_->append_and_checkpoint(ReplicatedEntry{case_id, target});
}

void ApplianceLog::erased(const std::string& case_id, const std::optional<std::string>& stream,
                          const std::string& policy) {
  check_case_id(case_id);
  state_->append_and_checkpoint(CaseErasedEntry{case_id, stream, policy});
}

std::uint64_t ApplianceLog::case_held(const std::string& case_id, const std::string& reason,
                                      const std::string& who) {
  check_case_id(case_id);
  return state_->append_and_checkpoint(CaseHeldEntry{case_id, reason, who});
}

void ApplianceLog::case_released(const std::string& case_id, std::uint64_t hold, const std::string& reason,
                                 const std::string& who) {
  check_case_id(case_id);
  state_->append_and_checkpoint(CaseReleasedEntry{case_id, hold, reason, who});
}

std::uint64_t ApplianceLog::consent_given(const ConsentStatement& statement) {
  check_case_id(statement.case_id);
  return state_->append_and_checkpoint(ConsentGivenEntry{statement});
}

std::uint64_t ApplianceLog::consent_withdrawn(const ConsentStatement& statement) {
  check_case_id(statement.case_id);
  return state_->append_and_checkpoint(ConsentWithdrawnEntry{statement});
}

void ApplianceLog::pre_roll_discarded(std::uint64_t segments, std::optional<std::int64_t> duration_ns) {
  state_->append_and_checkpoint(PreRollDiscardedEntry{segments, duration_ns});
}

void ApplianceLog::access(const std::string& case_id, const std::string& what, const std::string& who) {
  state_->append_and_checkpoint(AccessEntry{case_id, what, who, {}});
}

void ApplianceLog::access_for(const std::string& purpose, const std::string& case_id, const std::string& what,
                              const std::string& who) {
  state_->append_and_checkpoint(AccessEntry{case_id, what, who, purpose});
}

std::uint64_t ApplianceLog::size() const {
  const std::lock_guard guard(state_->mutex);
  return state_->ledger->size();
}

crypto::Sha256Digest ApplianceLog::root() const {
  const std::lock_guard guard(state_->mutex);
  return state_->ledger->root();
}

ApplianceLog::Head ApplianceLog::head() const {
  const std::lock_guard guard(state_->mutex);
  const Ledger::Turn turn(*state_->ledger);
  state_->settle_locked();
  return {state_->ledger->size(), state_->ledger->root()};
}

ApplianceLog::CaseState ApplianceLog::case_state(const std::string& case_id) const {
  const std::lock_guard guard(state_->mutex);
  const auto found = state_->cases.find(case_id);
  return found == state_->cases.end() ? CaseState::kUnknown : found->second;
}

void ApplianceLog::keep_notes(std::function<void(std::string_view note)> keep) {
  const std::lock_guard guard(state_->mutex);
  state_->keep_note = std::move(keep);
  if (!state_->newest_note_text.empty()) {
    state_->keep_note(state_->newest_note_text);
  }
}

void ApplianceLog::checkpoint() {
  const std::lock_guard guard(state_->mutex);
  const Ledger::Turn turn(*state_->ledger);
  state_->settle_locked();
  state_->require_no_unsigned_statement();
  state_->checkpoint_locked();
}

std::string kernel_boot_id() {
  std::ifstream input("/proc/sys/kernel/random/boot_id");
  std::string id;
  std::getline(input, id);
  return id.empty() ? kUnknownBoot : id;
}

namespace {

/// `damaged` is told why a line cannot be read.
void visit_log_lines(const fs::path& folder, const std::function<void(const LogLine&)>& visit,
                     const std::function<void(const std::string&)>& damaged) {
  const fs::path file = folder / kLedgerFile;
  std::error_code missing;
  const bool is_folder = fs::is_directory(folder, missing);
  const FileOpening opening = is_folder ? CaseFolder::open(folder).open_file(kLedgerFile) : FileOpening{};
  if (!opening.file) {
    throw UsageError("there is no appliance log in " + folder.string() +
                     ": give the folder that holds its ledger.jsonl");
  }
  LineReader reader(*opening.file);
  std::uint64_t number = 0;
  // A last line without LF was torn by a power cut, or another process is writing it just now.
  for (LedgerLine line; reader.next(line) && !line.torn;) {
    ++number;
    const LogEntryParse parsed =
        line.too_long ? LogEntryParse{std::nullopt, "it is too long"} : parse_log_entry(line.text);
    if (!parsed.entry) {
      damaged("cannot read line " + std::to_string(number) + " of " + file.string() + ": " + parsed.problem);
      continue;
    }
    visit(
        {number - 1, parsed.entry->at.utc, std::string(type_of(parsed.entry->body)), std::string(line.text)});
  }
}

}  // namespace

void for_each_log_line(const fs::path& folder, const std::function<void(const LogLine&)>& visit) {
  visit_log_lines(folder, visit, [](const std::string& why) { throw Error(why); });
}

std::string for_each_readable_log_line(const fs::path& folder,
                                       const std::function<void(const LogLine&)>& visit) {
  std::string first;
  visit_log_lines(folder, visit, [&first](const std::string& why) {
    if (first.empty()) {
      first = why;
    }
  });
  return first;
}

bool is_signed_entry(const fs::path& folder, const crypto::VerifierKey& device, std::uint64_t seq,
                     const crypto::Sha256Digest& root) {
  const std::optional<OwnCheckpoint> own = checkpoint_of(folder, device, seq + 1, real_reading());
  return own && own->checkpoint.root == root;
}

crypto::Sha256Digest root_of_log(const fs::path& folder, std::uint64_t size) {
  crypto::MerkleFrontier tree;
  for_each_log_line(folder, [&](const LogLine& line) {
    if (tree.size() < size) tree.append(crypto::merkle_leaf_hash(bytes_of(line.json)));
  });
  if (tree.size() < size) {
    throw Error("the appliance log in " + folder.string() + " has " + std::to_string(tree.size()) +
                " entries where at least " + std::to_string(size) + " were asked for");
  }
  return tree.root();
}

std::vector<LogLine> read_log(const fs::path& folder) {
  std::vector<LogLine> lines;
  for_each_log_line(folder, [&](const LogLine& line) { lines.push_back(line); });
  return lines;
}

}  // namespace kiroku::archive

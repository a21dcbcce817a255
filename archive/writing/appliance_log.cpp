#include "archive/writing/appliance_log.h"

#include <algorithm>
#include <array>
#include <cerrno>
#include <charconv>
#include <chrono>
#include <deque>
#include <fstream>
#include <iterator>
#include <limits>
#include <map>
#include <mutex>
#include <unordered_map>
#include <unordered_set>
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
#include "archive/writing/unsigned_lines.h"
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

/// What a note says, whoever signed it.
std::optional<crypto::Checkpoint> text_of_note(std::string_view note) {
  const std::size_t end = note.find("\n\n");
  return end == std::string_view::npos ? std::nullopt : crypto::Checkpoint::parse(note.substr(0, end + 1));
}

/// What a note states, if the device signed it for its log.
std::optional<OwnCheckpoint> as_own(std::string note, const crypto::VerifierKey& device) {
  const crypto::OpenedNote opened = crypto::open_note(note, {device});
  std::optional<crypto::Checkpoint> checkpoint = crypto::Checkpoint::parse(opened.text);
  if (!checkpoint || checkpoint->origin != log_origin(device.name()) ||
      !crypto::is_signed_for_log(opened, device, checkpoint->size)) {
    return std::nullopt;
  }
  return OwnCheckpoint{std::move(*checkpoint), std::move(note)};
}

/// The checkpoint of that size, if it is one that the device signed; with `root` only if it is over that.
/// Anybody who can write to the disk makes others. Throws kiroku::IoError.
std::optional<OwnCheckpoint> checkpoint_of(const fs::path& folder, const crypto::VerifierKey& device,
                                           std::uint64_t size, const FileReading& files,
                                           const crypto::Sha256Digest* root = nullptr) {
  const FileOpening opening = CaseFolder::open(folder, files).open_file(note_path(size));
  std::optional<std::string> note =
      opening.file ? read_small(*opening.file, kMaximumNoteBytes) : std::nullopt;
  if (!note) {
    return std::nullopt;
  }
  if (root != nullptr) {
    // Signatures of thousands of notes that are over other lines anyway need not be looked at.
    const std::optional<crypto::Checkpoint> said = text_of_note(*note);
    if (!said || said->root != *root) return std::nullopt;
  }
  std::optional<OwnCheckpoint> own = as_own(std::move(*note), device);
  return own && own->checkpoint.size == size ? std::move(own) : std::nullopt;
}

/// The roots over so many of the first lines, whatever they say, for `sizes` in ascending order; fewer where
/// there are fewer lines.
std::vector<crypto::Sha256Digest> roots_of_lines(const FileReading& files, const fs::path& file,
                                                 const std::vector<std::uint64_t>& sizes) {
  const ReadableFile input = files.open_to_read(file);
  crypto::MerkleFrontier tree;
  LineReader reader(input);
  std::vector<crypto::Sha256Digest> roots;
  for (LedgerLine line; roots.size() < sizes.size() && reader.next(line) && !line.torn && !line.too_long;) {
    tree.append(crypto::merkle_leaf_hash(bytes_of(line.text)));
    if (tree.size() == sizes[roots.size()]) roots.push_back(tree.root());
  }
  return roots;
}

/// Sizes of the notes in checkpoints/, ascending, by their names. Throws kiroku::IoError.
std::vector<std::uint64_t> note_sizes_in(const FileReading& files, const fs::path& folder) {
  std::vector<std::uint64_t> sizes;
  for (const std::string& name : files.names_in(folder / kCheckpointsFolder)) {
    const std::uint64_t size = size_of_note_name(name).value_or(0);
    if (size > 0) sizes.push_back(size);
  }
  std::ranges::sort(sizes);
  return sizes;
}

/// The largest of `sizes` (ascending) of which the device signed a checkpoint over the lines that are there;
/// 0: none.
std::uint64_t newest_that_fits(const FileReading& files, const fs::path& folder,
                               const crypto::VerifierKey& device, const std::vector<std::uint64_t>& sizes) {
  const std::vector<crypto::Sha256Digest> roots = roots_of_lines(files, folder / kLedgerFile, sizes);
  for (std::size_t at = roots.size(); at-- > 0;) {
    if (checkpoint_of(folder, device, sizes[at], files, &roots[at])) return sizes[at];
  }
  return 0;
}

// What the device says of lines that are not its own, in an entry `access` of its own.
constexpr std::string_view kFoundBegins = "found no signature of this device over entries ";

std::string found_deed(std::uint64_t from, std::uint64_t to) {
  return std::string(kFoundBegins) + std::to_string(from) + " to " + std::to_string(to);
}

constexpr std::string_view kSha256Ends = ", sha256 ";

std::string set_aside_deed(std::uint64_t from, const SetAside& kept) {
  const std::string what = kept.kept == kept.stood ? "what"
                                                   : std::to_string(kept.kept) + " of the " +
                                                         std::to_string(kept.stood) + " bytes that";
  return "set aside " + what + " stood from entry " + std::to_string(from) +
         " on, which this device did not sign" + std::string(kSha256Ends) + kept.sha256;
}

std::string left_aside_deed(std::uint64_t from, const std::string& sha256) {
  return "found beside the log what was set aside from entry " + std::to_string(from) +
         " on, of which no entry told" + std::string(kSha256Ends) + sha256;
}

std::string changed_deed(std::uint64_t from, const ChangedAside& changed) {
  return "set aside what stood in lines from entry " + std::to_string(from) +
         " on that this device had signed, and that are no entries any more" + std::string(kSha256Ends) +
         changed.kept.sha256;
}

/// Who enters that.
constexpr std::string_view kItself = "kiroku";

struct Entries {
  std::uint64_t from = 0, to = 0;  // both are of them
};

/// Numbers, by stretches that lie apart.
class NumberSet {
 public:
  /// Of a `from` behind `to` there are none.
  void add(std::uint64_t from, std::uint64_t to) {
    if (from > to) return;
    auto each = stretches_.upper_bound(from);
    if (each != stretches_.begin() && std::prev(each)->second >= from) --each;
    while (each != stretches_.end() && each->first <= to) {
      from = std::min(from, each->first);
      to = std::max(to, each->second);
      each = stretches_.erase(each);
    }
    stretches_.emplace(from, to);
  }
  [[nodiscard]] bool contains(std::uint64_t number) const {
    const auto behind = stretches_.upper_bound(number);
    return behind != stretches_.begin() && std::prev(behind)->second >= number;
  }

 private:
  std::map<std::uint64_t, std::uint64_t> stretches_;  // from, to
};

/// What a deed says of which entries; nothing for any other.
std::optional<Entries> entries_of_deed(std::string_view what) {
  if (!what.starts_with(kFoundBegins)) return std::nullopt;
  what.remove_prefix(kFoundBegins.size());
  Entries entries;
  const auto first = std::from_chars(what.begin(), what.end(), entries.from);
  constexpr std::string_view kTo = " to ";
  const std::string_view rest(first.ptr, static_cast<std::size_t>(what.end() - first.ptr));
  if (first.ec != std::errc() || !rest.starts_with(kTo)) return std::nullopt;
  const auto second = std::from_chars(rest.begin() + kTo.size(), rest.end(), entries.to);
  return second.ec == std::errc() && second.ptr == rest.end() ? std::optional(entries) : std::nullopt;
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
        boot_id(kernel_boot_id()) {
    own_keys.device = device.to_string();
    if (device.ml_dsa()) own_keys.ml_dsa = device.ml_dsa()->to_string();
    if (device.hardware()) own_keys.hardware = device.hardware()->to_string();
    if (attester() != nullptr) own_keys.attestation = base64_of(attester()->public_area());
  }

  /// Keeps track of the newest boot and of which cases are open, in what stands in the file, whoever wrote
  /// it. Most lines are checkpoints of cases, which tell nothing of either.
  void look_at(std::uint64_t seq, std::string_view line) {
    if (seq == 0) {
      cases.clear();
      newest_boot_id.clear();
      newest_device.clear();
      forget_keys();
      found.clear();
      disowned_set.reset();
      stated_damages.clear();
    }
    constexpr std::string_view kType = R"("type":")";
    const std::size_t at = line.find(kType);
    const std::string_view type = at == std::string_view::npos ? "" : line.substr(at + kType.size());
    newest_signing = signing_of(type);
    newest_mono_ns = mono_ns_of(line);
    if (!type.starts_with("boot\"") && !type.starts_with("device-") && !type.starts_with("case-opened\"") &&
        !type.starts_with("case-closed\"") && !type.starts_with("damage-found\"") &&
        !(type.starts_with("access\"") && line.find(kFoundBegins) != std::string_view::npos)) {
      return;
    }
    const LogEntryParse parsed = parse_log_entry(line);
    if (!parsed.entry) {
      return;
    }
    if (const auto* boot = std::get_if<BootEntry>(&parsed.entry->body)) {
      newest_boot_id = boot->boot_id;
      take_device(boot->device);
    } else if (const auto* added = std::get_if<DeviceMlDsaEntry>(&parsed.entry->body)) {
      ml_dsa_keys.push_back({seq, added->ml_dsa});
    } else if (const auto* hardware = std::get_if<DeviceHardwareEntry>(&parsed.entry->body)) {
      hardware_keys.push_back({seq, hardware->hardware});
    } else if (const auto* attests = std::get_if<DeviceAttestationEntry>(&parsed.entry->body)) {
      attestation_keys.push_back({seq, attests->attestation});
    } else if (const auto* changed = std::get_if<DeviceKeyChangedEntry>(&parsed.entry->body)) {
      newest_device = changed->device;
      forget_keys();
    } else if (const auto* damaged = std::get_if<LogDamageEntry>(&parsed.entry->body)) {
      stated_damages.push_back({seq, *damaged});
    } else if (const auto* access = std::get_if<AccessEntry>(&parsed.entry->body)) {
      if (const std::optional<Entries> entries = entries_of_deed(access->what)) {
        found.push_back({seq, *entries});
      }
    } else if (const auto* opened = std::get_if<CaseOpenedEntry>(&parsed.entry->body)) {
      cases.try_emplace(opened->case_id, CaseState::kOpened);
    } else if (const auto* closed = std::get_if<CaseClosedEntry>(&parsed.entry->body)) {
      cases[closed->case_id] = CaseState::kClosed;
    }
  }

  void take_device(const std::string& named) {
    if (!newest_device.empty() && newest_device != named) forget_keys();
    newest_device = named;
  }

  void forget_keys() {
    ml_dsa_keys.clear();
    hardware_keys.clear();
    attestation_keys.clear();
  }

  /// As the line says it; 0 where it says none.
  static std::int64_t mono_ns_of(std::string_view line) {
    constexpr std::string_view kKey = R"("mono_ns":)";
    const std::size_t at = line.find(kKey);
    std::int64_t value = 0;
    if (at != std::string_view::npos) {
      std::from_chars(line.data() + at + kKey.size(), line.data() + line.size(), value);
    }
    return value;
  }

  struct StatedKey {
    std::uint64_t entry = 0;
    std::string key;
  };

  /// Whether the device stands for what an entry states: a checkpoint of its own covers it, and the device
  /// did not say later that it found the entry unsigned. Somebody may say so, too, in a line that it found.
  [[nodiscard]] bool stands_for(std::uint64_t entry) const {
    return entry < covered_until && !disowned().contains(entry);
  }

  /// The entries over which the device says in later ones that it found no signature. Of thousands of such
  /// lines each is looked at once, whenever a checkpoint covers more of them.
  [[nodiscard]] const NumberSet& disowned() const {
    const auto end =
        std::ranges::partition_point(found, [&](const Found& each) { return each.entry < covered_until; });
    const auto covered = static_cast<std::size_t>(end - found.begin());
    if (disowned_set && disowned_by == covered) return *disowned_set;
    disowned_set.emplace();
    disowned_by = covered;
    // From the newest on: what a later one disowns says nothing.
    for (std::size_t at = covered; at-- > 0;) {
      const Found& each = found[at];
      if (each.entry > 0 && !disowned_set->contains(each.entry))
        disowned_set->add(each.entries.from, std::min(each.entries.to, each.entry - 1));
    }
    return *disowned_set;
  }

  /// The first line that states the own key, be it unsigned yet.
  [[nodiscard]] static const StatedKey* own_of(const std::vector<StatedKey>& keys, const std::string& own) {
    const auto first = std::ranges::find_if(keys, [&](const StatedKey& each) { return each.key == own; });
    return own.empty() || first == keys.end() ? nullptr : &*first;
  }

  /// The newest line that states another key, if the device stands for it.
  [[nodiscard]] const StatedKey* other_of(const std::vector<StatedKey>& keys, const std::string& own) const {
    const auto newest = std::find_if(keys.rbegin(), keys.rend(), [&](const StatedKey& each) {
      return each.key != own && stands_for(each.entry);
    });
    return newest == keys.rend() ? nullptr : &*newest;
  }

  [[nodiscard]] const StatedKey* stated_ml_dsa() const {
    const StatedKey* own = own_of(ml_dsa_keys, own_keys.ml_dsa);
    return own != nullptr ? own : other_of(ml_dsa_keys, own_keys.ml_dsa);
  }
  [[nodiscard]] const StatedKey* stated_hardware() const {
    const StatedKey* own = own_of(hardware_keys, own_keys.hardware);
    return own != nullptr ? own : other_of(hardware_keys, own_keys.hardware);
  }
  /// Of several the newest that the device stands for, or its own.
  [[nodiscard]] const StatedKey* stated_attestation() const {
    const StatedKey* other = other_of(attestation_keys, own_keys.attestation);
    return other != nullptr ? other : own_of(attestation_keys, own_keys.attestation);
  }

  /// What asks the TPM for quotes; null where this program was given none.
  [[nodiscard]] const crypto::BootAttester* attester() const {
    return key.hardware() == nullptr ? nullptr : key.hardware()->attester();
  }

  [[nodiscard]] bool lacks_attestation() const {
    return attester() != nullptr && stated_attestation() == nullptr;
  }

  /// Of the boot of now, for the entry of number `size`, which is the next one.
  [[nodiscard]] crypto::BootAttester::Answer quote(const crypto::BootAttester& asked,
                                                   std::uint64_t size) const {
    return asked.quote(qualifying_data({device.to_string(), size, ledger->root(), boot_id}));
  }

  [[nodiscard]] BootEntry boot_entry(std::uint64_t size) const {
    BootEntry boot{boot_id, device.to_string()};
    const StatedKey* const stated = stated_attestation();
    if (stated == nullptr) {
      return boot;
    }
    if (attester() == nullptr) {
      boot.no_quote = "the program that started was given no attestation key";
    } else if (own_keys.attestation != stated->key) {
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
    bool came_between = false;
    ledger->append([&](std::uint64_t size) {
      came_between = size != looked_at;
      if (came_between) return std::vector<std::string>();
      crypto::BootAttester::Answer answer = quote(*attester(), size);
      if (!answer.quote) {
        not_attested = std::move(answer.why);
        return std::vector<std::string>();
      }
      keys_unsigned = true;
      return std::vector{to_line(LogEntry{
          size, machine_now(), DeviceAttestationEntry{own_keys.attestation, to_stated(*answer.quote)}})};
    });
    // The lines are looked at before the next ones, and the key is stated with another entry.
    if (!came_between) looked_at = ledger->size();
  }

  /// The entries that must come first (a boot, keys, a cut made good), then `body` if there is one.
  void append_locked(const std::optional<LogEntryBody>& body) {
    state_unsigned_locked();
    if (lacks_attestation() && not_attested.empty()) {
      // Its quote is bound to all before it.
      append_lines_locked(std::nullopt);
      state_attestation_locked();
    }
    append_lines_locked(body);
  }

  /// What was found of lines that nobody of this device signed, each with a checkpoint of its own. One that
  /// finds no room stays to be stated.
  void state_unsigned_locked() {
    // What is put aside meanwhile waits for the next entry: whoever adds a line for each holds nobody up.
    for (std::size_t left = unstated.size(); left > 0; --left) {
      append_lines_locked(AccessEntry{"*", unstated.front().deed, std::string(kItself), {}});
      bool is_signed = false;
      try {
        is_signed = checkpoint_locked();
      } catch (const IoError&) {
        take_back_unsigned_line();
        throw;
      }
      if (is_signed && unstated.front().kept) told_of(*unstated.front().kept);
      unstated.pop_front();
    }
  }

  void told_of(const SetAside& kept) {
    try {
      name_as_told(files, kept);
    } catch (const IoError&) {  // NOLINT(bugprone-empty-catch): the next start finds the entry and the file
    }
  }

  /// With the turn, of a log that was just opened. Where a program ends between cutting lines off and
  /// entering that, a file beside the log is all that tells of them. Whoever can write to the archive makes
  /// such files, too: the entry says no more than that one lies there, and few are told of at a time.
  void take_up_untold_locked() {
    constexpr std::size_t kMost = 16, kMostLookedAt = 4096;
    try {
      std::vector<UntoldAside> untold = untold_asides(files, folder.parent_path(), kMostLookedAt);
      std::erase_if(untold, [&](const UntoldAside& each) {
        return std::ranges::any_of(unstated, [&](const Unstated& coming) {
          return coming.kept && coming.kept->file == each.kept.file;
        });
      });
      if (untold.empty()) return;
      // What an entry tells of, and cannot get its name, stands before no other one.
      untold = without_told(std::move(untold));
      untold.resize(std::min(untold.size(), kMost));
      for (const UntoldAside& each : untold) {
        unstated.push_back({left_aside_deed(each.line, each.kept.sha256), each.kept});
        remark("no entry of the appliance log told of " + each.kept.file.string() +
               ": what stands there was set aside from entry " + std::to_string(each.line) +
               " on by a program that ended before it could enter that, or somebody put the file there. The "
               "log tells of it from now on: keep the file");
      }
      state_unsigned_locked();
    } catch (const Error&) {  // NOLINT(bugprone-empty-catch): it keeps nobody from recording
    }
  }

  /// Without those of which an entry tells, whose program ended before it gave them their name.
  std::vector<UntoldAside> without_told(std::vector<UntoldAside> untold) {
    std::unordered_set<std::string> told;
    for_each_readable_log_line(folder, [&](const LogLine& line) {
      if (line.type != "access" || line.json.find(kSha256Ends) == std::string::npos) return;
      const LogEntryParse parsed = parse_log_entry(line.json);
      const auto* access = parsed.entry ? std::get_if<AccessEntry>(&parsed.entry->body) : nullptr;
      if (access == nullptr || access->who != kItself) return;
      if (const std::size_t at = access->what.rfind(kSha256Ends); at != std::string::npos)
        told.insert(access->what.substr(at + kSha256Ends.size()));
    });
    std::erase_if(untold, [&](const UntoldAside& each) {
      const bool is_told = told.contains(each.kept.sha256);
      if (is_told) told_of(each.kept);
      return is_told;
    });
    return untold;
  }

  void append_lines_locked(const std::optional<LogEntryBody>& body) {
    // Whoever does not ask for the turn may add lines between two looks. What nobody looked at is not signed.
    constexpr int kMostLooks = 16;
    for (int looks = 1;; ++looks) {
      bool came_between = false;
      ledger->append([&](std::uint64_t size) {
        came_between = size != looked_at;
        return came_between ? std::vector<std::string>() : lines_before(size, body);
      });
      if (!came_between) break;
      if (looks == kMostLooks) {
        throw LedgerHeldError(
            "somebody writes into " + ledger->file().string() +
            " all the time without waiting for a turn, so nothing was entered. Find out who "
            "writes to the archive's disk");
      }
      look_behind_locked();
    }
    looked_at = ledger->size();
    silence_stated = !silence.empty();
    damage_stated = damage.has_value();
  }

  std::vector<std::string> lines_before(std::uint64_t size, const std::optional<LogEntryBody>& body) {
    const Moment now = machine_now();
    std::vector<LogEntryBody> bodies;
    // A line of somebody else may name another device, or a later moment of this boot's clock.
    if (newest_boot_id != boot_id || newest_device != own_keys.device || newest_mono_ns > now.mono_ns) {
      bodies.emplace_back(boot_entry(size));
    }
    if (device.ml_dsa() && (stated_ml_dsa() == nullptr || newest_device != own_keys.device)) {
      bodies.emplace_back(DeviceMlDsaEntry{own_keys.ml_dsa});
    }
    if (device.hardware() && (stated_hardware() == nullptr || newest_device != own_keys.device)) {
      bodies.emplace_back(DeviceHardwareEntry{own_keys.hardware});
    }
    keys_unsigned = keys_unsigned || std::ranges::any_of(bodies, [](const LogEntryBody& each) {
                      return std::holds_alternative<DeviceMlDsaEntry>(each) ||
                             std::holds_alternative<DeviceHardwareEntry>(each);
                    });
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
    std::vector<std::string> lines;
    lines.reserve(bodies.size());
    for (const LogEntryBody& each : bodies) {
      lines.push_back(to_line(LogEntry{size + lines.size(), now, each}));
    }
    return lines;
  }

  void append(const std::optional<LogEntryBody>& body) {
    const std::lock_guard guard(mutex);
    const Ledger::Turn turn(*ledger);
    settle_locked();
    append_locked(body);
    // A program that was given fewer keys would take the line that states one for somebody else's.
    if (!keys_unsigned) return;
    try {
      checkpoint_locked();
    } catch (const IoError&) {  // NOLINT(bugprone-empty-catch): the next entry's checkpoint covers it, too
    }
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
      take_back_newest();
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
    if (ledger->size() == 0 || newest_signing == Signing::kNone || !lacks_note()) {
      return;
    }
    throw Error(
        "the newest entry of the appliance log in " + folder.string() +
        " was not signed by whoever wrote it, so nothing is signed over it: 'kiroku log --verify' tells "
        "more. Any later entry of the device makes an end of it: start kirokud, then try again");
  }

  void take_back_newest() {
    looked_at = ledger->size() - 1;
    ledger->take_back(looked_at, false);
  }

  void take_back_unsigned_line() {
    if (!lacks_note()) {
      return;
    }
    try {
      take_back_newest();
    } catch (const Error&) {  // NOLINT(bugprone-empty-catch): the first error is the one to tell
    }
  }

  /// With the turn: takes in what others wrote, and puts aside what no writer of this device left. Throws
  /// where the device's own log states a key that this program does not have.
  void settle_locked() {
    ledger->catch_up();
    look_behind_locked();
    if (const std::string why = why_other_keys(); !why.empty()) throw Error(why);
    if (!device.hardware() && stated_hardware() != nullptr) {
      silence = "the program that signed was given no key in hardware";
    }
    // What was put aside nobody finds in the log any more, should this program enter nothing.
    if (!was_put_aside) return;
    try {
      state_unsigned_locked();
      was_put_aside = false;
    } catch (const Error&) {  // NOLINT(bugprone-empty-catch): the next entry states it
    }
  }

  /// Why this program must not sign in this log, whose device has other keys; "" where it may.
  [[nodiscard]] std::string why_other_keys() const {
    if (const StatedKey* const ml_dsa = other_of(ml_dsa_keys, own_keys.ml_dsa); ml_dsa != nullptr) {
      return "the appliance log in " + folder.string() + " states in its entry " +
             std::to_string(ml_dsa->entry) + " that " + device.name() +
             " signs with an ML-DSA key, too, which was not given: put device-ml-dsa.key of this home "
             "back, and start whatever runs from before it was made anew";
    }
    const StatedKey* const hardware = other_of(hardware_keys, own_keys.hardware);
    if (hardware != nullptr && device.hardware()) {
      return "the appliance log in " + folder.string() + " states in its entry " +
             std::to_string(hardware->entry) + " another key in the hardware of " + device.name() +
             " than device-hardware.json: put the file back that belongs to this home. After hardware was "
             "replaced, make a new home (docs/how-to/keep-a-key-in-hardware.md)";
    }
    return "";
  }

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
  void look_behind_locked() {
    const std::uint64_t size = ledger->size();
    looked_at = std::min(looked_at, size);
    // Lines that were signed may have become shorter, longer, or fewer.
    const bool were_others = std::exchange(was_read_anew, false) && are_others_than_signed();
    if (size == looked_at) return;
    // The home's own checkpoint may show it, too.
    bool damaged = were_others || is_damage_open() || !lacks.empty();
    std::optional<UnsignedLines> behind;
    bool is_unread = false;  // what the device signed here
    try {
      is_unread = !read_own_of_now(damaged);
      if (signed_until < size) take_remembered();
      if (signed_until < size) {
        is_unread = !read_newest_fitting() || is_unread;
        if (!why_other_keys().empty()) return;
        behind = lines_behind();
        if (were_changed(*behind)) {
          damaged = true;
          behind = lines_behind();
        }
      }
    } catch (const Error&) {
      // It keeps nobody from recording; what cannot be read is left to whoever verifies.
    }
    if (behind) {
      // Fewer were read where more zeros stand there than are read, and more where somebody adds lines now.
      behind->end = std::max(behind->end, ledger->size());
      settle(*behind, damaged, is_unread && !is_remembered_here);
    }
    looked_at = ledger->size();
  }

  /// The checkpoint of the log's size. Whether it could be looked for.
  bool read_own_of_now(bool& damaged) {
    try {
      if (const std::optional<OwnCheckpoint> own = own_checkpoint(ledger->size())) {
        damaged = damaged || own->checkpoint.root != ledger->root();
        if (own->checkpoint.root == ledger->root()) is_signed_until(ledger->size(), ledger->root());
      }
      return true;
    } catch (const Error&) {
      return false;
    }
  }

  /// The newest one that fits. Whether those could be looked at.
  bool read_newest_fitting() {
    try {
      const std::uint64_t newer = newest_fitting(signed_until, device_of_log());
      if (newer > signed_until) {
        signed_until = newer;
        signed_root.reset();
      }
      covered_until = std::max(covered_until, signed_until);
      covered_until = std::max(covered_until, newest_fitting(covered_until, by_ed25519()));
      return true;
    } catch (const Error&) {
      return false;
    }
  }

  /// Of a log that was read anew: whether the lines that were signed last, as far as it is known here, are
  /// others now. The next entry says so.
  bool are_others_than_signed() {
    if (signed_until == 0 || !signed_root) return false;
    std::optional<crypto::Sha256Digest> root;
    try {
      root = root_of_first(signed_until);
    } catch (const Error&) {
      return false;
    }
    if (root == signed_root) return false;
    state_damage(root);
    // What follows is judged from here on.
    if (!root) is_signed_until(ledger->size(), ledger->root());
    return true;
  }

  void state_damage(const std::optional<crypto::Sha256Digest>& root) {
    damage = LogDamageEntry{signed_until, *signed_root, root};
    damage_stated = std::ranges::any_of(
        stated_damages, [&](const StatedDamage& each) { return is_that_damage(each.damage); });
    remark("lines of the appliance log in " + folder.string() +
           " were changed while it was open: the first " + std::to_string(signed_until) +
           " are not those that this device signed. All stays as it is, and the log says so from now on: "
           "'kiroku log --verify' tells which checkpoint no longer fits");
    signed_root = root;
  }

  /// With the turn: what another process of this home signed is the device's, though its checkpoint is not
  /// there any more. It is put back: without it the lines count for less.
  void take_remembered() {
    const std::optional<OwnCheckpoint> known = remembered();
    is_remembered_here = known && known->checkpoint.size == signed_until &&
                         (!signed_root || known->checkpoint.root == *signed_root);
    if (!known || known->checkpoint.size <= signed_until ||
        root_of_first(known->checkpoint.size) != known->checkpoint.root) {
      return;
    }
    is_remembered_here = true;
    const std::uint64_t size = known->checkpoint.size;
    is_signed_until(size, known->checkpoint.root);
    std::string and_then = "It was put back";
    try {
      const fs::path file = folder / note_path(size);
      if (own_checkpoint(size)) return;
      reserve.write_durably(file, bytes_of(known->note));
    } catch (const Error& error) {
      and_then = std::string("It cannot be put back: ") + error.what();
    }
    remark("the checkpoint over the first " + std::to_string(size) + " entries of the appliance log in " +
           folder.string() +
           " was not there any more, though this device signed it: somebody took it away. " + and_then);
  }

  [[nodiscard]] UnsignedLines lines_behind() const {
    // Whoever can write to the archive opens as many cases there as they like. So many never begin between
    // two checkpoints, and the log is read once for all of them.
    constexpr int kMostCases = 1024;
    int looked_for = 0;
    std::map<std::uint64_t, std::vector<crypto::Sha256Digest>> went_on_from;
    UnsignedLines lines = unsigned_lines(files, ledger->file(), signed_until, keys_of_lines(), damage,
                                         [&](const CaseOpenedEntry& opened) {
                                           if (++looked_for > kMostCases) return false;
                                           const CaseBegin begin = begin_of_case_here(opened);
                                           if (begin.log)
                                             went_on_from[begin.log->size].push_back(begin.log->root);
                                           return begin.is_here;
                                         });
    if (lines.opens_here || went_on_from.empty()) return lines;
    std::vector<std::uint64_t> sizes;
    for (const auto& [size, root] : went_on_from) sizes.push_back(size);
    const std::vector<crypto::Sha256Digest> roots = roots_of_lines(files, ledger->file(), sizes);
    for (std::size_t at = 0; at < roots.size(); ++at) {
      const std::vector<crypto::Sha256Digest>& stated = went_on_from.at(sizes[at]);
      lines.opens_here = lines.opens_here || std::ranges::find(stated, roots[at]) != stated.end();
    }
    return lines;
  }

  void is_signed_until(std::uint64_t size, const std::optional<crypto::Sha256Digest>& root) {
    signed_until = covered_until = size;
    signed_root = root;
  }

  /// Somebody may change lines while the log is open, and add one: what would be cut off and signed then were
  /// the changed lines. They are read anew, and the next entry says that they are others.
  bool were_changed(const UnsignedLines& behind) {
    if (!signed_root) signed_root = behind.root_before;
    if (!signed_root || behind.root_before == signed_root) {
      // Another program found it, and stated and signed it: what is signed here must go on from that.
      if (behind.end != ledger->size() || behind.root == ledger->root()) return false;
      ledger->read_again();
      return true;
    }
    state_damage(behind.root_before);
    ledger->read_again();
    return true;
  }

  /// `is_unread`: the device may have signed more than is known here.
  void settle(const UnsignedLines& behind, bool damaged, bool is_unread) {
    if (is_unread) {
      // It is neither cut off nor taken for the device's.
      if (behind.foreign || (!damaged && behind.demanding > 0)) leave_unsigned(behind.end);
      return;
    }
    bool left = false;
    std::uint64_t demanding = behind.demanding, end = behind.end;
    if (behind.foreign) {
      // Whose log it is nobody knows then: another device's, or its checkpoints were taken away.
      const bool is_anothers = signed_until == 0;
      if (!damaged && !is_anothers && !behind.opens_here &&
          put_aside(behind.foreign->number, behind.foreign->offset)) {
        end = behind.foreign->number;
      } else {
        left = true;
        demanding += behind.demanding_behind;
      }
    }
    if (!damaged && !left && demanding == 1) {
      if (behind.first->kind == UnsignedLine::Kind::kStatement)
        take_back_from(*behind.first, end - behind.first->number);
      return;
    }
    if (left || (!damaged && demanding > 1)) leave_unsigned(end);
  }

  void leave_unsigned(std::uint64_t end) {
    unstated.push_back({found_deed(signed_until, end - 1), {}});
    remark(
        "the entries from " + std::to_string(signed_until) + " to " + std::to_string(end - 1) +
        " of the appliance log in " + folder.string() +
        " have no checkpoint of this device that can be read: somebody added them, or took checkpoints away. "
        "They are left where they are, and the log says so from now on");
  }

  /// A crash leaves one line without its checkpoint. Of a disk without room for the copy it is taken back all
  /// the same, if it is the last.
  void take_back_from(const UnsignedLine& line, std::uint64_t lines) {
    try {
      set_aside_with_room(line.number, line.offset, Telling::kNone);
    } catch (const IoError&) {
      if (lines > 1) {
        unstated.push_back({found_deed(line.number, line.number + lines - 1), {}});
        return;
      }
    }
    ledger->take_back(line.number, true);
  }

  /// Lines from number `seq` on, at byte `offset`; false where they cannot be kept elsewhere.
  bool put_aside(std::uint64_t seq, std::uint64_t offset) {
    if (!keep_aside(seq, offset)) return false;
    ledger->take_back(seq, true);
    return true;
  }

  bool keep_aside(std::uint64_t seq, std::uint64_t offset) {
    try {
      const SetAside kept = set_aside_with_room(seq, offset, Telling::kFollows);
      // Of what whoever adds lines all the time has put aside, the next start tells the rest.
      constexpr std::size_t kMostUnstated = 64;
      if (unstated.size() < kMostUnstated) unstated.push_back({set_aside_deed(seq, kept), kept});
      was_put_aside = true;
      remark(
          "lines stood in the appliance log from entry " + std::to_string(seq) +
          " on that this device did not write: whoever can write to the archive's disk put them there. They "
          "count for nothing, and " +
          (kept.kept == kept.stood ? std::string("lie in ")
                                   : "the first " + std::to_string(kept.kept) + " of " +
                                         std::to_string(kept.stood) + " bytes, without holes, lie in ") +
          kept.file.string() + " now: keep that file, and find out who writes there");
      return true;
    } catch (const IoError& error) {
      remark("lines stand in the appliance log from entry " + std::to_string(seq) +
             " on that this device did not write, and they cannot be put aside: " + error.what());
      return false;
    }
  }

  /// Of a line that is too long or holds a zero byte, and of what stands behind it, while lines are read.
  Ledger::Aside put_no_entry_aside(std::uint64_t seq, std::uint64_t offset, const Ledger::Replace& replace) {
    if (const std::uint64_t covered = covered_size(); covered > seq)
      return replace ? mark_changed(seq, offset, covered, replace) : Ledger::Aside::kStays;
    cut_off_no_entry(seq, offset);
    return Ledger::Aside::kMayGo;
  }

  void cut_off_no_entry(std::uint64_t seq, std::uint64_t offset) {
    if (keep_aside(seq, offset)) return;
    // Nothing could be written behind it, and it is no entry.
    remark(
        "that line is longer than any entry, or holds a zero byte as none does, so it was cut off all the "
        "same");
  }

  /// Lines that the device signed, and that no reader would get beyond: they are kept elsewhere, with a mark
  /// in the place of each. All other lines stay, under their numbers.
  Ledger::Aside mark_changed(std::uint64_t seq, std::uint64_t offset, std::uint64_t covered,
                             const Ledger::Replace& replace) {
    const fs::path file = folder / kLedgerFile;
    ChangedAside changed;
    try {
      with_room(offset, [&] {
        changed = set_changed_aside(files, file, seq, offset, covered, folder.parent_path());
      });
    } catch (const Error& error) {
      remark("lines of the appliance log in " + folder.string() + " from entry " + std::to_string(seq) +
             " on, which this device signed, are no entries any more, and nothing can be entered: the lines "
             "behind them cannot be copied: " +
             error.what());
      return Ledger::Aside::kStays;
    }
    if (changed.rest) cut_off_no_entry(changed.rest->number, changed.rest->offset);
    if (changed.lines > 0) {
      unstated.push_back({changed_deed(seq, changed), changed.kept});
      was_put_aside = true;
    }
    std::string and_then = changed.lines > 0 ? ": keep that file" : "";
    try {
      reserve.support([&] { replace(files.open_to_read(changed.instead)); });
      files.remove(changed.instead);
    } catch (const SyncError&) {
      throw;
    } catch (const Error& error) {
      and_then = ", and the lines behind them in " + changed.instead.string() +
                 ", as not all of them could be written back (" + error.what() + "): keep " +
                 (changed.lines > 0 ? "both files" : "that file");
    }
    if (changed.lines == 0) {
      remark("entry " + std::to_string(seq) + " of the appliance log in " + folder.string() +
             ", which this device had signed, had lost its end on the disk: what is left of it stays, as a "
             "line" +
             and_then + ". Find out who writes there");
      return Ledger::Aside::kReplaced;
    }
    remark(std::to_string(changed.lines) + (changed.lines == 1 ? " line" : " lines") +
           " of the appliance log in " + folder.string() + ", from entry " + std::to_string(seq) +
           " on, which this device had signed, became longer than any entry, or zeros: somebody changed them "
           "on the disk. In the place of each stands a mark now, and what stood there lies in " +
           changed.kept.file.string() + and_then +
           ", put back a copy of the log that holds, and find out who writes there");
    return Ledger::Aside::kReplaced;
  }

  /// Whoever fills the disk does not keep what they added in the log: the reserve has room for a copy of it,
  /// unless it is long.
  SetAside set_aside_with_room(std::uint64_t seq, std::uint64_t offset, Telling telling) {
    const fs::path file = folder / kLedgerFile;
    SetAside kept;
    with_room(offset, [&] { kept = set_aside(files, file, seq, offset, folder.parent_path(), telling); });
    return kept;
  }
  void with_room(std::uint64_t offset, const std::function<void()>& write) {
    constexpr std::uint64_t kShort = 1U << 18U;
    // Holes take none.
    if (bytes_to_keep(files, folder / kLedgerFile, offset) <= kShort) {
      reserve.support(write);
    } else {
      write();
    }
  }

  struct LogState {
    std::uint64_t size = 0;
    crypto::Sha256Digest root{};
  };
  /// What of a case is known of a line that opens it.
  struct CaseBegin {
    bool is_here = false;
    std::optional<LogState> log;  // it is here if the log went on from this
  };

  /// Whether the case that was opened so lies in the archive, is this device's, and began beside this log:
  /// its line is not put aside. The device signed it: whoever can write to the archive makes a folder that
  /// fits any line.
  [[nodiscard]] CaseBegin begin_of_case_here(const CaseOpenedEntry& opened) const {
    try {
      const fs::path case_folder = folder.parent_path() / opened.case_id;
      if (!files.is_folder(case_folder)) return {};
      const std::vector<OwnCheckpoint> notes = own_notes_of_case(case_folder, opened.case_id);
      if (notes.empty()) return {};
      const auto line = first_whole_line(files.open_to_read(case_folder / kLedgerFile));
      if (!line || crypto::sha256(bytes_of(*line)) != opened.sha256) return {};
      const EntryParse first = parse_case_entry(*line);
      const auto* const open = first.entry ? std::get_if<OpenEntry>(&first.entry->body) : nullptr;
      if (open == nullptr || open->case_id != opened.case_id || open->device != own_keys.device ||
          !is_any_over_its_lines(notes, case_folder)) {
        return {};
      }
      if (open->appliance_log_size == 0) return {true, {}};  // every log goes on from none
      return {false, LogState{open->appliance_log_size, open->appliance_log_root}};
    } catch (const IoError& error) {
      return {!is_cause_in_the_folder(error.error_number()), {}};
    } catch (const Error&) {
      return {};
    }
  }

  /// Whoever can write to the archive brings these about there. Any other error shows nothing of the case.
  [[nodiscard]] static bool is_cause_in_the_folder(int error) {
    constexpr std::array kCauses{
        ENOENT, ENOTDIR, EISDIR,    ELOOP,        EACCES,     EPERM,
        ENXIO,  EINVAL,  EOVERFLOW, ENAMETOOLONG, EWOULDBLOCK};  // of a lease, the last
    return std::ranges::find(kCauses, error) != kCauses.end();
  }

  /// The newest checkpoints in the case's folder that the device signed for it, whatever its lines are.
  [[nodiscard]] std::vector<OwnCheckpoint> own_notes_of_case(const fs::path& case_folder,
                                                             const std::string& case_id) const {
    constexpr std::size_t kMostNotes = 64, kMostLookedAt = 256;
    if (!files.is_folder(case_folder / kCheckpointsFolder)) return {};
    std::size_t looked_at_notes = 0;
    const std::string origin = case_origin(device.name(), case_id);
    const std::vector<std::uint64_t> sizes = note_sizes_in(files, case_folder);
    std::vector<OwnCheckpoint> notes;
    for (auto size = sizes.rbegin(); size != sizes.rend() && notes.size() < kMostNotes; ++size) {
      // Files that are none cost whoever puts them there nothing.
      if (++looked_at_notes > kMostLookedAt) break;
      std::optional<std::string> note;
      try {
        note = read_small(files.open_to_read(case_folder / note_path(*size)), kMaximumNoteBytes);
      } catch (const IoError& error) {
        if (!is_cause_in_the_folder(error.error_number())) throw;
      } catch (const Error&) {  // NOLINT(bugprone-empty-catch): no regular file, so no note
      }
      const std::optional<crypto::Checkpoint> text = note ? text_of_note(*note) : std::nullopt;
      if (!text || text->origin != origin || text->size != *size ||
          crypto::open_note(*note, {by_ed25519()}).failure) {
        continue;
      }
      notes.push_back({*text, std::move(*note)});
    }
    std::ranges::reverse(notes);
    return notes;
  }

  /// `notes` by size.
  [[nodiscard]] bool is_any_over_its_lines(const std::vector<OwnCheckpoint>& notes,
                                           const fs::path& case_folder) const {
    std::vector<std::uint64_t> sizes;
    for (const OwnCheckpoint& each : notes) sizes.push_back(each.checkpoint.size);
    const std::vector<crypto::Sha256Digest> roots = roots_of_lines(files, case_folder / kLedgerFile, sizes);
    for (std::size_t at = 0; at < roots.size(); ++at)
      if (notes[at].checkpoint.root == roots[at]) return true;
    return false;
  }

  /// Whether lines are others than those that were signed, and the log does not say so yet.
  [[nodiscard]] bool is_damage_open() const {
    return damage && std::ranges::none_of(stated_damages, [&](const StatedDamage& each) {
             return each.entry < signed_until && is_that_damage(each.damage);
           });
  }

  [[nodiscard]] bool is_that_damage(const LogDamageEntry& stated) const {
    // Where lines were cut off, there may be so many again meanwhile.
    return stated.size == damage->size && stated.stated_root == damage->stated_root &&
           (!stated.root || stated.root == damage->root);
  }

  /// Of the lines of this log: of keys that this program does not have those for which the device stands.
  [[nodiscard]] LogKeys keys_of_lines() const {
    LogKeys keys = own_keys;
    if (const StatedKey* const hardware = stated_hardware(); hardware != nullptr && keys.hardware.empty()) {
      keys.hardware = hardware->key;
    }
    if (const StatedKey* const attestation = stated_attestation(); attestation != nullptr) {
      keys.attestation = attestation->key;
    }
    return keys;
  }

  void remark(const std::string& sentence) {
    // Whoever adds lines all the time fills no memory.
    constexpr std::size_t kMostRemarks = 16;
    if (remarks.size() == kMostRemarks) return;
    remarks.push_back(sentence);
    if (!tell) return;
    tell(sentence);
    handed_out = remarks.size();
  }

  /// Until the log states the device's ML-DSA key, the device signed by Ed25519 alone.
  [[nodiscard]] crypto::VerifierKey device_of_log() const {
    if (!device.ml_dsa()) return device;
    const StatedKey* const own = own_of(ml_dsa_keys, own_keys.ml_dsa);
    return device.with_ml_dsa(*device.ml_dsa(),
                              own != nullptr ? own->entry : std::numeric_limits<std::uint64_t>::max());
  }
  /// Whatever other keys it has: a note with the line of another key in the device's name is none by all of
  /// its keys, and what that key signed is the device's all the same.
  [[nodiscard]] crypto::VerifierKey by_ed25519() const { return {device.name(), key.public_key()}; }
  [[nodiscard]] std::optional<OwnCheckpoint> own_checkpoint(std::uint64_t size) const {
    return checkpoint_of(folder, device_of_log(), size, files);
  }

  /// With the turn: the newest checkpoint of this device's. Whoever puts other files there, of whatever size,
  /// or lines behind it, however many, does not hide it.
  [[nodiscard]] std::optional<OwnCheckpoint> newest_own_checkpoint() const {
    const std::vector<std::uint64_t> sizes = note_sizes_in(files, folder);
    for (auto size = sizes.rbegin(); size != sizes.rend(); ++size) {
      if (std::optional<OwnCheckpoint> own = own_checkpoint(*size)) return own;
    }
    return std::nullopt;
  }

  [[nodiscard]] std::uint64_t newest_own_size() const {
    const std::optional<OwnCheckpoint> newest = newest_own_checkpoint();
    return newest ? newest->checkpoint.size : 0;
  }

  /// With the turn: how many lines the device signed, as far as anybody knows here, whether they are those
  /// that stand there or not, and whether its checkpoint is there still. Where the checkpoints cannot be
  /// read, and the home remembers none, it may be any line.
  [[nodiscard]] std::uint64_t covered_size() const {
    const std::optional<OwnCheckpoint> known = remembered();
    const std::uint64_t here = std::max({known ? known->checkpoint.size : 0, kept_size, signed_until});
    try {
      return std::max(newest_own_size(), here);
    } catch (const Error&) {
      return known ? here : Ledger::kNobodyKnows;
    }
  }

  /// What a process of this home signed last.
  [[nodiscard]] std::optional<OwnCheckpoint> remembered() const {
    const std::optional<std::string> note = memory.newest ? memory.newest() : std::nullopt;
    return note ? as_own(*note, device_of_log()) : std::nullopt;
  }

  /// With the turn: how many lines the newest checkpoint of this device's covers that is over the lines which
  /// are there; 0 if none is over more than `known`.
  [[nodiscard]] std::uint64_t newest_fitting(std::uint64_t known, const crypto::VerifierKey& by) const {
    std::vector<std::uint64_t> sizes = note_sizes_in(files, folder);
    std::erase_if(sizes, [&](std::uint64_t size) { return size <= known || size > ledger->size(); });
    return sizes.empty() ? 0 : newest_that_fits(files, folder, by, sizes);
  }

  /// The root of the first `size` lines; nothing where there are fewer.
  [[nodiscard]] std::optional<crypto::Sha256Digest> root_of_first(std::uint64_t size) const {
    if (size == ledger->size()) return ledger->root();
    if (size > ledger->size()) return std::nullopt;
    const std::vector<crypto::Sha256Digest> roots = roots_of_lines(files, ledger->file(), {size});
    return roots.empty() ? std::nullopt : std::optional(roots.front());
  }

  /// With the turn, of a log that was just opened. A checkpoint that cannot be read is left to whoever
  /// verifies: it keeps nobody from recording.
  void compare_locked(const std::optional<crypto::Checkpoint>& expected) {
    try {
      std::optional<OwnCheckpoint> newest;
      try {
        newest = newest_own_checkpoint();
      } catch (const Error&) {  // NOLINT(bugprone-empty-catch): what was kept elsewhere tells, too
      }
      std::optional<crypto::Sha256Digest> root;
      if (newest) {
        root = root_of_first(newest->checkpoint.size);
        if (root != newest->checkpoint.root) {
          damage = LogDamageEntry{newest->checkpoint.size, newest->checkpoint.root, root};
          damage_stated = std::ranges::any_of(
              stated_damages, [&](const StatedDamage& each) { return is_that_damage(each.damage); });
        } else {
          is_signed_until(newest->checkpoint.size, root);
        }
        newest_note_text = std::move(newest->note);
      }
      if (expected && expected->size > 0) {
        const bool is_newest = newest && newest->checkpoint.size == expected->size;
        const auto kept_root = is_newest ? root : root_of_first(expected->size);
        lacks = what_lacks(*expected, kept_root);
        // As if its note lay here still.
        if (lacks.empty() && expected->size > signed_until) is_signed_until(expected->size, kept_root);
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
  /// shows that lines were changed, and so is what cannot be read. Whoever can write to the archive may have
  /// made the folder one that nobody can write to: that keeps nobody from recording.
  bool checkpoint_locked() {
    try {
      try {
        return write_checkpoint();
      } catch (const IoError& error) {
        if (error.error_number() != ENOENT) throw;
        make_folder_unless_there(files, folder / kCheckpointsFolder);
        return write_checkpoint();
      }
    } catch (const SyncError&) {
      throw;
    } catch (const IoError& error) {
      if (!is_cause_in_the_folder(error.error_number())) throw;
      if (!std::exchange(is_unsignable_told, true)) {
        remark("the checkpoints of the appliance log in " + folder.string() +
               " cannot be written, so its entries are not signed from now on: " + error.what() +
               ". Find out who changed that folder");
      }
      return false;
    }
  }

  bool write_checkpoint() {
    const crypto::Checkpoint text{log_origin(device.name()), ledger->size(), ledger->root()};
    const fs::path file = folder / note_path(text.size);
    keys_unsigned = false;
    if (text.size == 0) {
      return true;
    }
    if (files.exists(file)) {
      try {
        if (files.is_folder(file)) {
          return false;
        }
        if (const std::optional<OwnCheckpoint> there = own_checkpoint(text.size)) {
          if (there->checkpoint != text) return false;
          is_signed_until(text.size, text.root);
          if (memory.keep) memory.keep(there->note);
          return true;
        }
      } catch (const Error&) {
        return false;
      }
    }
    crypto::SignedNote written = crypto::sign_note_by_all(text.to_text(), device.name(), key);
    reserve.write_durably(file, bytes_of(written.note));
    is_signed_until(text.size, text.root);
    if (memory.keep) {
      memory.keep(written.note);
    }
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
  FileSystem& files;
  fs::path folder;
  const crypto::SigningKey& key;
  crypto::VerifierKey device;
  SpaceReserve reserve;
  std::string boot_id;  // of this machine, as far as known
  LogKeys own_keys;     // of what this program was given
  // What the log states, whoever wrote it:
  std::string newest_boot_id, newest_device;
  std::int64_t newest_mono_ns = 0;
  std::vector<StatedKey> ml_dsa_keys, hardware_keys, attestation_keys;  // since it names that device
  struct StatedDamage {
    std::uint64_t entry = 0;
    LogDamageEntry damage;
  };
  std::vector<StatedDamage> stated_damages;
  struct Found {
    std::uint64_t entry = 0;
    Entries entries;
  };
  std::vector<Found> found;  // entries over which the device found no signature
  // As of disowned():
  mutable std::optional<NumberSet> disowned_set;
  mutable std::size_t disowned_by = 0;  // so many of `found`
  bool keys_unsigned = false;           // lines that state own keys were written, and no checkpoint yet
  std::string not_attested;             // why the TPM did not quote when its attestation key was to be stated
  std::string silence;                  // why the newest checkpoint lacks the line by hardware
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
  std::unordered_map<std::string, CaseState> cases;
  Signing newest_signing = Signing::kNone;  // of the newest line
  /// So many lines a checkpoint of this device's covers that fits them, as far as known.
  std::uint64_t signed_until = 0;
  std::optional<crypto::Sha256Digest> signed_root;  // of these lines, once it is known
  std::uint64_t covered_until = 0;                  // the same by Ed25519, whatever its other keys signed
  /// So many lines were looked at, or written here. Should a note of them vanish now, nothing is cut off.
  std::uint64_t looked_at = 0;
  std::unique_ptr<Ledger> ledger;
  std::mutex mutex;
};

ApplianceLog::ApplianceLog(std::unique_ptr<State> state) : state_(std::move(state)) {}
ApplianceLog::~ApplianceLog() = default;
const fs::path& ApplianceLog::folder() const { return state_->folder; }

std::unique_ptr<ApplianceLog> ApplianceLog::open(FileSystem& files, const fs::path& folder,
                                                 const crypto::SigningKey& key,
                                                 const std::string& device_name,
                                                 const std::optional<crypto::Checkpoint>& expected,
                                                 LogMemory memory) {
  auto state = std::make_unique<State>(files, folder, key, device_name);
  state->memory = std::move(memory);
  state->kept_size = expected ? expected->size : 0;
  make_folder_unless_there(files, folder);
  make_folder_unless_there(files, folder / kCheckpointsFolder);
  state->ledger = Ledger::open(
      files, folder / kLedgerFile, Ledger::Sharing::kShared, &state->reserve,
      [&log = *state](std::uint64_t seq, std::string_view line) { log.look_at(seq, line); },
      [&log = *state] { return log.covered_size(); }, {},
      [&log = *state](std::uint64_t seq, std::uint64_t offset, const Ledger::Replace& replace) {
        return log.put_no_entry_aside(seq, offset, replace);
      });
  state->ledger->when_read_anew([&log = *state] { log.was_read_anew = true; });
  const Ledger::Turn turn(*state->ledger);
  state->ledger->catch_up();
  state->compare_locked(expected);
  state->settle_locked();
  state->take_up_untold_locked();
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

std::vector<std::string> ApplianceLog::remarks() const {
  const std::lock_guard guard(state_->mutex);
  state_->handed_out = state_->remarks.size();
  return state_->remarks;
}

void ApplianceLog::tell_of_remarks(std::function<void(const std::string& remark)> tell) {
  const std::lock_guard guard(state_->mutex);
  state_->tell = std::move(tell);
  for (; state_->tell && state_->handed_out < state_->remarks.size(); ++state_->handed_out)
    state_->tell(state_->remarks[state_->handed_out]);
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
    const bool all_stated = (!device.ml_dsa() || state_->stated_ml_dsa() != nullptr) &&
                            (!device.hardware() || state_->stated_hardware() != nullptr) &&
                            !state_->lacks_attestation();
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
  if (const auto* ml_dsa = state_->stated_ml_dsa()) stated.ml_dsa = ml_dsa->entry;
  if (const auto* hardware = state_->stated_hardware()) stated.hardware = hardware->entry;
  if (const auto* attestation = state_->stated_attestation()) stated.attestation = attestation->entry;
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

std::uint64_t newest_signed_size(const fs::path& folder, const crypto::VerifierKey& device) {
  const std::vector<std::uint64_t> sizes = note_sizes_in(real_reading(), folder);
  for (auto size = sizes.rbegin(); size != sizes.rend(); ++size) {
    if (checkpoint_of(folder, device, *size, real_reading())) return *size;
  }
  return 0;
}

std::optional<DamageClaim> first_that_stands(const fs::path& folder, const crypto::VerifierKey& device,
                                             std::span<const DamageClaim> claims) {
  if (claims.empty()) return std::nullopt;
  const FileReading& files = real_reading();
  std::vector<std::uint64_t> sizes = note_sizes_in(files, folder);
  std::erase_if(sizes, [&](std::uint64_t size) { return size > claims.back().entry; });
  const std::vector<crypto::Sha256Digest> roots = roots_of_lines(files, folder / kLedgerFile, sizes);
  // Of those before the next claim the ones that may fit still: each note is opened once, and what does not
  // fit is never asked again. Whoever makes thousands of claims and notes makes nobody look at each pair.
  struct Candidate {
    std::size_t at = 0;
    bool fits = false;
  };
  std::vector<Candidate> before;
  std::size_t next = 0;
  for (const DamageClaim& claim : claims) {
    for (; next < roots.size() && sizes[next] <= claim.entry; ++next) before.push_back({next, false});
    bool refuted = false;
    while (!refuted && !before.empty() && sizes[before.back().at] >= claim.size) {
      Candidate& newest = before.back();
      newest.fits = newest.fits ||
                    checkpoint_of(folder, device, sizes[newest.at], files, &roots[newest.at]).has_value();
      refuted = newest.fits;
      if (!refuted) before.pop_back();
    }
    if (!refuted) return claim;
  }
  return std::nullopt;
}

std::vector<LogLine> read_log(const fs::path& folder) {
  std::vector<LogLine> lines;
  for_each_log_line(folder, [&](const LogLine& line) { lines.push_back(line); });
  return lines;
}

}  // namespace kiroku::archive

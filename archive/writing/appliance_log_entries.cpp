#include <algorithm>
#include <chrono>
#include <unordered_set>
#include <utility>

#include "archive/format/boot_quote.h"
#include "archive/format/case_layout.h"
#include "archive/writing/appliance_log_state.h"
#include "archive/writing/log_deeds.h"
#include "archive/writing/log_reading.h"
#include "base/error.h"

namespace kiroku::archive {

namespace {

Moment machine_now() {
  const auto since_boot = std::chrono::steady_clock::now().time_since_epoch();
  return {utc_now(), std::chrono::duration_cast<std::chrono::nanoseconds>(since_boot).count()};
}

}  // namespace

const crypto::BootAttester* ApplianceLog::State::attester() const {
  return key.hardware() == nullptr ? nullptr : key.hardware()->attester();
}

bool ApplianceLog::State::lacks_attestation() const {
  return attester() != nullptr && in_log.attestation() == nullptr;
}

crypto::BootAttester::Answer ApplianceLog::State::quote(const crypto::BootAttester& asked,
                                                        std::uint64_t size) const {
  return asked.quote(qualifying_data({device.to_string(), size, ledger->root(), boot_id}));
}

BootEntry ApplianceLog::State::boot_entry(std::uint64_t size) const {
  BootEntry boot{boot_id, device.to_string()};
  const StatedInLog::StatedKey* const stated = in_log.attestation();
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

void ApplianceLog::State::state_attestation_locked() {
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

void ApplianceLog::State::append_locked(const std::optional<LogEntryBody>& body) {
  state_unsigned_locked();
  if (lacks_attestation() && not_attested.empty()) {
    // Its quote is bound to all before it.
    append_lines_locked(std::nullopt);
    state_attestation_locked();
  }
  append_lines_locked(body);
}

void ApplianceLog::State::state_unsigned_locked() {
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

void ApplianceLog::State::told_of(const SetAside& kept) {
  try {
    name_as_told(files, kept);
  } catch (const IoError&) {  // NOLINT(bugprone-empty-catch): the next start finds the entry and the file
  }
}

void ApplianceLog::State::take_up_untold_locked() {
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

std::vector<UntoldAside> ApplianceLog::State::without_told(std::vector<UntoldAside> untold) {
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

void ApplianceLog::State::append_lines_locked(const std::optional<LogEntryBody>& body) {
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
      throw LedgerHeldError("somebody writes into " + ledger->file().string() +
                            " all the time without waiting for a turn, so nothing was entered. Find out who "
                            "writes to the archive's disk");
    }
    look_behind_locked();
  }
  looked_at = ledger->size();
  silence_stated = !silence.empty();
  damage_stated = damage.has_value();
}

std::vector<std::string> ApplianceLog::State::lines_before(std::uint64_t size,
                                                           const std::optional<LogEntryBody>& body) {
  const Moment now = machine_now();
  std::vector<LogEntryBody> bodies;
  // A line of somebody else may name another device, or a later moment of this boot's clock.
  if (in_log.newest_boot_id() != boot_id || in_log.newest_device() != own_keys.device ||
      in_log.newest_mono_ns() > now.mono_ns) {
    bodies.emplace_back(boot_entry(size));
  }
  if (device.ml_dsa() && (in_log.ml_dsa() == nullptr || in_log.newest_device() != own_keys.device)) {
    bodies.emplace_back(DeviceMlDsaEntry{own_keys.ml_dsa});
  }
  if (device.hardware() && (in_log.hardware() == nullptr || in_log.newest_device() != own_keys.device)) {
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

void ApplianceLog::State::append(const std::optional<LogEntryBody>& body) {
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

std::uint64_t ApplianceLog::State::append_and_checkpoint(const LogEntryBody& body) {
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

bool ApplianceLog::State::is_statement(const LogEntryBody& body) {
  return std::holds_alternative<CaseHeldEntry>(body) || std::holds_alternative<CaseReleasedEntry>(body) ||
         std::holds_alternative<ConsentGivenEntry>(body) ||
         std::holds_alternative<ConsentWithdrawnEntry>(body) || std::holds_alternative<CaseErasedEntry>(body);
}

bool ApplianceLog::State::lacks_note() const {
  try {
    return !own_checkpoint(ledger->size());
  } catch (const Error&) {
    return false;
  }
}

void ApplianceLog::State::require_no_unsigned_statement() const {
  if (ledger->size() == 0 || in_log.newest_signing() == StatedInLog::Signing::kNone || !lacks_note()) {
    return;
  }
  throw Error(
      "the newest entry of the appliance log in " + folder.string() +
      " was not signed by whoever wrote it, so nothing is signed over it: 'kiroku log --verify' tells "
      "more. Any later entry of the device makes an end of it: start kirokud, then try again");
}

void ApplianceLog::State::take_back_newest() {
  looked_at = ledger->size() - 1;
  ledger->take_back(looked_at, false);
}

void ApplianceLog::State::take_back_unsigned_line() {
  if (!lacks_note()) {
    return;
  }
  try {
    take_back_newest();
  } catch (const Error&) {  // NOLINT(bugprone-empty-catch): the first error is the one to tell
  }
}

}  // namespace kiroku::archive

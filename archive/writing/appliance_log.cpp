#include "archive/writing/appliance_log.h"

#include <fstream>
#include <utility>

#include "archive/format/case_layout.h"
#include "archive/writing/appliance_log_state.h"
#include "base/error.h"
#include "crypto/encoding.h"

namespace kiroku::archive {

namespace fs = std::filesystem;

namespace {

void check_case_id(const std::string& case_id) {
  if (!is_case_id(case_id)) {
    throw UsageError("\"" + case_id + "\" is no case identifier such as 20260805T091502Z-3f9c21ab");
  }
}

LogKeys keys_of(const crypto::VerifierKey& device, const crypto::BootAttester* attester) {
  LogKeys keys{device.to_string(), {}, {}, {}};
  if (device.ml_dsa()) keys.ml_dsa = device.ml_dsa()->to_string();
  if (device.hardware()) keys.hardware = device.hardware()->to_string();
  if (attester != nullptr) {
    keys.attestation = crypto::to_base64(attester->public_area(), crypto::Base64Padding::kPadded);
  }
  return keys;
}

}  // namespace

void make_folder_unless_there(FileSystem& files, const fs::path& folder) {
  if (!files.exists(folder)) {
    files.make_folder(folder);
    files.sync_folder(folder.parent_path());
  }
}

ApplianceLog::State::State(FileSystem& the_files, fs::path the_folder, const crypto::SigningKey& the_key,
                           const std::string& name)
    : files(the_files),
      folder(std::move(the_folder)),
      key(the_key),
      device(crypto::verifier_key_of(name, the_key)),
      reserve(the_files, reserve_file(folder.parent_path())),
      boot_id(kernel_boot_id()),
      own_keys(keys_of(device, attester())),
      in_log(own_keys) {}

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
      [&log = *state](std::uint64_t seq, std::string_view line) { log.in_log.look_at(seq, line); },
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
    const bool all_stated = (!device.ml_dsa() || state_->in_log.ml_dsa() != nullptr) &&
                            (!device.hardware() || state_->in_log.hardware() != nullptr) &&
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
  if (const auto* ml_dsa = state_->in_log.ml_dsa()) stated.ml_dsa = ml_dsa->entry;
  if (const auto* hardware = state_->in_log.hardware()) stated.hardware = hardware->entry;
  if (const auto* attestation = state_->in_log.attestation()) stated.attestation = attestation->entry;
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
  return state_->in_log.case_state(case_id);
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

}  // namespace kiroku::archive

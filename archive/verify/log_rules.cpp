#include "archive/verify/log_rules.h"

#include <algorithm>
#include <utility>

#include "archive/format/case_layout.h"
#include "archive/format/consent_layout.h"
#include "archive/verify/folder_names.h"
#include "archive/verify/log_histories.h"
#include "base/error.h"
#include "base/number_text.h"

namespace kiroku::archive {

namespace {

template <typename... Functions>
struct Overloaded : Functions... {
  using Functions::operator()...;
};
template <typename... Functions>
Overloaded(Functions...) -> Overloaded<Functions...>;

// A log gets a few entries a minute; these are those that came while it was read, or from when a case was
// being opened until the log had its line.
constexpr std::size_t kMostRecent = 64;

std::string at_entry(std::uint64_t number) { return "entry " + std::to_string(number); }

Place in_ledger(std::uint64_t number, std::optional<std::uint64_t> offset = std::nullopt) {
  return {std::string(kLedgerFile), number, offset};
}

/// Beside a case.
Place in_log(std::optional<std::uint64_t> number = std::nullopt) {
  return {"log/" + std::string(kLedgerFile), number, std::nullopt, true};
}

bool is_among(const std::vector<crypto::VerifierKey>& devices, const crypto::VerifierKey& key) {
  return std::ranges::find(devices, key) != devices.end();
}

}  // namespace

bool is_one_device(const NamedDevice& one, const NamedDevice& other) {
  return one.text == other.text || (one.key && other.key && *one.key == *other.key);
}

LogWalk::LogWalk(const CaseFolder& folder, const VerifyOptions& options, FindingList& findings,
                 const std::optional<OpenEntry>& of_case, FindingList* of_cases)
    : folder_(&folder),
      options_(&options),
      findings_(&findings),
      of_cases_(of_cases != nullptr ? of_cases : &findings),
      case_id_(of_case ? of_case->case_id : std::string()),
      case_device_(of_case ? of_case->device : std::string()),
      head_(of_case ? of_case->appliance_log_size : 0),
      listing_(folder.list()),
      checkpoints_(folder, options, findings, note_sizes(listing_)),
      consents_(folder, *of_cases_),
      boots_(findings, !of_case) {
  try {
    if (!case_device_.empty()) {
      signs_case_ = known_device(crypto::VerifierKey::parse(case_device_), options.devices);
      trusts_case_device_ = is_among(options.devices, *signs_case_);
    }
  } catch (const UsageError&) {  // NOLINT(bugprone-empty-catch): who walks the case says that it names none
  }
}

LogContents LogWalk::run() {
  const FileOpening opening = folder_->open_file(kLedgerFile);
  if (!opening.file) {
    throw UsageError(folder_->path().string() + " is no appliance log: its " + std::string(kLedgerFile) +
                     " " + opening.explanation + "; give the folder of the log");
  }
  if (head_ == 0) {
    contents_.root_at_head = tree_.root();
  }
  const auto fits = [&](const crypto::Sha256Digest& root) { return root == tree_.root(); };
  LineReader reader(*opening.file);
  LedgerLine line;
  bool tree_known = true;
  if (outside_ != nullptr) {
    outside_->reached(0, fits, tree_known);
  }
  while (reader.next(line)) {
    if (line.torn) {
      findings_->add("log-tail-not-covered", in_ledger(tree_.size(), line.offset),
                     "the last line of the log is not whole: a write that did not finish");
      break;
    }
    const std::uint64_t number = tree_.size();
    const LogEntryParse parse = line.too_long ? LogEntryParse{} : parse_log_entry(line.text);
    std::optional<crypto::Sha256Digest> root_before;
    if (tree_known && parse.entry && BootRules::quotes(parse.entry->body)) {
      root_before = tree_.root();
    }
    const crypto::Sha256Digest leaf = crypto::merkle_leaf_hash(bytes_of(line.text));
    tree_.append(leaf);
    tree_known = tree_known && !line.too_long;
    if (tree_known && signs_case_ && signs_case_->hardware_since() == tree_.size() &&
        signs_case_->log_root_before_hardware() == tree_.root()) {
      from_before_hardware_ = tree_.size();
    }
    if (kept_ != nullptr && tree_known) {
      kept_->lines.push_back(leaf);
    }
    erased_now_.reset();
    told_now_.reset();
    closed_now_.reset();
    opened_now_ = false;
    opened_by_another_now_.reset();
    of_holds_now_.reset();
    of_consents_now_.reset();
    consents_.followed();
    take(line, parse, number, root_before);
    if (contents_.gave_up) {
      if (outside_ != nullptr) {
        outside_->finish(tree_.size(), false);
      }
      judge_stranger();
      contents_.entries = tree_.size();
      contents_.checkpoints = checkpoints_.count();
      return std::move(contents_);
    }
    if (outside_ != nullptr) {
      outside_->reached(tree_.size(), fits, tree_known);
    }
    if (checkpoints_.has(tree_.size())) {
      checkpoints_.reached(tree_.size(), fits, tree_known, std::nullopt);
      judge_signed();
      keep_signed();
    }
    // One that was kept elsewhere counts as if it still lay here. It is by a trusted device, for its own log.
    const bool has_its_own = checkpoints_.covered() == tree_.size() ||
                             (outside_ != nullptr && device_ && outside_->holds_at(tree_.size(), *device_));
    if (erased_now_ && has_its_own) {
      contents_.cases[*erased_now_].erased = true;
    }
    // What was signed while the log was not the case's device's does not speak of its cases.
    if (is_case_devices_ && has_its_own) {
      contents_.accusing = tree_.size();
    }
    if (opened_by_another_now_) judge_opening_by_another(number, has_its_own);
    judge_told(number, has_its_own);
    if (has_its_own) {
      judge_holds(number);
    }
    judge_consents(number, has_its_own);
    // No note beyond the lines says which are the newest: anybody can put one there.
    if (checkpoints_.has(tree_.size())) {
      recent_.clear();
    } else {
      recent_.push_back({{}, tree_.size(), tree_.root()});
      if (recent_.size() > kMostRecent) {
        recent_.pop_front();
      }
    }
    if (tree_.size() == head_) {
      contents_.root_at_head = tree_.root();
    }
  }
  if (kept_ != nullptr) {
    kept_->whole = tree_known;
  }
  take_late_notes(tree_known);
  tell_claims();
  checkpoints_.finish(tree_.size());
  if (outside_ != nullptr) {
    outside_->finish(tree_.size(), true);
  }
  judge_tail();
  check_names();
  consents_.finish(listing_, tree_.size(), case_id_.empty());
  boots_.finish();
  checkpoints_.judge_keys(tree_.size(), {});
  judge_stranger();
  keep_vouched_for();
  contents_.signatures = checkpoints_.signatures_checked();
  contents_.signed_entries = checkpoints_.signed_entries();
  contents_.entries = tree_.size();
  contents_.checkpoints = checkpoints_.count();
  return std::move(contents_);
}

void LogWalk::take_late_notes(bool tree_known) {
  for (const crypto::Checkpoint& recent : recent_) {
    if (folder_->open_file(note_path(recent.size)).file) {
      checkpoints_.appeared(recent.size);
      checkpoints_.reached(
          recent.size, [&](const crypto::Sha256Digest& root) { return root == recent.root; }, tree_known,
          std::nullopt);
    }
  }
}

void LogWalk::keep_signed() {
  if (kept_ == nullptr || !signer_ || checkpoints_.covered() != tree_.size()) {
    return;
  }
  const auto [device, is_new] = kept_devices_.try_emplace(*signer_, kept_->devices.size());
  if (is_new) {
    kept_->devices.push_back(*signer_);
  }
  kept_->checkpoints.push_back({tree_.size(), device->second});
}

void LogWalk::judge_signed() {
  if (checkpoints_.covered() != tree_.size()) {
    return;
  }
  tell_claims();
  if (signer_) signed_by_[*signer_] = tree_.size();
  if (outside_ != nullptr && device_) outside_->add_shown(log_origin(device_->name()), *device_);
  // One is without its own where the machine stopped in between; so is the next start's first entry, where it
  // stops there again. Such entries excuse nothing.
  constexpr std::uint64_t kMost = 3;
  if (since_note_ > kMost) {
    findings_->add("log-signed-late", {note_path(tree_.size()), tree_.size() - 1},
                   note_path(tree_.size()) + " is the first checkpoint over " + std::to_string(since_note_) +
                       " entries, where one was to follow each: nobody signed them when they were written");
  }
  since_note_ = 0;
}

void LogWalk::judge_told(std::uint64_t number, bool has_its_own) {
  if (!told_now_) {
    return;
  }
  LoggedCase& known = contents_.cases[*told_now_];
  if (closed_now_ && (has_its_own || !known.closed)) {
    known.closed = {closed_now_->size, closed_now_->root, number};
    known.final_token = closed_now_->final_token;
  }
  if (opened_now_ && has_its_own) known.erased = false;
  known.vouched = known.vouched || has_its_own;
  if (!known.further.empty() && known.further.back().entry == number) {
    known.further.back().vouched = has_its_own;
  }
  if (!has_its_own) {
    contents_.doubted.insert(number);
  }
}

void LogWalk::judge_opening_by_another(std::uint64_t number, bool has_its_own) {
  std::optional<LogContents::OpenedByAnother>& first = contents_.opened_by_another;
  const bool accuses = has_its_own && trusts_device_ && !trusts_case_device_;
  if (!first || (accuses && !first->accuses)) {
    first = {number, *opened_by_another_now_, contents_.device.empty(), accuses};
  }
}

void LogWalk::judge_consents(std::uint64_t number, bool has_its_own) {
  if (!of_consents_now_) {
    return;
  }
  const std::string& case_id = std::visit(
      [](const auto& entry) -> const std::string& {
        static const std::string kNone;
        if constexpr (requires { entry.case_id; }) {
          return entry.case_id;
        } else {
          return kNone;
        }
      },
      *of_consents_now_);
  const auto known = contents_.cases.find(case_id);
  consents_.take(*of_consents_now_, number,
                 {has_its_own, is_asked_for(case_id) && is_its_devices(case_id),
                  known != contents_.cases.end() && known->second.opened.has_value()});
}

void LogWalk::judge_holds(std::uint64_t number) {
  if (!of_holds_now_) {
    return;
  }
  const std::string& case_id =
      std::visit([](const auto& entry) -> const std::string& { return entry.case_id; }, *of_holds_now_);
  const bool is_own = is_its_devices(case_id);
  Holds& standing = holds_[case_id];
  std::visit(
      Overloaded{[&](const CaseHeldEntry&) { (is_own ? standing.own : standing.of_others).insert(number); },
                 [&](const CaseReleasedEntry& released) {
                   standing.of_others.erase(released.hold);
                   if (is_own) standing.own.erase(released.hold);
                 },
                 [&](const CaseErasedEntry& erased) {
                   if (is_own && !standing.own.empty()) {
                     const std::string what =
                         erased.stream ? "stream " + *erased.stream + " of case " : std::string("case ");
                     of_cases_->add("erased-while-held", in_ledger(number),
                                    "the log says that " + what + erased.case_id +
                                        " was erased while its legal hold of " +
                                        at_entry(*standing.own.begin()) + " stood");
                   } else if (!standing.own.empty() || !standing.of_others.empty()) {
                     note_another(number);
                   }
                 }},
      *of_holds_now_);
}

void LogWalk::judge_tail() {
  const std::uint64_t covered = checkpoints_.covered();
  const bool is_empty = tree_.size() == 0;  // as whoever takes all of it away leaves it
  if (covered == tree_.size() && !is_empty) {
    return;
  }
  // A log is signed entry by entry, but for starts of the machine and changes of its configuration: one may
  // be without its checkpoint, where the machine stopped in between or is at it now.
  const bool two_unsigned = to_be_followed_.size() == 2 && to_be_followed_.front() >= covered;
  const bool nothing_signed = covered == 0 && (is_empty || !to_be_followed_.empty());
  if (is_empty && covered == 0) {
    findings_->add(
        "log-tail-unsigned", in_ledger(0),
        "the log holds no whole entry, though it begins with one and nobody takes any away: what it "
        "said of cases is lost");
  } else if (nothing_signed || two_unsigned) {
    findings_->add("log-tail-unsigned", in_ledger(covered),
                   "no checkpoint covers the log from " + at_entry(covered) +
                       " on, where one was to follow each entry: nobody signed what stands there");
  } else {
    findings_->add("log-tail-not-covered", in_ledger(covered),
                   "no checkpoint covers the log from " + at_entry(covered) + " on");
  }
}

void LogWalk::count_broken_line(std::uint64_t number) {
  contents_.gave_up = ++broken_lines_ > kMostBrokenLines;
  if (contents_.gave_up) {
    findings_->add("ledger-unreadable", in_ledger(number), unreadable_text(number));
  }
}

void LogWalk::take(const LedgerLine& line, const LogEntryParse& parse, std::uint64_t number,
                   const std::optional<crypto::Sha256Digest>& root_before) {
  if (line.too_long) {
    count_broken_line(number);
    findings_->add("entry-too-long", in_ledger(number, line.offset),
                   "the line of " + at_entry(number) + " of the log has " + std::to_string(line.bytes) +
                       " bytes where at most " + std::to_string(kMaximumLineBytes) + " are allowed");
    return;
  }
  if (!parse.entry) {
    count_broken_line(number);
    findings_->add("entry-malformed", in_ledger(number, line.offset),
                   at_entry(number) + " of the log is no entry of the format: " + parse.problem);
    return;
  }
  const LogEntry& entry = *parse.entry;
  if (entry.seq != number) {
    findings_->add("entry-out-of-sequence", in_ledger(number, line.offset),
                   "line " + std::to_string(number) + " of the log has seq " + std::to_string(entry.seq));
  }
  const bool boots = std::holds_alternative<BootEntry>(entry.body);
  if (number == 0 && !boots) {
    findings_->add("open-missing", in_ledger(0),
                   "the log begins with " + std::string(type_of(entry.body)) + " instead of boot");
  }
  if (!boots && entry.at.mono_ns < last_mono_ns_) {
    findings_->add(
        "clock-went-back", in_ledger(number, line.offset),
        "the machine's monotonic clock goes back in " + at_entry(number) + " of the log without a boot");
  }
  last_mono_ns_ = entry.at.mono_ns;
  if (!boots && !std::holds_alternative<ConfigChangedEntry>(entry.body) &&
      !std::holds_alternative<DeviceMlDsaEntry>(entry.body) &&
      !std::holds_alternative<DeviceHardwareEntry>(entry.body) &&
      !std::holds_alternative<DeviceAttestationEntry>(entry.body) &&
      !std::holds_alternative<DeviceHardwareSilentEntry>(entry.body)) {
    // A cut that was made good is entered together with what comes next.
    const bool comes_with_the_next = std::holds_alternative<LogRecoveredEntry>(entry.body) ||
                                     std::holds_alternative<LogDamageEntry>(entry.body);
    since_note_ += comes_with_the_next ? 0U : 1U;
    to_be_followed_.push_back(number);
    if (to_be_followed_.size() > 2) {
      to_be_followed_.pop_front();
    }
  }
  contents_.begins = contents_.begins.value_or(entry.at.utc);
  if (ConsentRules::concerns(entry.body)) of_consents_now_ = entry.body;
  boots_.take(entry.body, number, root_before);
  std::visit(
      Overloaded{[&](const BootEntry& boot) { set_device(boot.device, number); },
                 [&](const DeviceKeyChangedEntry& change) { set_device(change.device, number); },
                 [&](const DeviceMlDsaEntry& added) { judge_ml_dsa_key(added.ml_dsa, number); },
                 [&](const DeviceHardwareEntry& added) { judge_hardware_key(added.hardware, number); },
                 [&](const LogDamageEntry& damage) { judge_damage(damage, number); },
                 [&](const CaseOpenedEntry& opened) {
                   LoggedCase* known = logged(opened.case_id, number);
                   if (known != nullptr) {
                     told_now_ = opened.case_id;
                     opened_now_ = true;
                   } else if (!case_id_.empty() && is_asked_for(opened.case_id)) {
                     opened_by_another_now_ = opened.sha256;
                   }
                   if (known != nullptr && !known->opened) {
                     known->opened = number;
                     known->opening_line = opened.sha256;
                   } else if (known != nullptr && case_id_.empty() && known->opening_line != opened.sha256) {
                     known->further.push_back({number, opened.sha256});
                   }
                 },
                 [&](const CaseCheckpointEntry& checkpoint) {
                   if (LoggedCase* known = logged(checkpoint.case_id, number)) {
                     note_root(checkpoint.case_id, {checkpoint.size, checkpoint.root, number});
                     known->told = known->told.value_or(number);
                     told_now_ = checkpoint.case_id;
                   }
                 },
                 [&](const CaseClosedEntry& closed) {
                   if (LoggedCase* known = logged(closed.case_id, number)) {
                     note_root(closed.case_id, {closed.size, closed.root, number});
                     known->told = known->told.value_or(number);
                     told_now_ = closed.case_id;
                     closed_now_ = closed;
                   }
                 },
                 [&](const CaseErasedEntry& erased) {
                   // Of one stream's segments only: the rest of the case must still be there.
                   if (!is_asked_for(erased.case_id)) return;
                   if (!erased.stream && is_its_devices(erased.case_id)) {
                     erased_now_ = erased.case_id;
                   } else if (!erased.stream) {
                     note_another(number);
                   }
                   of_holds_now_ = erased;
                 },
                 [&](const CaseHeldEntry& held) {
                   if (is_asked_for(held.case_id)) of_holds_now_ = held;
                 },
                 [&](const CaseReleasedEntry& released) {
                   if (is_asked_for(released.case_id)) of_holds_now_ = released;
                 },
                 [](const auto&) {}},
      entry.body);
}

void LogWalk::keep_vouched_for() {
  if (!signs_case_ || contents_.device != case_device_) {
    return;
  }
  const EntriesBy covered = checkpoints_.covered_by();
  EntriesBy& most = contents_.vouched_for;
  most.ml_dsa = std::max(most.ml_dsa, covered.ml_dsa);
  most.hardware = std::max(most.hardware, std::min(covered.hardware, from_before_hardware_));
}

void LogWalk::set_device(const std::string& device, std::uint64_t number) {
  if (std::exchange(names_device_, true) && device == contents_.device) {
    return;
  }
  keep_vouched_for();
  contents_.device = device;
  signer_.reset();
  device_.reset();
  trusts_device_ = false;
  try {
    const crypto::VerifierKey key = crypto::VerifierKey::parse(device);
    signer_ = key.to_string();
    if (kept_ != nullptr && number == 0) {
      kept_->first_device = *signer_;
    }
    device_ = known_device(key, options_->devices);
    trusts_device_ = is_among(options_->devices, key);
    checkpoints_.set_signer(*device_, log_origin(key.name()),
                            {device_->ml_dsa_since(), device_->hardware_since()});
    // Whose log it is, its first line says. That a later one names another key shows nothing until that key
    // has signed: anybody can add such a line.
    if (outside_ != nullptr && !first_device_) outside_->add_shown(log_origin(key.name()), *device_);
    judge_named(key);
  } catch (const UsageError& error) {
    findings_->add("device-invalid", in_ledger(number),
                   at_entry(number) + " of the log names no device: " + error.what());
  }
  first_device_ = first_device_.value_or(device_now());
  is_case_devices_ = !case_device_.empty() && is_one_device({case_device_, signs_case_}, device_now());
  contents_.was_case_devices = contents_.was_case_devices || is_case_devices_;
}

void LogWalk::judge_named(const crypto::VerifierKey& key) {
  const bool is_anothers = !case_device_.empty() && signs_case_ != key;
  if (is_anothers && !options_->devices.empty() && !trusts_device_) {
    stranger_ = stranger_.value_or(key);
  } else {
    judge_device(key, *options_, *findings_);
  }
}

// What stands in the case's own log under another key counts for nothing: the case does not rest on it.
void LogWalk::judge_stranger() {
  if (!stranger_) return;
  if (!contents_.was_case_devices) return judge_device(*stranger_, *options_, *findings_);
  findings_->add(
      "log-not-tidy", {"", 0},
      "the log names the device " + stranger_->to_string() +
          ", which is not among the trusted ones: what stands there while it does was not counted");
}

void LogWalk::claim(CodeName code, std::uint64_t number, std::string text) {
  // Of a million that nobody signed the first ones say enough.
  constexpr std::size_t kMost = 256;
  const auto is_of_code = [&](const Claim& each) { return each.code.index() == code.index(); };
  if (claims_.size() >= kMost && std::ranges::any_of(claims_, is_of_code)) return;
  claims_.push_back({code, number, std::move(text)});
}

void LogWalk::tell_claims() {
  std::erase_if(claims_, [&](const Claim& each) {
    if (each.number >= checkpoints_.covered()) return false;
    findings_->add(each.code, in_ledger(each.number), each.text);
    return true;
  });
}

void LogWalk::judge_damage(const LogDamageEntry& damage, std::uint64_t number) {
  // Whoever finds damage finds that the device's newest checkpoint does not fit: none of it covers so many
  // entries, or more, and does.
  const auto by_device = signer_ ? signed_by_.find(*signer_) : signed_by_.end();
  if (by_device != signed_by_.end() && by_device->second >= damage.size) {
    claim("log-damage-refuted", number,
          at_entry(number) + " of the log says that the first " + std::to_string(damage.size) +
              " entries were changed, and a checkpoint over the first " + std::to_string(by_device->second) +
              " holds: somebody added the entry, and the recorder signed over it");
    return;
  }
  claim("log-damage-stated", number,
        at_entry(number) + " of the log says that the first " + std::to_string(damage.size) +
            " entries were not, or not all, those over which its checkpoint was signed: they were changed on "
            "the disk before that");
}

void LogWalk::judge_ml_dsa_key(const std::string& key, std::uint64_t number) {
  try {
    const crypto::MlDsaVerifierKey stated = crypto::MlDsaVerifierKey::parse(key);
    if (device_ &&
        (stated.device() != device_->name() || (device_->ml_dsa() && *device_->ml_dsa() != stated))) {
      claim("device-ml-dsa-differs", number,
            at_entry(number) + " of the log states an ML-DSA key of " + stated.device() +
                " that is not the one of the identity given for " + device_->name());
    }
  } catch (const UsageError& error) {
    claim("device-invalid", number, at_entry(number) + " of the log states no ML-DSA key: " + error.what());
  }
}

void LogWalk::judge_hardware_key(const std::string& key, std::uint64_t number) {
  try {
    const crypto::HardwareVerifierKey stated = crypto::HardwareVerifierKey::parse(key);
    if (device_ &&
        (stated.device() != device_->name() || (device_->hardware() && *device_->hardware() != stated))) {
      claim("device-hardware-differs", number,
            at_entry(number) + " of the log states a key in the hardware of " + stated.device() +
                " that is not the one of the identity given for " + device_->name());
    }
  } catch (const UsageError& error) {
    claim("device-invalid", number,
          at_entry(number) + " of the log states no key in hardware: " + error.what());
  }
}

LoggedCase* LogWalk::logged(const std::string& case_id, std::uint64_t number) {
  if (!is_asked_for(case_id)) return nullptr;
  if (!is_its_devices(case_id)) {
    note_another(number);
    return nullptr;
  }
  LoggedCase& known = contents_.cases[case_id];
  if (case_id_.empty() && (!known.device || known.device->text.empty())) {
    known.device = device_now();
    known.accuses = trusts_device_ || !first_device_ || is_one_device(*first_device_, *known.device);
  }
  return &known;
}

bool LogWalk::is_its_devices(const std::string& case_id) const {
  if (!case_id_.empty()) return is_case_devices_;
  const auto known = contents_.cases.find(case_id);
  if (known == contents_.cases.end() || !known->second.device || known->second.device->text.empty()) {
    return true;
  }
  return is_one_device(*known->second.device, device_now());
}

void LogWalk::note_another(std::uint64_t number) {
  contents_.told_by_another = contents_.told_by_another.value_or(number);
}

bool LogWalk::is_asked_for(const std::string& case_id) const {
  return case_id_.empty() || case_id == case_id_;
}

void LogWalk::note_root(const std::string& case_id, const KnownRoot& root) {
  if (case_id == case_id_) {
    contents_.cases[case_id].roots.push_back(root);
  }
}

void LogWalk::check_names() {
  contents_.left = check_folder_names(listing_, *findings_, [this](const ListedFile& file) {
    const bool is_folder = file.kind == ListedFile::Kind::kFolder;
    const bool own_folder = is_folder && (file.path == kCheckpointsFolder || file.path == kConsentsFolder);
    const bool of_consent = !is_folder && hash_of_consent_path(file.path) &&
                            (file.kind == ListedFile::Kind::kRegular || consents_.names(file.path));
    if (own_folder || of_consent || file.path == kLedgerFile || is_note_file(file)) {
      return NameJudgement::kNamed;
    }
    const bool part = file.kind == ListedFile::Kind::kRegular && file.path.ends_with(kPartSuffix);
    const std::string_view whole =
        std::string_view(file.path).substr(0, part ? file.path.size() - kPartSuffix.size() : 0);
    return part && (is_note_path(whole) || hash_of_consent_path(whole)) ? NameJudgement::kPart
                                                                        : NameJudgement::kUnnamed;
  });
}

LogComparison::LogComparison(const LogContents* log, const std::optional<OpenEntry>& opening,
                             FindingList& findings, Head head)
    : known_head_(head), findings_(&findings) {
  if (log == nullptr || !opening) {
    return;
  }
  case_id_ = opening->case_id;
  case_device_ = opening->device;
  head_ = opening->appliance_log_size;
  const auto found = log->cases.find(case_id_);
  const bool knows = found != log->cases.end() && found->second.opened;
  if (!is_to_compare(*log, knows)) {
    return;
  }
  log_ = log;
  if (!knows) {
    unknown_ = true;
  } else {
    known_ = &found->second;
    roots_ = known_->roots;
    if (known_->erased) {
      findings_->add("log-case-erased", in_log(),
                     "the appliance log says that the whole case " + case_id_ +
                         " was erased: what is verified is a copy that was kept");
    }
    std::stable_sort(roots_.begin(), roots_.end(),
                     [](const KnownRoot& a, const KnownRoot& b) { return a.size < b.size; });
  }
  // Of a log that is shorter, of whose lines nobody signed so many, or whose lines were changed before they
  // were signed over, nothing says which state it had.
  const bool differs = known_head_ == Head::kKnown && log->root_at_head != opening->appliance_log_root;
  silent_ = differs && (log->accusing < head_ || !log->sound);
  if (differs && !silent_) {
    findings_->add("log-head-differs", in_ledger(0),
                   "open states the log's root at " + std::to_string(head_) +
                       " entries, and the log has another, which was signed");
  }
}

bool LogComparison::is_to_compare(const LogContents& log, bool knows) {
  // What another device's log says, or does not say, speaks neither for the case nor against it. But anybody
  // can put a case of a key of their own into the place of one that a trusted device entered.
  const auto& another = log.opened_by_another;
  if (another && another->accuses) {
    another_ = another;
    return false;
  }
  if (!knows && (another ? another->by_nobody : log.device.empty())) {
    findings_->add(
        "log-silent", in_log(),
        "no line of the appliance log that can be read names its device" +
            std::string(another ? " before it tells of the case" : "") +
            ", so nobody knows whose it is: whether the device's log knows this case was not checked");
    return false;
  }
  if (!knows && !log.was_case_devices && another) {
    add_of_another_device(another->entry);
    return false;
  }
  if (!knows && !log.was_case_devices) {
    findings_->add("log-of-another-device", in_log(),
                   "the appliance log is of " + log.device + ", and " + case_device_ +
                       " signed the case: whether its own log knows it was not checked; give that one");
    return false;
  }
  if (log.told_by_another) {
    findings_->add("log-of-another-device", in_log(log.told_by_another),
                   "the appliance log was another device's when it tells of this case in its " +
                       at_entry(*log.told_by_another) +
                       ": what stands there counts neither for the case nor against it. It was compared with "
                       "what its own device states");
  }
  return true;
}

void LogComparison::add_of_another_device(std::uint64_t log_entry) {
  findings_->add("log-of-another-device", in_log(log_entry),
                 "the appliance log was another device's when it says that the case was opened, and " +
                     case_device_ + " signed the case: whether its own log knows it was not checked");
}

void LogComparison::add_silent() {
  if (known_head_ == Head::kUnknown) {
    findings_->add("log-silent", in_log(),
                   "the appliance log given does not know the case, and over which state of it the case was "
                   "opened cannot be read here: whether the device's log knows this case was not checked");
    return;
  }
  const std::string why =
      !log_->sound ? "lines of the log given are broken or lack" +
                         std::string(known_ == nullptr ? ", of which one may tell of it" : "")
      : known_ != nullptr ? "known devices signed no more than " + std::to_string(log_->accusing) +
                                " of the log given: checkpoints of it lack, or nobody signed what follows"
      : log_->accusing > head_
          ? "known devices signed no more than " + std::to_string(log_->accusing) +
                " of the log given: it is a copy from while the case was being opened, or it was cut off"
          : "known devices signed no more than " + std::to_string(log_->accusing) +
                " of the log given: it is a copy from before, it was cut off, or nobody signed it";
  findings_->add("log-silent", in_log(),
                 "the case was opened over " + counted(head_, "entry", "entries") +
                     " of the appliance log, and " + why +
                     (known_ == nullptr ? "; whether the device's log knows this case was not checked"
                                        : "; which state the log had then was not checked"));
}

void LogComparison::add(CodeName code, const Place& place, std::uint64_t log_entry, const std::string& text,
                        std::uint64_t contradicted) {
  if (log_->doubted.contains(log_entry)) {
    doubts_.push_back({code, place, text, contradicted});
  } else {
    findings_->add(code, place, text);
  }
}

void LogComparison::settle(std::uint64_t covered, std::optional<std::uint64_t> close) {
  if (unknown_ && entries_ == 1 && covered == 0) {
    // A recorder makes the case first. It holds nothing yet, and nobody has signed that it does.
    findings_->add("log-case-not-entered", in_log(),
                   "the appliance log does not know the case " + case_id_ +
                       " yet, which holds nothing: it was being begun");
  } else if (unknown_ && known_head_ == Head::kKnown && log_->sound && log_->accusing > head_ &&
             log_->accusing - head_ > kMostRecent) {
    // Other rooms may enter something between the state that `open` has and the line of the case: a copy that
    // was made in between lacks that line, and nobody took anything away.
    findings_->add("log-case-unknown", in_log(), "the appliance log does not know a case " + case_id_);
  } else {
    silent_ = silent_ || unknown_;
  }
  if (silent_) {
    add_silent();
  }
  for (const Doubt& each : doubts_) {
    const bool speaks_for_itself =
        each.contradicted == kItsEnd ? close && covered > *close : covered >= each.contradicted;
    if (speaks_for_itself) {
      findings_->add("log-entry-doubted", each.place,
                     each.text +
                         "; that entry of the log has no checkpoint of its own: it was never signed, or its "
                         "checkpoint was removed. Whoever could write to the disk could have made it");
    } else {
      findings_->add(
          each.code, each.place,
          each.text +
              "; that entry of the log has no checkpoint of its own, and no checkpoint of the case "
              "speaks against it");
    }
  }
  doubts_.clear();
}

void LogComparison::check_opening(const crypto::Sha256Digest& entry0) {
  if (another_ && another_->opening_line == entry0) {
    add_of_another_device(another_->entry);
  } else if (another_) {
    findings_->add("log-opening-differs", in_log(another_->entry),
                   "the appliance log was a trusted device's when it entered another open of case " +
                       case_id_ + " in its " + at_entry(another_->entry) + ", and " + case_device_ +
                       ", which signed what is here, is not trusted");
  }
  if (known_ != nullptr && known_->opening_line != entry0) {
    add("log-opening-differs", in_log(*known_->opened), *known_->opened,
        "the appliance log knows another open of case " + case_id_ + " in its " + at_entry(*known_->opened),
        1);
  }
}

std::span<const KnownRoot> LogComparison::roots_at(std::uint64_t size) const {
  const auto begin = std::partition_point(roots_.begin(), roots_.end(),
                                          [&](const KnownRoot& each) { return each.size < size; });
  const auto end =
      std::partition_point(begin, roots_.end(), [&](const KnownRoot& each) { return each.size == size; });
  return {begin, end};
}

bool LogComparison::asks_for(std::uint64_t size) const { return !roots_at(size).empty(); }

bool LogComparison::knows_beyond(std::uint64_t size) const {
  return !roots_.empty() && roots_.back().size > size;
}

void LogComparison::reached(std::uint64_t size, const RootTest& fits) {
  for (const KnownRoot& each : roots_at(size)) {
    bool& said = log_->doubted.contains(each.entry) ? differs_in_doubt_ : differs_;
    const bool is_its = fits(each.root);
    if (is_its) {
      if (!log_->doubted.contains(each.entry)) known_entries_ = std::max(known_entries_, size);
      const bool by_ml_dsa = each.entry < log_->vouched_for.ml_dsa;
      const bool by_hardware = each.entry < log_->vouched_for.hardware;
      vouched_by_.ml_dsa = std::max(vouched_by_.ml_dsa, by_ml_dsa ? size : 0);
      vouched_by_.hardware = std::max(vouched_by_.hardware, by_hardware ? size : 0);
    }
    if (!said && !is_its) {
      said = true;
      add("log-checkpoint-differs", in_log(each.entry), each.entry,
          "the first " + std::to_string(size) +
              " entries are not those whose root the appliance log states in its " + at_entry(each.entry),
          size);
    }
  }
}

std::optional<CaseInLog> LogComparison::told() const {
  if (log_ == nullptr) {
    return std::nullopt;
  }
  // What nobody signed in time, anybody who can write to the disk can have added.
  const auto signed_then = [&](std::uint64_t entry) { return !log_->doubted.contains(entry); };
  CaseInLog told;
  told.entries = known_entries_;
  told.opening = known_ != nullptr && signed_then(*known_->opened);
  told.end = known_ != nullptr && known_->closed && signed_then(known_->closed->entry);
  return told;
}

void LogComparison::finish_unread(std::uint64_t entries) {
  entries_ = entries;
  if (known_ != nullptr) has_all(entries);
}

bool LogComparison::has_all(std::uint64_t entries) {
  // By size: of those that somebody signed in time the last, or the last of the others.
  const auto signed_then = [&](const KnownRoot& each) { return !log_->doubted.contains(each.entry); };
  auto most = std::find_if(roots_.rbegin(), roots_.rend(), signed_then);
  if (most == roots_.rend() || most->size <= entries) {
    most = roots_.rbegin();
  }
  if (most != roots_.rend() && most->size > entries) {
    add("log-knows-more", {std::string(kLedgerFile), entries}, most->entry,
        "the appliance log knows " + std::to_string(most->size) + " entries of this case (its " +
            at_entry(most->entry) + ") and there are " + std::to_string(entries) +
            ": the end of the ledger was removed",
        kItsEnd);
    return false;
  }
  return true;
}

void LogComparison::finish(std::uint64_t entries, bool closed,
                           const std::map<std::uint64_t, crypto::Sha256Digest>& tokens) {
  entries_ = entries;
  if (known_ == nullptr || !has_all(entries)) {
    return;
  }
  if (!known_->closed && closed) {
    findings_->add(
        "log-case-open", in_log(*known_->opened),
        "the case is closed and the log knows no end of it: the log was read before that, is a copy "
        "from before, or was cut off");
  }
  if (known_->closed) {
    std::optional<crypto::Sha256Digest> last;
    for (const auto& [entry, hash] : tokens) {
      if (entry < known_->closed->size) {
        last = hash;
      }
    }
    if (last != known_->final_token) {
      add("log-end-differs", in_log(known_->closed->entry), known_->closed->entry,
          "the appliance log states another final token of this case in its " +
              at_entry(known_->closed->entry),
          known_->closed->size);
    }
  }
}

}  // namespace kiroku::archive

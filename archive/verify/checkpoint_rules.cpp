#include "archive/verify/checkpoint_rules.h"

#include <algorithm>
#include <thread>
#include <utility>

#include "archive/format/case_layout.h"
#include "archive/verify/file_checker.h"
#include "base/error.h"
#include "base/number_text.h"

namespace kiroku::archive {

std::vector<std::uint64_t> note_sizes(const std::vector<ListedFile>& listing) {
  const std::string prefix = std::string(kCheckpointsFolder) + "/";
  std::vector<std::uint64_t> sizes;
  for (const ListedFile& file : listing) {
    if (file.path.starts_with(prefix) && file.kind != ListedFile::Kind::kFolder) {
      if (const auto size = size_of_note_name(std::string_view(file.path).substr(prefix.size()));
          size && *size > 0) {
        sizes.push_back(*size);
      }
    }
  }
  std::sort(sizes.begin(), sizes.end());
  return sizes;
}

bool are_notes_listed(const std::vector<ListedFile>& listing) {
  return std::ranges::none_of(listing, [](const ListedFile& file) {
    return file.path == kCheckpointsFolder && file.kind == ListedFile::Kind::kUnreadable;
  });
}

std::optional<std::string> read_note(const CaseFolder& folder, std::uint64_t size,
                                     std::optional<std::uint64_t> entry, FindingList& findings) {
  const Place place{note_path(size), entry};
  const FileOpening opening = folder.open_file(place.file);
  if (!opening.file) {
    report_unopened(findings, place, opening);
    return std::nullopt;
  }
  try {
    std::optional<std::string> note = read_small(*opening.file, kMaximumNoteBytes);
    if (!note) {
      findings.add("checkpoint-malformed", place,
                   place.file + " is far too long for a checkpoint, or has a hole");
    }
    return note;
  } catch (const IoError& error) {
    findings.add("file-unreadable", place, std::string(error.what()) + "; so it was not checked");
    return std::nullopt;
  }
}

std::uint64_t bytes_in(const std::vector<ListedFile>& listing) {
  std::uint64_t total = 0;
  for (const ListedFile& file : listing) {
    total += file.kind == ListedFile::Kind::kRegular ? file.bytes : 0;
  }
  return total;
}

crypto::VerifierKey known_device(const crypto::VerifierKey& device,
                                 const std::vector<crypto::VerifierKey>& known) {
  // The same key may have been given with and without those that sign beside: then all are asked for.
  crypto::VerifierKey with_all = device;
  for (const crypto::VerifierKey& each : known) {
    if (each != device) continue;
    if (each.ml_dsa() && !with_all.ml_dsa())
      with_all = with_all.with_ml_dsa(*each.ml_dsa(), each.ml_dsa_since());
    if (each.hardware() && !with_all.hardware())
      with_all =
          with_all.with_hardware(*each.hardware(), each.hardware_since(), each.log_root_before_hardware());
  }
  return with_all;
}

void judge_device(const crypto::VerifierKey& device, const VerifyOptions& options, FindingList& findings) {
  if (options.devices.empty()) {
    findings.add("no-trusted-device", {"", 0},
                 "no trusted device key was given, so the signatures of " + device.name() +
                     " prove only that one key made them all");
  } else if (std::find(options.devices.begin(), options.devices.end(), device) == options.devices.end()) {
    findings.add(
        "device-not-trusted", {"", 0},
        "the device " + device.to_string() + " is not among the trusted ones: anybody can make such a key");
  }
}

namespace {

/// The first few of many names that anybody may have chosen, each cut short.
std::string some_of(const std::vector<std::string>& keys) {
  constexpr std::size_t kMost = 3;
  constexpr std::size_t kLongest = 80;
  std::string text;
  for (std::size_t i = 0; i < std::min(keys.size(), kMost); ++i) {
    std::size_t end = std::min(keys[i].size(), kLongest);
    // Not within a character.
    while (end < keys[i].size() && (static_cast<unsigned char>(keys[i][end]) & 0xc0U) == 0x80U) {
      --end;
    }
    text += (i == 0 ? "" : ", ") + keys[i].substr(0, end) + (end < keys[i].size() ? "…" : "");
  }
  return text + (keys.size() > kMost ? ", …" : "");
}

}  // namespace

CheckpointRules::CheckpointRules(const CaseFolder& folder, const VerifyOptions& options,
                                 FindingList& findings, std::vector<std::uint64_t> sizes, bool all_listed)
    : folder_(&folder),
      options_(&options),
      findings_(&findings),
      sizes_(std::move(sizes)),
      all_listed_(all_listed) {}

void CheckpointRules::set_signer(crypto::VerifierKey device, std::string origin, EntriesBy alone_until) {
  // What was opened ahead was judged by another key. A log that changes its device in every line would have
  // it all opened again each time.
  may_open_ahead_ = !device_;
  ahead_.reset();
  if (device_ && *device_ != device) {
    covered_by_ = {};
  }
  device_ = std::move(device);
  origin_ = std::move(origin);
  alone_until_ = alone_until;
}

bool CheckpointRules::has(std::uint64_t size) const {
  return std::binary_search(sizes_.begin(), sizes_.end(), size);
}

void CheckpointRules::appeared(std::uint64_t size) {
  const auto at = std::lower_bound(sizes_.begin(), sizes_.end(), size);
  if (at == sizes_.end() || *at != size) {
    sizes_.insert(at, size);
  }
}

std::optional<std::int64_t> CheckpointRules::mono_at(std::uint64_t size) const {
  const auto found = mono_.find(size);
  return found == mono_.end() ? std::nullopt : std::optional(found->second);
}

std::optional<crypto::Sha256Digest> CheckpointRules::hash_at(std::uint64_t size) const {
  const auto found = hashes_.find(size);
  return found == hashes_.end() ? std::nullopt : std::optional(found->second);
}

ReadNote CheckpointRules::open(const std::string& note) const {
  std::vector<crypto::VerifierKey> signers;
  if (device_) {
    signers.push_back(*device_);
  }
  return {crypto::open_note(note, signers), crypto::sha256(bytes_of(note))};
}

void CheckpointRules::open_ahead(std::uint64_t size) {
  constexpr std::ptrdiff_t kFew = 64;
  may_open_ahead_ = false;
  const std::size_t threads =
      options_->threads > 0 ? options_->threads : std::max(1U, std::thread::hardware_concurrency());
  const auto first = std::lower_bound(sizes_.begin(), sizes_.end(), size);
  if (threads < 2 || sizes_.end() - first < kFew) {
    return;
  }
  ahead_.emplace(std::vector(first, sizes_.end()), threads,
                 [this](std::uint64_t each) -> std::optional<ReadNote> {
                   FindingList said_later;
                   const auto note = read_note(*folder_, each, std::nullopt, said_later);
                   return note ? std::optional(open(*note)) : std::nullopt;
                 });
}

std::optional<crypto::OpenedNote> CheckpointRules::opened(std::uint64_t size) {
  if (device_ && may_open_ahead_) {
    open_ahead(size);
  }
  std::optional<ReadNote> read = ahead_ ? ahead_->take(size) : std::nullopt;
  if (!read) {
    const std::optional<std::string> note = read_note(*folder_, size, std::nullopt, *findings_);
    if (!note) {
      const FileOpening opening = folder_->open_file(note_path(size));
      const bool is_short = opening.file && opening.file->size() <= kMaximumNoteBytes;
      if (is_short || (!opening.file && opening.problem == FileProblem::kUnreadable)) {
        unread_ = std::max(unread_, size);
      }
      return std::nullopt;
    }
    read = open(*note);
  }
  hashes_.emplace(size, read->hash);
  return std::move(read->opened);
}

std::optional<crypto::Checkpoint> CheckpointRules::check_note(std::uint64_t size,
                                                              const crypto::OpenedNote& opened) {
  const bool lacks_ml_dsa = opened.failure == crypto::NoteFailure::kLacksMlDsa;
  const bool may_lack =
      opened.failure == crypto::NoteFailure::kLacksHardware || (lacks_ml_dsa && size <= alone_until_.ml_dsa);
  all_signed_ = all_signed_ && (!opened.failure || may_lack);
  const Place place{note_path(size)};
  const std::optional<crypto::Checkpoint> checkpoint = crypto::Checkpoint::parse(opened.text);
  if (opened.failure == crypto::NoteFailure::kMalformed || !checkpoint) {
    findings_->add("checkpoint-malformed", place,
                   place.file + " is no signed checkpoint" +
                       (opened.explanation.empty() || checkpoint ? "" : ": " + opened.explanation));
    return std::nullopt;
  }
  if (device_ && opened.failure == crypto::NoteFailure::kBadSignature) {
    findings_->add("checkpoint-signature-invalid", place, place.file + ": " + opened.explanation);
    return std::nullopt;
  }
  if (device_ && lacks_ml_dsa && !may_lack) {
    findings_->add("checkpoint-ml-dsa-missing", place, place.file + ": " + opened.explanation);
    return std::nullopt;
  }
  if (device_ && opened.failure && !may_lack) {
    findings_->add(
        "checkpoint-unknown-key", place,
        place.file + " is not signed by the device " + device_->name() + ": " + opened.explanation);
    return std::nullopt;
  }
  if (opened.by_ml_dsa) {
    alone_until_.ml_dsa = 0;
  }
  if (device_ && device_->hardware() && !opened.by_hardware && size > alone_until_.hardware) {
    ++hardware_missing_;
  }
  std::vector<std::string> unchecked = opened.unchecked;
  const auto take_unchecked = [&](const std::string& name) -> std::uint64_t {
    return std::erase_if(unchecked, [&](const std::string& key) { return key.starts_with(name + "+"); }) > 0;
  };
  if (device_ && !device_->ml_dsa()) {
    unchecked_.ml_dsa += take_unchecked(crypto::MlDsaVerifierKey::name_of(device_->name()));
  }
  if (device_ && !device_->hardware()) {
    unchecked_.hardware += take_unchecked(crypto::HardwareVerifierKey::name_of(device_->name()));
  }
  if (device_ && !unchecked.empty()) {
    findings_->add("checkpoint-cosigned", place,
                   place.file + " is signed in the names of " + std::to_string(unchecked.size()) +
                       (unchecked.size() == 1 ? " key" : " keys") +
                       " beside the device's, which were not checked: " + some_of(unchecked));
  }
  if (checkpoint->size != size) {
    findings_->add("checkpoint-size-differs", place,
                   place.file + " states a tree of " + std::to_string(checkpoint->size) + " entries");
    return std::nullopt;
  }
  return checkpoint;
}

void CheckpointRules::reached(std::uint64_t size, const RootTest& fits, bool tree_known,
                              std::optional<std::int64_t> mono_ns, bool is_told) {
  if (!has(size)) {
    return;
  }
  if (mono_ns) {
    mono_[size] = *mono_ns;
  }
  const std::optional<crypto::OpenedNote> note = opened(size);
  if (!note) {
    return;
  }
  ++count_;
  const std::optional<crypto::Checkpoint> checkpoint = check_note(size, *note);
  if (!checkpoint || !tree_known) {
    return;
  }
  // A changed `open` makes every origin foreign: the root says so, too, and names the ledger.
  const bool foreign = device_ && checkpoint->origin != origin_;
  if (foreign) {
    findings_->add("checkpoint-of-other-origin", {note_path(size)},
                   note_path(size) + " is of \"" + checkpoint->origin + "\", not of \"" + origin_ + "\"");
  }
  if (fits(checkpoint->root)) {
    if (!foreign) fitting_.insert(size);
    if (!foreign && device_) newest_fitting_ = JudgedNote{size, checkpoint->root, hashes_.at(size)};
    covered_ = foreign ? covered_ : size;
    covered_by_.ml_dsa = foreign || !note->by_ml_dsa ? covered_by_.ml_dsa : size;
    covered_by_.hardware = foreign || !note->by_hardware ? covered_by_.hardware : size;
    return;
  }
  if (!changed_ && !is_told) {
    changed_ = true;
    findings_->add("ledger-changed", {std::string(kLedgerFile), covered_},
                   "entries " + std::to_string(covered_) + " to " + std::to_string(size - 1) +
                       " are not those of which " + note_path(size) +
                       " was signed: at least one was changed, added, removed or moved");
  }
}

void CheckpointRules::finish(std::uint64_t size) {
  const auto beyond = std::upper_bound(sizes_.begin(), sizes_.end(), size);
  for (auto each = beyond; each != sizes_.end(); ++each) {
    const std::optional<crypto::OpenedNote> note = opened(*each);
    const std::optional<crypto::Checkpoint> checkpoint = note ? check_note(*each, *note) : std::nullopt;
    if (!checkpoint) {
      continue;
    }
    if (device_ && checkpoint->origin != origin_) {
      findings_->add("checkpoint-of-other-origin", {note_path(*each)},
                     note_path(*each) + " is of \"" + checkpoint->origin + "\", not of \"" + origin_ + "\"");
      continue;
    }
    findings_->add("ledger-cut", {note_path(*each), size},
                   note_path(*each) + " covers " + std::to_string(*each) + " entries and there are " +
                       std::to_string(size) + ": the end of the ledger was removed");
  }
}

void CheckpointRules::judge_keys(std::uint64_t claims, EntriesBy vouched) {
  if (!device_ || covered_ == 0) {
    return;
  }
  const bool by_ml_dsa = judge_ml_dsa(claims, vouched.ml_dsa);
  const bool by_hardware = judge_hardware(claims, vouched.hardware);
  if (!all_signed_) {
    signatures_checked_ = SignaturesChecked::kNone;
  } else if (by_hardware) {
    signatures_checked_ = by_ml_dsa ? SignaturesChecked::kAll : SignaturesChecked::kHardware;
  } else {
    signatures_checked_ = by_ml_dsa ? SignaturesChecked::kBoth : SignaturesChecked::kEd25519;
  }
}

bool CheckpointRules::judge_ml_dsa(std::uint64_t claims, std::uint64_t vouched) {
  if (!device_->ml_dsa()) {
    if (unchecked_.ml_dsa > 0) {
      findings_->add("checkpoint-ml-dsa-unchecked", {},
                     counted(unchecked_.ml_dsa, "checkpoint carries", "checkpoints carry") +
                         " a signature in the name of the ML-DSA key of " + device_->name() +
                         ", which was not given: it was not checked. The device's identity file, "
                         "device.identity, holds that key");
    }
    return false;
  }
  if (std::max(covered_by_.ml_dsa, vouched) >= std::min(claims, covered_)) {
    return true;
  }
  findings_->add(
      "checkpoint-not-by-both", {},
      "the device " + device_->name() +
          " signs by ML-DSA, too, and no such signature that was given covers entry " +
          std::to_string(std::min(claims, covered_) - 1) +
          ": this may be from before it had that key, or be made by whoever can forge Ed25519. The "
          "newest appliance log, or a proof from it, can tell");
  return false;
}

bool CheckpointRules::judge_hardware(std::uint64_t claims, std::uint64_t vouched) {
  if (!device_->hardware()) {
    if (unchecked_.hardware > 0) {
      findings_->add("checkpoint-hardware-unchecked", {},
                     counted(unchecked_.hardware, "checkpoint carries", "checkpoints carry") +
                         " a signature in the name of the key in the hardware of " + device_->name() +
                         ", which was not given: it was not checked. The device's identity file, "
                         "device.identity, holds that key");
    }
    return false;
  }
  if (std::max(covered_by_.hardware, vouched) < std::min(claims, covered_)) {
    findings_->add(
        "checkpoint-not-by-hardware", {},
        "the device " + device_->name() +
            " has a key that its hardware does not give away, and no signature by it that was given "
            "covers entry " +
            std::to_string(std::min(claims, covered_) - 1) +
            ": the hardware did not sign, this is from before it had that key, or somebody with a "
            "copy of the device's other keys made it. The recorder's log says when its hardware was "
            "silent, and is worth no more than its own signatures by hardware");
    return false;
  }
  if (hardware_missing_ > 0) {
    findings_->add("checkpoint-hardware-missing", {},
                   counted(hardware_missing_, "checkpoint has", "checkpoints have") +
                       " no signature by the hardware of " + device_->name() +
                       ", which did not sign then; a later signature by it covers their entries");
  }
  return true;
}

}  // namespace kiroku::archive

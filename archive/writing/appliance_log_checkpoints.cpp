#include <algorithm>
#include <cerrno>
#include <limits>
#include <utility>

#include "archive/format/case_layout.h"
#include "archive/writing/appliance_log_state.h"
#include "archive/writing/log_case_begin.h"
#include "base/error.h"

namespace kiroku::archive {

namespace fs = std::filesystem;

crypto::VerifierKey ApplianceLog::State::device_of_log() const {
  if (!device.ml_dsa()) return device;
  const StatedInLog::StatedKey* const own = in_log.own_ml_dsa();
  return device.with_ml_dsa(*device.ml_dsa(),
                            own != nullptr ? own->entry : std::numeric_limits<std::uint64_t>::max());
}

crypto::VerifierKey ApplianceLog::State::by_ed25519() const { return {device.name(), key.public_key()}; }

std::optional<OwnCheckpoint> ApplianceLog::State::own_checkpoint(std::uint64_t size) const {
  return checkpoint_of(folder, device_of_log(), size, files);
}

std::optional<OwnCheckpoint> ApplianceLog::State::newest_own_checkpoint() const {
  const std::vector<std::uint64_t> sizes = note_sizes_in(files, folder);
  for (auto size = sizes.rbegin(); size != sizes.rend(); ++size) {
    if (std::optional<OwnCheckpoint> own = own_checkpoint(*size)) return own;
  }
  return std::nullopt;
}

std::uint64_t ApplianceLog::State::newest_own_size() const {
  const std::optional<OwnCheckpoint> newest = newest_own_checkpoint();
  return newest ? newest->checkpoint.size : 0;
}

std::uint64_t ApplianceLog::State::covered_size() const {
  const std::optional<OwnCheckpoint> known = remembered();
  const std::uint64_t here = std::max({known ? known->checkpoint.size : 0, kept_size, signed_until});
  try {
    return std::max(newest_own_size(), here);
  } catch (const Error&) {
    return known ? here : Ledger::kNobodyKnows;
  }
}

std::optional<OwnCheckpoint> ApplianceLog::State::remembered() const {
  const std::optional<std::string> note = memory.newest ? memory.newest() : std::nullopt;
  return note ? as_own(*note, device_of_log()) : std::nullopt;
}

void ApplianceLog::State::take_remembered() {
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
         folder.string() + " was not there any more, though this device signed it: somebody took it away. " +
         and_then);
}

bool ApplianceLog::State::read_own_of_now(bool& damaged) {
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

bool ApplianceLog::State::read_newest_fitting() {
  try {
    const std::uint64_t newer = newest_fitting(signed_until, device_of_log());
    if (newer > signed_until) {
      signed_until = newer;
      signed_root.reset();
    }
    // Also where what follows cannot be read.
    const std::uint64_t covered = std::max(in_log.covered_until(), signed_until);
    in_log.is_covered_until(covered);
    in_log.is_covered_until(std::max(covered, newest_fitting(covered, by_ed25519())));
    return true;
  } catch (const Error&) {
    return false;
  }
}

std::uint64_t ApplianceLog::State::newest_fitting(std::uint64_t known, const crypto::VerifierKey& by) const {
  std::vector<std::uint64_t> sizes = note_sizes_in(files, folder);
  std::erase_if(sizes, [&](std::uint64_t size) { return size <= known || size > ledger->size(); });
  return sizes.empty() ? 0 : newest_that_fits(files, folder, by, sizes);
}

std::optional<crypto::Sha256Digest> ApplianceLog::State::root_of_first(std::uint64_t size) const {
  if (size == ledger->size()) return ledger->root();
  if (size > ledger->size()) return std::nullopt;
  const std::vector<crypto::Sha256Digest> roots = roots_of_lines(files, ledger->file(), {size});
  return roots.empty() ? std::nullopt : std::optional(roots.front());
}

void ApplianceLog::State::is_signed_until(std::uint64_t size,
                                          const std::optional<crypto::Sha256Digest>& root) {
  signed_until = size;
  in_log.is_covered_until(size);
  signed_root = root;
}

void ApplianceLog::State::compare_locked(const std::optional<crypto::Checkpoint>& expected) {
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
        damage_stated = std::ranges::any_of(in_log.damages(), [&](const StatedInLog::StatedDamage& each) {
          return is_that_damage(each.damage);
        });
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

std::string ApplianceLog::State::what_lacks(const crypto::Checkpoint& expected,
                                            const std::optional<crypto::Sha256Digest>& root) const {
  if (!root) return "it has " + std::to_string(ledger->size()) + " entries";
  return *root == expected.root ? "" : "its entries are others";
}

bool ApplianceLog::State::checkpoint_locked() {
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

bool ApplianceLog::State::write_checkpoint() {
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

}  // namespace kiroku::archive

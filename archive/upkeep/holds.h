// Legal holds of cases as the appliance log states them (docs/reference/format-recovery.md, "Legal hold").
// Functions and a lock; one thread at a time.
#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "base/descriptor.h"
#include "base/utc_time.h"
#include "crypto/signed_note.h"

namespace kiroku::archive {

struct Hold {
  std::uint64_t entry = 0;  // of the log: its number, by which a release names it
  UtcTime since;
  std::string reason, who;
};

/// Of each case that the log says was ever held the holds that stand, oldest first; none where all were
/// released.
using Holds = std::map<std::string, std::vector<Hold>>;

/// Reads the whole log. A hold counts with or without a checkpoint of its own, a release only with one by
/// `device`, the home's: what somebody adds to the log releases nothing, whatever key they let the log name.
/// `seen` is a checkpoint of the log that others saw. Throws kiroku::Error where nobody knows what is held:
/// the log does not fit its newest checkpoint or `seen`, is shorter than `seen`, tells of more than starts of
/// the machine without any checkpoint, that is not signed by `device`, or the log is not there while a case
/// that was recorded beside one lies in the archive. An archive without either holds nothing.
Holds read_holds(const std::filesystem::path& log_folder, const crypto::VerifierKey& device,
                 const std::optional<crypto::Checkpoint>& seen = {});

/// "it is under legal hold since 2026-11-26T20:15:00.000000Z (entry 12 of the appliance log, by anna): court
/// order", of several the oldest and how many more; "" where none stands.
std::string why_held(const Holds& holds, const std::string& case_id);

/// The turn of one process to erase, or to state a hold or its release: no erasure begins while a hold is
/// being stated. Waits for the others, five minutes at most.
class ErasingTurn {
 public:
  /// Throws kiroku::Error.
  explicit ErasingTurn(const std::filesystem::path& archive);

 private:
  Descriptor folder_;
};

}  // namespace kiroku::archive

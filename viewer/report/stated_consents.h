// What an appliance log states of written consent to the use of one case, for documents. A function;
// thread-safe.
#pragma once

#include <filesystem>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "archive/upkeep/consents.h"
#include "crypto/signed_note.h"

namespace kiroku::report {

struct StatedConsents {
  std::vector<archive::Consent> entries;  // as they were entered
  /// Why nobody can tell; "" where it could be read. Then no entry counts, and none is listed.
  std::string problem;
};

/// Of the log in a folder, by whichever of the devices its newest checkpoint is; it must go on from `seen` as
/// for archive::read_holds(). Throws nothing of what lies there: that is the problem.
StatedConsents read_stated_consents(const std::filesystem::path& log_folder,
                                    std::span<const crypto::VerifierKey> devices, const std::string& case_id,
                                    const std::optional<crypto::Checkpoint>& seen = {});

}  // namespace kiroku::report

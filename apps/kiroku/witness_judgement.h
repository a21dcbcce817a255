// Who cosigned an appliance log, and whether that is as a policy asks. A function; thread-safe.
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include <nlohmann/json_fwd.hpp>

#include "archive/verify/verify_options.h"
#include "crypto/signed_note.h"
#include "crypto/witness_policy.h"

namespace kiroku::apps {

struct WitnessJudgement {
  std::string note;           // the one that tells most; empty where none could be used
  std::uint64_t entries = 0;  // of the log that it covers
  crypto::WitnessedNote witnessed;
  std::vector<std::string> unused;  // why other notes tell nothing, a sentence each

  /// "the first 42 entries were cosigned by …": lines for people, each with its newline.
  [[nodiscard]] std::string text() const;
  [[nodiscard]] nlohmann::ordered_json json() const;
};

/// Only a note counts that the device signed of this very log, and whose root is that of the log's first
/// entries. Of several the one with a quorum and most entries is told. kiroku::Error where the log cannot be
/// read.
WitnessJudgement judge_log_witnesses(const std::filesystem::path& log_folder,
                                     const crypto::VerifierKey& device, const crypto::WitnessPolicy& policy,
                                     const std::vector<archive::OutsideNote>& notes);

}  // namespace kiroku::apps

// Who cosigned an appliance log, and whether that is as a policy asks. A function; thread-safe.
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include <nlohmann/json_fwd.hpp>

#include "archive/verify/verify_options.h"
#include "base/utc_time.h"
#include "crypto/signed_note.h"
#include "crypto/witness_policy.h"

namespace kiroku::apps {

struct WitnessJudgement {
  std::string note;               // the one that tells most; empty where none could be used
  std::uint64_t entries = 0;      // of the log that it covers
  std::uint64_t log_entries = 0;  // all that are here
  /// When the first entry that it does not cover was made, by the recorder's clock.
  std::optional<UtcTime> first_unwitnessed;
  bool asks_for_none = false;  // the policy: then a quorum says nothing
  crypto::WitnessedNote witnessed;
  std::vector<std::string> unused;  // why other notes tell nothing, a sentence each

  /// "the first 42 entries were cosigned by …": lines for people, each with its newline.
  [[nodiscard]] std::string text() const;
  [[nodiscard]] nlohmann::ordered_json json() const;
};

/// What is said of entries: "witnessed as the policy asks", or that they are not, or need not be.
std::string witnessed_words(bool asks_for_none, bool quorum);
/// "w1 cosigned, at 2026-11-26 14:00:03 +0000 by its clock".
std::string cosigner_words(const crypto::WitnessedNote::Cosigner& cosigner);

/// Whether the device signed the note as a checkpoint of its log.
bool is_of_log(const archive::OutsideNote& note, const crypto::VerifierKey& device);

/// Only a note counts that the device signed of this very log, and whose root is that of the log's first
/// entries, of which there must be one. Of several the one with a quorum and most entries is told.
/// By options.policy cosignatures may have ended, as the log's own signatures. kiroku::Error where the log
/// cannot be read.
WitnessJudgement judge_log_witnesses(const std::filesystem::path& log_folder,
                                     const crypto::VerifierKey& device, const crypto::WitnessPolicy& policy,
                                     const std::vector<archive::OutsideNote>& notes,
                                     const archive::VerifyOptions& options = {});

}  // namespace kiroku::apps

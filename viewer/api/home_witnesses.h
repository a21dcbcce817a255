// The home's own policy of witnesses, and its log's newest checkpoint that they cosigned, for judging a case.
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "archive/verify/report.h"
#include "archive/verify/verify_options.h"
#include "crypto/witness_policy.h"

namespace kiroku::viewer {

/// Read anew for each verification: both change while a viewer runs. Not thread-safe.
class HomeWitnesses {
 public:
  /// `folder` is the home; of an empty one there are none. What is there and cannot be used keeps no case
  /// from being judged: say() tells it.
  HomeWitnesses(const std::filesystem::path& folder, const crypto::VerifierKey& device);
  /// Until the verification is over this must live. Nothing where the home has no policy.
  void ask_in(archive::VerifyOptions& options) const;
  void say(archive::VerificationReport& report) const;
  /// The log's newest checkpoint that they cosigned; none where the home has no policy, or no such note.
  [[nodiscard]] std::vector<archive::OutsideNote> notes() const {
    return note_ ? std::vector{*note_} : std::vector<archive::OutsideNote>{};
  }

 private:
  std::optional<crypto::WitnessPolicy> policy_;
  std::optional<archive::OutsideNote> note_;
  std::string problem_;
};

}  // namespace kiroku::viewer

// Which logs and witnesses count, and how many of these must have cosigned (C2SP tlog-policy.md). Immutable;
// thread-safe.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "crypto/cosignature.h"
#include "crypto/signed_note.h"

namespace kiroku::crypto {

class WitnessPolicy {
 public:
  struct Log {
    VerifierKey key;
    std::string url;  // may be empty
  };
  struct Witness {
    std::string name;  // in the policy only
    CosignerKey key;
    std::string url;  // its submission prefix; may be empty
  };
  /// At most so many of each, and so many members of all groups.
  static constexpr std::size_t kMost = 1000;

  /// `name` stands in errors. kiroku::Error with the line for what is not the format: unknown words, keys
  /// that are none or stand twice, names that are not defined before or stand twice, a threshold that cannot
  /// be met, no quorum or several.
  static WitnessPolicy parse(std::string_view text, const std::string& name);

  [[nodiscard]] const std::vector<Log>& logs() const { return logs_; }
  [[nodiscard]] const std::vector<Witness>& witnesses() const { return witnesses_; }
  /// Whether the quorum is "none", so that nobody needs to have cosigned.
  [[nodiscard]] bool asks_for_none() const { return !quorum_; }
  /// Whether the quorum is met; `has_cosigned` for each of witnesses().
  [[nodiscard]] bool is_met(const std::vector<bool>& has_cosigned) const;
  /// Whether one of the witnesses signs with this key: whoever signs a log does not witness it.
  [[nodiscard]] bool has_witness_with(const Ed25519PublicKey& key) const;

 private:
  class Parser;
  /// A witness, or a group of earlier members.
  struct Member {
    std::optional<std::size_t> witness;
    std::size_t threshold = 0;
    std::vector<std::size_t> members;
  };
  std::vector<Log> logs_;
  std::vector<Witness> witnesses_;
  std::vector<Member> members_;  // each refers to earlier ones only
  std::optional<std::size_t> quorum_;
};

/// The algorithms whose cosignatures count.
struct CountedCosignatures {
  bool ed25519 = true;
  bool ml_dsa_44 = true;
  [[nodiscard]] bool of(CosignatureAlgorithm algorithm) const {
    return algorithm == CosignatureAlgorithm::kEd25519 ? ed25519 : ml_dsa_44;
  }
  [[nodiscard]] bool any() const { return ed25519 || ml_dsa_44; }
};

/// What a policy makes of a note that is known to be a checkpoint of a log.
struct WitnessedNote {
  struct Cosigner {
    std::string name;  // of its key, which others know it by
    CosignatureCheck check;
  };
  std::vector<Cosigner> cosigners;  // for each of the policy's witnesses
  bool quorum = false;              // enough of them cosigned
};
/// Lines of other keys are not looked at, so that a note has at most 100 signatures to check. `now_s`: a
/// cosignature of later than a day after it does not count. Those by an algorithm that does not count are
/// told as they are, and are none to the quorum.
WitnessedNote judge_witnesses(const WitnessPolicy& policy, std::string_view note, std::uint64_t now_s,
                              CountedCosignatures counted = {});

}  // namespace kiroku::crypto

// Judging cases as a person asked for it: what is trusted, what opens them, and the options that say so. The
// same for every command that verifies.
#pragma once

#include <filesystem>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "apps/verify/outside_note.h"
#include "apps/verify/verify_command.h"
#include "apps/verify/witness_judgement.h"
#include "crypto/age_recipient.h"
#include "crypto/hash.h"
#include "evidence/record_verifier.h"

namespace kiroku::apps {

/// What a person gave; the rest is VerifyExtras::defaults.
struct JudgingRequest {
  std::vector<std::string> devices, trust, own_authority, untrusted, identities, against;
  std::optional<std::string> log, threads, evidence, policy, log_proof;
  std::optional<std::string> witnesses;  // in a home its cosigned note is compared, too
  /// Opened already, beside the files of `identities`; null: none. Must outlive the Judge.
  const crypto::AgeIdentities* opened = nullptr;
  bool as_log = false;                          // the folder is an appliance log
  const archive::FileReading* files = nullptr;  // as VerifyOptions::files
  /// Nothing by which another verdict can come out than by the defaults.
  [[nodiscard]] bool names_nothing() const {
    return devices.empty() && trust.empty() && own_authority.empty() && untrusted.empty() &&
           against.empty() && !log && !evidence && !policy && !log_proof && !witnesses;
  }
};
/// `request` must live until the program has run.
void add_judging_options(Command& command, JudgingRequest& request, const VerifyExtras& extras);

/// Throws kiroku::Error where the file cannot be read, kiroku::UsageError with its line where it is no
/// policy.
evidence::Policy read_policy(const std::filesystem::path& file);
/// Likewise a policy of witnesses.
crypto::WitnessPolicy read_witnesses(const std::filesystem::path& file);

/// A file that was given, and the hash of the bytes that were taken from it: it may hold others by now.
struct TakenFile {
  std::filesystem::path file;
  crypto::Sha256Digest sha256{};
};

struct Judged {
  archive::VerificationReport report;
  bool device_trusted = false;
  std::optional<WitnessJudgement> log_witnesses;  // of a log, where a policy of witnesses was given
  // What it was judged with.
  std::vector<crypto::VerifierKey> devices;
  std::vector<TakenFile> roots, own_roots;
  std::optional<crypto::Sha256Digest> policy, witnesses;  // of their files
  std::optional<std::filesystem::path> log;
  std::vector<archive::OutsideNote> against;  // of copies their newest ones
  std::optional<archive::OutsideNote> log_proof;

  /// As the policy of witnesses asks, where one was given.
  [[nodiscard]] bool is_witnessed() const {
    return log_witnesses ? log_witnesses->witnessed.quorum : !report.witnesses || report.witnesses->is_met();
  }
};

/// Holds keys for as long as it lives. Not thread-safe.
class Judge {
 public:
  /// Reads keys and identities; may ask for a passphrase. Throws kiroku::Error.
  Judge(const JudgingRequest& request, const VerifyExtras& extras);
  /// Shows progress on a terminal. Throws kiroku::Error for a case that cannot be read at all.
  [[nodiscard]] Judged judge(const std::filesystem::path& folder) const;
  /// By what judge() will judge the evidence record of a case in this folder. Throws kiroku::Error.
  void with_rules(const std::filesystem::path& folder,
                  const std::function<void(const evidence::JudgingRules&)>& work) const;

 private:
  /// The roots that were given, else those of the defaults; what they were taken from comes into `judged`.
  [[nodiscard]] timestamp::TrustStore trust_by(const VerifyDefaults& defaults, Judged& judged) const;
  /// The cosigned note of the home, where witnesses are asked about and no log was named.
  [[nodiscard]] std::optional<archive::OutsideNote> home_note(const VerifyDefaults& defaults) const;

  const JudgingRequest& request_;
  const VerifyExtras& extras_;
  std::vector<crypto::VerifierKey> devices_;
  crypto::AgeIdentities identities_;
  KeptOutside against_;
  std::optional<archive::OutsideNote> log_proof_;
  std::optional<evidence::Policy> policy_;
  std::optional<crypto::WitnessPolicy> witnesses_;
  std::optional<crypto::Sha256Digest> policy_hash_, witnesses_hash_;
  unsigned threads_ = 0;
};

}  // namespace kiroku::apps

// Two appliance logs side by side: whether one goes on from the other, and where they part. A device signs
// one history. Two that part, both signed by its key behind that place, prove that it told two people
// different things, whoever shows them and whatever else is trusted. Functions; thread-safe.
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "archive/verify/finding.h"
#include "archive/verify/verify_options.h"
#include "crypto/hash.h"
#include "crypto/signed_note.h"

namespace kiroku::archive {

/// What a walk over a log keeps for a comparison: 32 bytes an entry, 16 a checkpoint, and the key of each
/// device that signed any. None is left out, however many a log names: among them is the one that signed two
/// histories.
struct SignedLog {
  /// A checkpoint in the folder: signed by the device of then, and of just these lines.
  struct Signed {
    std::uint64_t size = 0;
    std::size_t device = 0;  // in `devices`
  };

  std::vector<crypto::Sha256Digest> lines;  // their leaf hashes, from entry 0 on, as far as all can be read
  bool whole = false;                       // these are all lines
  std::string first_device;                 // the verifier key that the first entry names; empty: none
  std::vector<std::string> devices;         // the keys that checkpoints hold by, in their order
  std::vector<Signed> checkpoints;          // by size
};

/// One of the two: a log, or a checkpoint of one that was kept without its log.
struct LogHistory {
  std::string name;  // in sentences
  SignedLog log;
  std::optional<std::string> note;  // the kept checkpoint; then `log` is empty
  std::vector<Finding> damage;      // what does not hold in the log by itself; its cases are not looked for
  /// Its last lines have no checkpoint, where a recorder that did not stop signs one for each.
  bool tail_unsigned = false;

  /// How many entries, from the first on, a checkpoint covers that holds.
  [[nodiscard]] std::uint64_t covered() const {
    return log.checkpoints.empty() ? 0 : log.checkpoints.back().size;
  }
};
/// Judges the log by itself. Of `options` count the threads alone: whose log it is, is said and not judged.
/// Throws kiroku::Error where the folder cannot be read or is no log.
LogHistory read_history(const std::filesystem::path& folder, const VerifyOptions& options);
LogHistory history_of_note(const OutsideNote& note);

enum class HistoryRelation {
  kSame,
  kFirstBegins,   // the second goes on from the first
  kSecondBegins,  // the first goes on from the second
  kForked,
  kOtherDevices,  // not one device's: there is nothing to compare
  kUnknown,       // what was given does not tell
};
std::string_view relation_name(HistoryRelation relation);  // "first-begins"

struct HistoryComparison {
  /// Who signed one of two that part: by its first checkpoint behind that place.
  struct Signer {
    std::string device;
    crypto::Checkpoint checkpoint;
  };
  HistoryRelation relation = HistoryRelation::kUnknown;
  /// So many entries are the same, from the first on; the next differs where they are forked. Nothing where
  /// checkpoints alone do not tell.
  std::optional<std::uint64_t> common;
  /// Of kForked: by one device's key where it signed both, else by whoever did; nothing where nobody did.
  std::optional<Signer> first, second;
  std::string why;  // kOtherDevices, kUnknown: in one sentence

  /// One key signed both: no accident does this, and nobody else than the key's holder.
  [[nodiscard]] bool two_histories() const {
    return relation == HistoryRelation::kForked && first && second && first->device == second->device;
  }
};
/// `trusted`: further keys by which a kept checkpoint may be signed. Those that the other one's log names
/// count in any case: what is asked is whether one key signed both.
HistoryComparison compare_histories(const LogHistory& first, const LogHistory& second,
                                    const std::vector<crypto::VerifierKey>& trusted);

}  // namespace kiroku::archive

// A case's end in the appliance log, proved without the log: a .tlog-proof of its `case-closed`
// (docs/reference/format.md, "Proofs from the log"). What travels with a receipt or an excerpt. Not
// thread-safe.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "archive/format/log_entry.h"
#include "archive/verify/checkpoint_rules.h"
#include "archive/verify/finding_list.h"
#include "archive/verify/verify_options.h"
#include "crypto/tlog_proof.h"

namespace kiroku::archive {

/// What stands in the proof's extra data: the entry's line, and for an excerpt the RFC 6962 consistency proof
/// from the tree of `part_size` entries of the case to that of the entry.
struct LogProofExtra {
  std::string line;
  std::vector<crypto::Sha256Digest> consistency;

  [[nodiscard]] Bytes to_bytes() const;
  /// Nothing for what is longer than a line and 63 hashes can be, or has another form.
  static std::optional<LogProofExtra> parse(ByteView bytes);
};

/// The proof of VerifyOptions::log_proof, while a case or an excerpt is verified. It answers once, with one
/// finding; without a proof with none.
class LogProof {
 public:
  /// Judges the proof by itself. Everything referred to must outlive the object.
  LogProof(const VerifyOptions& options, FindingList& findings);

  /// The case's tree has `size` entries, and `fits` tells whether a root is its.
  void reached(std::uint64_t size, const RootTest& fits);
  /// Whose end it must prove. A device speaks for its own cases alone, and another key of its name is another
  /// device's.
  struct OfCase {
    std::string id;
    std::optional<crypto::VerifierKey> device;  // that `open` names
  };
  /// The case has `entries` entries; `read`: they were read to their end.
  void finish(const OfCase& of, std::uint64_t entries, bool read);
  /// Of an excerpt: its case's first `size` entries have this root, by its lines and proofs; nothing where
  /// they do not lead to one.
  void finish_part(const OfCase& of, std::uint64_t size, const std::optional<crypto::Sha256Digest>& root);

  /// What it proves, once it holds.
  struct Proved {
    std::string name;            // of the proof
    std::uint64_t entry = 0;     // of the log
    std::uint64_t entries = 0;   // of the case, that are those with which it ended
    CaseClosedEntry end;         // what the entry says
    crypto::Checkpoint log;      // that holds it
    std::string note;            // the same, signed and cosigned
    crypto::VerifierKey signer;  // the case's device
  };
  [[nodiscard]] const std::optional<Proved>& proved() const { return proved_; }
  /// So many of the case's entries.
  [[nodiscard]] std::uint64_t entries_proved() const { return proved_ ? proved_->entries : 0; }
  /// Of `known` and what it proves itself, under signatures by these keys of the case's device, the larger.
  /// As LogComparison::vouched_by, but of hardware it proves nothing: it does not show the log's root from
  /// before the hardware signed.
  [[nodiscard]] EntriesBy vouched_by(EntriesBy known) const;

 private:
  /// By itself.
  void judge(const OutsideNote& given, const std::vector<crypto::VerifierKey>& devices);
  void refuse(const std::string& why);
  /// Whether the entry is of this case, in the log of its device; else it answers.
  bool is_of(const OfCase& of);
  void hold(std::uint64_t entries, const std::string& of_what);

  FindingList* findings_;
  std::string name_;
  bool answered_ = false;
  std::optional<crypto::TlogProof> proof_;
  std::optional<CaseClosedEntry> entry_;
  std::optional<crypto::Checkpoint> checkpoint_;
  std::vector<crypto::Sha256Digest> consistency_;
  std::optional<bool> root_fits_;
  std::vector<crypto::VerifierKey> signers_;   // trusted ones, of the checkpoint
  std::optional<crypto::VerifierKey> signer_;  // of these the case's device, with what is known of it
  std::optional<Proved> proved_;
};

}  // namespace kiroku::archive

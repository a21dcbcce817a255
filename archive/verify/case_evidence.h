// A case's evidence record against the case (docs/reference/format-evidence.md). Functions; thread-safe.
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "archive/verify/brackets.h"
#include "archive/verify/case_data.h"
#include "archive/verify/finding_list.h"
#include "archive/verify/report.h"
#include "archive/verify/verify_options.h"
#include "evidence/record_verifier.h"

namespace kiroku::archive {

/// The record's bytes; nothing where nothing lies there. Throws kiroku::Error for what is no regular file, is
/// larger than a record may be, or cannot be read.
std::optional<Bytes> read_evidence_file(const FileReading& files, const std::filesystem::path& file);

/// What a record covers of a case, and what it proves.
struct CaseEvidence {
  evidence::RecordJudgement judgement;
  /// Sizes of those beginnings of the ledger that any of its chains covers, rising.
  std::vector<std::uint64_t> covered_lines;
  std::vector<NamedFile> covered_files;  // those named by the last of these lines
  std::uint64_t lines = 0;               // that its first chain covers: these it proves from the beginning
  /// Of the ledger's first lines, those that were covered by a time-stamp before `end`.
  [[nodiscard]] std::uint64_t lines_covered_before(UtcTime end) const;
  std::string refusal;           // why it does not hold for this case; empty: it does
  bool could_not_check = false;  // it was not refused: something is missing to tell
};
/// The data is read under each hash of the record but SHA-256, for which what the ledger states counts:
/// whoever asks has compared the files with that, or does. What was `taken` meanwhile is not read again.
/// Throws kiroku::Error where data cannot be read or has changed.
CaseEvidence judge_case_evidence(const CaseFolder& folder, const CaseData& data,
                                 const evidence::EvidenceRecord& record, const evidence::JudgingRules& rules,
                                 const FileHashes& taken = {});

/// Under which hashes beside SHA-256 the case's record names its data, each once: those that files are hashed
/// under while they are checked, so that no file is read again to judge the record. Nothing where there is no
/// record, where it cannot be read, or where it covers nothing of this case's ledger, which judging says.
std::vector<crypto::HashAlgorithm> further_hashes_of_case(const CaseFolder& folder,
                                                          const std::string& case_id,
                                                          const VerifyOptions& options);
/// As above, of an excerpt, whose ledger cannot tell whether the record covers it.
std::vector<crypto::HashAlgorithm> further_hashes_of_excerpt(const CaseFolder& folder,
                                                             const std::string& case_id,
                                                             const VerifyOptions& options);

/// How many of the ledger's first lines some chain of the record covers, whether it holds or not; 0: of none.
/// Reads the ledger alone. Throws kiroku::Error where it cannot be read or has changed.
std::uint64_t covered_lines(const CaseFolder& folder, const CaseData& data,
                            const evidence::EvidenceRecord& record);

/// A case as it was verified, as far as its record is judged by it.
struct VerifiedCase {
  std::string case_id;
  std::uint64_t entries = 0;
  crypto::Sha256Digest root{};                      // RFC 6962, over their lines
  std::vector<timestamp::SignatureUse> signatures;  // on which its valid tokens rest
  std::vector<StampedToken> tokens, outside;  // its valid ones, and those of outside authorities among them
};
/// Judges the record of a case that was verified and not found tampered with; adds what it finds. `taken` are
/// the hashes that verifying it took. Sets
/// `evidence` of the report, which is nothing where there is no record, and takes back what the report says
/// of time where by the policy an algorithm of the time-stamps ended and no record carries their proof on.
void check_case_evidence(const CaseFolder& folder, const VerifiedCase& verified, const FileHashes& taken,
                         const VerifyOptions& options, FindingList& findings, VerificationReport& report);

/// Of what has no evidence record, as a log: adds what the policy says of it, and that a record that was
/// given was not judged. `what`: "an appliance log".
void check_without_evidence(const std::string& what, const VerifyOptions& options,
                            const std::vector<timestamp::SignatureUse>& signatures, FindingList& findings);

/// Adds what comparing a case or an excerpt with an appliance log found, all of it in `of_log`. No record
/// covers a log: once SHA-256 or Ed25519 ended by the policy, anybody can have written it since. That it
/// agrees proves nothing then, and what speaks against the case is told as a doubt.
void take_log_findings(FindingList& of_log, const VerifyOptions& options, FindingList& findings);

/// What an excerpt shows of what a record covers.
struct ExcerptData {
  std::uint64_t size = 0;        // its lines lead to the note of this size
  std::vector<NamedFile> files;  // notes, tokens and segments that lie in it as they lie in the case
  std::uint64_t resealed = 0;    // segments that do not: they were sealed anew for a reader
};
/// Of an excerpt the record proves the checkpoint to which the lines lead, and the files. Whether it covers
/// the ledger's lines as such an excerpt does not show. Errors as above.
CaseEvidence judge_excerpt_evidence(const CaseFolder& folder, const ExcerptData& data,
                                    const evidence::EvidenceRecord& record,
                                    const evidence::JudgingRules& rules, const FileHashes& taken = {});
/// As check_case_evidence(), of an excerpt.
void check_excerpt_evidence(const CaseFolder& folder, const VerifiedCase& verified, const ExcerptData& data,
                            const FileHashes& taken, const VerifyOptions& options, FindingList& findings,
                            VerificationReport& report);

}  // namespace kiroku::archive

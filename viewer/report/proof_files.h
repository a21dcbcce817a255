// The files of a case by which a reader checks the report's proof of time without the case: signed
// checkpoints, time-stamp tokens, certificates of their authorities, evidence record. Functions; thread-safe.
#pragma once

#include <filesystem>
#include <optional>
#include <string_view>
#include <vector>

#include "archive/verify/verify_options.h"
#include "viewer/report/report_document.h"

namespace kiroku::report {

/// As they lie in the case's folder, of what the verification found to hold: the last checkpoint, and of the
/// tokens that the proof of time rests on the first and the last kMostTokens / 2, each with the checkpoint
/// that it is over. Then `evidence_record`, where it is given and the verification has one that holds; and
/// the case's receipt, where it has one. `input`: verification and facts of that folder. A file that cannot
/// be read, is larger than such a file may be, or is no longer what was verified is left out: the report's
/// own hashes remain. Throws kiroku::IoError where the folder cannot be opened.
std::vector<Attachment> read_proof_files(const std::filesystem::path& folder, const ReportInput& input,
                                         const std::optional<std::filesystem::path>& evidence_record);

inline constexpr std::size_t kMostTokens = 24;

/// The appliance log with which a case was verified.
struct ComparedLog {
  std::filesystem::path folder;
  crypto::VerifierKey device;              // that recorded the case, and is trusted
  std::vector<archive::OutsideNote> kept;  // checkpoints of the log that witnesses may have cosigned
};
/// The proof of the case's end in the appliance log (C2SP tlog-proof), for whoever has no log: `given`, with
/// which the case was verified, if it holds. Without a given one it is made of `log`, if that knows the end
/// of the whole case. Nothing where there is none; what keeps it from being made keeps no document from it.
std::optional<Attachment> log_proof_file(const std::filesystem::path& folder, const ReportInput& input,
                                         const std::optional<archive::OutsideNote>& given,
                                         const std::optional<ComparedLog>& log);
inline constexpr std::string_view kLogProofFile = "case.tlog-proof";

/// What a receipt carries along: the last checkpoint with all its signatures, of which the code on the page
/// has no room for the longer ones, and `log_proof`. Nothing where the case has no receipt.
std::vector<Attachment> receipt_files(const ReportInput& input, const std::optional<Attachment>& log_proof);

}  // namespace kiroku::report

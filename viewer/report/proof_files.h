// The files of a case by which a reader checks the report's proof of time without the case: signed
// checkpoints, time-stamp tokens, certificates of their authorities, evidence record. Functions; thread-safe.
#pragma once

#include <filesystem>
#include <optional>
#include <vector>

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

}  // namespace kiroku::report

// Cases and excerpts of a later version of the format than this program knows: they are not judged, since
// what looks wrong here may be right there. Functions; thread-safe.
#pragma once

#include <optional>
#include <string_view>
#include <vector>

#include "archive/format/case_folder.h"
#include "archive/verify/report.h"
#include "crypto/signed_note.h"

namespace kiroku::archive {

/// The report on a case whose first line names a later version, if its smallest checkpoint is of the lines
/// that are here: a line that was changed into that is none of a later version. Throws kiroku::IoError.
/// Where `devices` are known, one of them must have signed that checkpoint.
std::optional<VerificationReport> report_on_newer_case(const CaseFolder& folder, const ReadableFile& ledger,
                                                       const std::vector<crypto::VerifierKey>& devices);
/// Likewise on an excerpt, by `document`, which is the text of its excerpt.json and which nobody signs; or by
/// its first line, if its proof shows that to be the case's.
std::optional<VerificationReport> report_on_newer_excerpt(const CaseFolder& folder, std::string_view document,
                                                          const std::vector<crypto::VerifierKey>& devices);

}  // namespace kiroku::archive

// Cases and excerpts of a later version of the format than this program knows: what their entries say is not
// judged, since what looks wrong here may be right there. What needs no understanding of it is compared all
// the same: the roots of their first entries, and how many there are, with the log, with proofs from it, with
// checkpoints that were kept, and, of a case, with its own. Functions; thread-safe.
#pragma once

#include <optional>
#include <string_view>

#include "archive/format/case_folder.h"
#include "archive/verify/report.h"
#include "archive/verify/verify_options.h"

namespace kiroku::archive {

/// The report on a case whose first line names a later version, if its smallest checkpoint is of the lines
/// that are here: a line that was changed into that is none of a later version. Where devices are known, one
/// of them must have signed that checkpoint, for a case of its own. Throws kiroku::IoError, and kiroku::Error
/// where the log given is none.
std::optional<VerificationReport> report_on_newer_case(const CaseFolder& folder, const ReadableFile& ledger,
                                                       const VerifyOptions& options);
/// Likewise on an excerpt, by `document`, which is the text of its excerpt.json and which nobody signs; or by
/// its first line, if its proof shows that to be the case's. Its checkpoints alone are compared, where
/// devices are known.
std::optional<VerificationReport> report_on_newer_excerpt(const CaseFolder& folder, std::string_view document,
                                                          const VerifyOptions& options);

}  // namespace kiroku::archive

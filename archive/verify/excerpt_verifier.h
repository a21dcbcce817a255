// Verifying an excerpt: the same rules as for a case, over part of its ledger and with proofs in place of the
// rest. Functions; thread-safe.
#pragma once

#include <filesystem>

#include "archive/format/case_folder.h"
#include "archive/verify/report.h"
#include "archive/verify/verify_options.h"

namespace kiroku::archive {

/// Whether the folder holds an excerpt and not a case.
bool is_excerpt(const CaseFolder& folder);
/// The same; false for what is no folder or cannot be opened. An excerpt that lies in an archive is no case
/// of it, whatever its name.
bool is_excerpt(const std::filesystem::path& folder, const FileReading& files = real_reading());
/// As verify_case().
VerificationReport verify_excerpt(const CaseFolder& folder, const VerifyOptions& options);

}  // namespace kiroku::archive

// Verifying a case from its files alone (docs/reference/format.md, "Verification"). One verifier object is
// used by one thread; it uses several inside. Time grows with the folder's bytes and no faster, whatever
// stands in it; memory is bounded by archive/format/limits.h apart from a few dozen bytes an entry and some
// two hundred a file.
#pragma once

#include <filesystem>

#include "archive/verify/report.h"
#include "archive/verify/verify_options.h"

namespace kiroku::archive {

/// Throws kiroku::Error only where the case cannot be read at all (no such folder, not a case, no
/// permission). Understands both a case folder and an excerpt folder.
VerificationReport verify_case(const std::filesystem::path& folder, const VerifyOptions& options);
/// The appliance log by itself.
VerificationReport verify_log(const std::filesystem::path& folder, const VerifyOptions& options);

}  // namespace kiroku::archive

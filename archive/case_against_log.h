// Whether a case on the disk is the one that the appliance log beside it knows, as far as it knows it: asked
// before the recorder signs anything more of that case. It is no verification: whoever can write both can
// take away the end of both.
#pragma once

#include <filesystem>
#include <optional>
#include <string>

#include "crypto/signed_note.h"

namespace kiroku::archive {

/// One sentence if the ledger has another first line than the log states, another root at some size, or fewer
/// entries than the log knows; or if it was recorded on behind that first line, and `device` did not sign
/// `case-opened` in the log before another line followed there. (Where only what a
/// recovery writes follows it, power failed right after the opening and again in the recovery, which counted
/// nothing and says what it found.) Nothing if it fits,
/// or if the log does not know the case. Reads the log, then the ledger: the case may be written meanwhile.
/// Throws kiroku::Error where either cannot be read. Thread-safe.
std::optional<std::string> why_not_the_logged_case(const std::filesystem::path& case_folder,
                                                   const std::filesystem::path& log_folder,
                                                   const crypto::VerifierKey& device);

}  // namespace kiroku::archive

// Recovery of a home's archive as the programs do it, and how it is told. One thread.
#pragma once

#include <vector>

#include "apps/kiroku/home.h"
#include "archive/appliance_log.h"
#include "archive/recovery.h"
#include "recorder/stamper.h"

namespace kiroku::apps {

/// Brings every unfinished case of the home to its end, time-stamped by `authorities`, and tells the
/// catalogue. Throws kiroku::Error only where the archive cannot be looked at.
std::vector<archive::CaseRecovery> recover_home(const Home& home, const crypto::SigningKey& key,
                                                archive::ApplianceLog& log,
                                                const std::vector<recorder::NamedAuthority>& authorities,
                                                const timestamp::TrustStore& trust,
                                                const archive::RecordingLock& lock);

/// A few lines about one case, for people.
std::string recovery_text(const archive::CaseRecovery& recovery);

/// Brings the catalogue's row of a case up to date; a warning on standard error where that fails.
void refresh_catalogue(const Home& home, const std::filesystem::path& case_folder);

}  // namespace kiroku::apps

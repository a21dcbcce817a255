// Recovery of a home's archive as the programs do it, and how it is told. One thread.
#pragma once

#include <vector>

#include "apps/kiroku/home.h"
#include "archive/appliance_log.h"
#include "archive/recovery.h"
#include "recorder/authority_contact.h"

namespace kiroku::apps {

/// Brings every unfinished case of the home to its end, time-stamped by `authorities`, and tells the
/// catalogue. Tokens that do not come are put into `queue` (may be null). Throws kiroku::Error only where the
/// archive cannot be looked at.
std::vector<archive::CaseRecovery> recover_home(const Home& home, const crypto::SigningKey& key,
                                                archive::ApplianceLog& log,
                                                const std::vector<recorder::NamedAuthority>& authorities,
                                                const timestamp::TrustStore& trust,
                                                recorder::StampingQueue* queue,
                                                const archive::RecordingLock& lock);

/// A few lines about one case, for people.
std::string recovery_text(const archive::CaseRecovery& recovery);

}  // namespace kiroku::apps

// Time-stamps for what is brought to its end outside a session: recovery and retention.
#pragma once

#include <vector>

#include "archive/upkeep/recovery.h"
#include "recorder/authority_contact.h"

namespace kiroku::recorder {

/// Asks all authorities at once and waits for their answers, judged under `trust` (null: nothing is trusted).
/// One that is to be left alone is not asked, so that a dead network costs its time limit once, not once a
/// case. What did not come is put into `queue` (may be null). What is referred to must outlive the function.
/// Not thread-safe.
archive::CheckpointStamper checkpoint_stamper(const std::vector<NamedAuthority>& authorities,
                                              const timestamp::TrustStore* trust, StampingQueue* queue,
                                              const Clock& clock = Clock::system());

/// Asks nobody and waits for nothing: what is wanted is put into `queue`, and worked off while recording goes
/// on (late_stamping.h). `queue` must outlive the function.
archive::CheckpointStamper later_stamper(const std::vector<NamedAuthority>& authorities,
                                         StampingQueue& queue);

}  // namespace kiroku::recorder

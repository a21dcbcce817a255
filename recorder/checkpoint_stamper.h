// Time-stamps for what is brought to its end outside a session: recovery and retention.
#pragma once

#include <vector>

#include "archive/recovery.h"
#include "recorder/stamper.h"

namespace kiroku::recorder {

/// Asks all authorities at once and waits for their answers, judged under `trust` (null: nothing is trusted),
/// which must outlive the function. One that gave no token is not asked again: a dead network costs its time
/// limit once, not once a case. Not thread-safe.
archive::CheckpointStamper checkpoint_stamper(std::vector<NamedAuthority> authorities,
                                              const timestamp::TrustStore* trust);

}  // namespace kiroku::recorder

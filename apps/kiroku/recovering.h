// Recovery of a home's archive as the programs do it, and how it is told. One thread.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "apps/kiroku/recording_setup.h"
#include "archive/upkeep/recovery.h"
#include "recorder/authority_contact.h"

namespace kiroku::apps {

/// What the start of an unattended recorder wants otherwise than a person.
struct RecoveryWishes {
  /// As archive::RecoveryOptions::carry_on; may be empty.
  std::function<std::string(const archive::CutOffCase&)> carry_on;
  /// No authority is waited for: the queue remembers what is wanted. Has no effect without a queue.
  bool stamp_later = false;
};

/// Brings every unfinished case of the home to its end, time-stamped by `authorities`, and tells the
/// catalogue. Tokens that do not come are put into the home's queue. Throws kiroku::Error only where the
/// archive cannot be looked at.
std::vector<archive::CaseRecovery> recover_home(const WritableHome& writable,
                                                const std::vector<recorder::NamedAuthority>& authorities,
                                                const archive::RecordingLock& lock,
                                                const RecoveryWishes& wishes = {});

/// A few lines about one case, for people.
std::string recovery_text(const archive::CaseRecovery& recovery);

}  // namespace kiroku::apps

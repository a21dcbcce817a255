// The appliance log of a home, and the copy of its newest checkpoint that the home keeps outside of the
// archive: another disk in the archive's place, none, or an older copy of the log does not go unseen.
// Functions; thread-safe.
#pragma once

#include <memory>
#include <optional>
#include <string>

#include "apps/kiroku/home.h"
#include "archive/verify/verify_options.h"
#include "archive/writing/appliance_log.h"

namespace kiroku::apps {

/// Why the log in the archive is not the one of which the home keeps the newest checkpoint, with what is to
/// be done, for people; "" where it goes on from that, or none is kept.
std::string why_another_log(const Home& home);

/// Where nobody knows by the log what is held and what was consented to, as it is another one. Throws
/// kiroku::Error then.
void require_same_log(const Home& home);

/// What is kept, for whoever verifies the log; nothing where none is, or it cannot be read: then
/// why_another_log() says so.
std::optional<archive::OutsideNote> home_newest_note(const Home& home);

/// What follows is for whoever writes to the log: each of the home's processes does it so, and none cuts off
/// what another one signed, whoever takes checkpoints out of the archive.
struct OpenedLog {
  std::unique_ptr<archive::ApplianceLog> log;
  std::string why_another;  // as why_another_log() says of it
};
/// ApplianceLog::open() of the home's log. Its checkpoints are kept in the home from then on, but for those
/// of a log that is another one than the home knows; never is one kept of fewer entries than the one before.
OpenedLog open_kept_log(const Home& home, const crypto::SigningKey& key);
/// The same for a command: warnings on standard error say where the log was changed, and what lines in it are
/// not this device's.
std::unique_ptr<archive::ApplianceLog> open_log(const Home& home, const crypto::SigningKey& key);

}  // namespace kiroku::apps

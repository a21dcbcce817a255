// The checkpoint of the home's log that witnesses cosigned. Functions; thread-safe.
#pragma once

#include <optional>

#include "apps/kiroku/home.h"
#include "archive/verify/verify_options.h"
#include "crypto/signed_note.h"

namespace kiroku::apps {

/// As 'kiroku witness ask' left it. Nobody named it, so what lies in its place and is none (a pipe, a folder)
/// keeps nothing from being verified: then a warning on standard error, and nothing.
std::optional<archive::OutsideNote> home_witnessed_note(const Home& home);

/// The checkpoint that it states, if it is of the home's own log. Throws kiroku::Error where it is and does
/// not hold.
std::optional<crypto::Checkpoint> home_witnessed_checkpoint(const Home& home);

}  // namespace kiroku::apps

// Recording one case in a home, whoever it is for. One thread.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "apps/kiroku/home.h"
#include "recorder/session.h"

namespace kiroku::apps {

/// Lets `drive` make a session of `options` and run it; key, log, queue, trust and authorities are the home's
/// (`authorities` are names of kiroku.toml, none: all). Before it, the archive is locked against other
/// recorders and what one that died left behind is recovered; after it, the catalogue is told. Throws
/// kiroku::Error; a catalogue that cannot be told is a warning on standard error.
recorder::SessionResult record_case(
    const Home& home, recorder::SessionOptions options, const std::vector<std::string>& authorities,
    const std::function<recorder::SessionResult(recorder::SessionOptions)>& drive);

}  // namespace kiroku::apps

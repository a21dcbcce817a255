// Checkpoints that a person kept outside of what is verified. Functions; thread-safe.
#pragma once

#include <filesystem>

#include "archive/verify/verify_options.h"

namespace kiroku::apps {

/// From a file that holds a note, or a folder that is an earlier copy of a case or log: then its newest note.
/// Nothing is judged here. Throws kiroku::Error where there is nothing to read.
archive::OutsideNote load_outside_note(const std::filesystem::path& file_or_copy);

}  // namespace kiroku::apps

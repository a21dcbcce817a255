// Telling the catalogue of a case that has changed.
#pragma once

#include <filesystem>

#include "apps/kiroku/home.h"

namespace kiroku::apps {

/// A catalogue that cannot be written is no fault of the case: it is told, and nothing is thrown.
void tell_catalogue(const Home& home, const std::filesystem::path& folder);

}  // namespace kiroku::apps

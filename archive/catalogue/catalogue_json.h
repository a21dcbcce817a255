// A row of the catalogue, for machines. Pure, thread-safe.
#pragma once

#include <nlohmann/json_fwd.hpp>

#include "archive/catalogue/catalogue.h"

namespace kiroku::archive {

/// {"opened", "duration_ns", "state", "streams", "segments", "bytes", "tokens", "verdict", "verified"}: all
/// but the case's name, which callers say in their own way. What is not known is null.
nlohmann::ordered_json catalogue_json(const CatalogueRow& row);

}  // namespace kiroku::archive

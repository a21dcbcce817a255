// Whether a store's copy of a stream lets the appliance erase its own. Not thread-safe.
#pragma once

#include <filesystem>
#include <optional>
#include <string>

#include "base/utc_time.h"
#include "fleet/object_store.h"
#include "fleet/shipping_list.h"

namespace kiroku::fleet {

/// Nothing if the store holds the case's closed ledger and every segment of the stream that is not erased
/// yet, each of the size and hash that the ledger states, and locked at `now`; else the first reason why not,
/// a sentence. The store is asked about each of them. Throws StoreError where it does not answer,
/// kiroku::Error where the case cannot be read.
std::optional<std::string> why_not_stored(ObjectStore& store, ShippingList& list,
                                          const std::string& appliance,
                                          const std::filesystem::path& case_folder, const std::string& stream,
                                          UtcTime now);

}  // namespace kiroku::fleet

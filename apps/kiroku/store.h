// The store that a home's kiroku.toml names, ready to be asked.
#pragma once

#include "apps/kiroku/home.h"
#include "fleet/object_store.h"

namespace kiroku::apps {

/// [store] of the home, with the name that this appliance's objects begin with. Throws kiroku::UsageError
/// where there is none, or where the device's name cannot be that one.
StoreConfiguration store_of(const Home& home);
/// Reads the credentials, reaches nothing yet. Throws kiroku::UsageError.
fleet::ObjectStore open_store(const Home& home, const StoreConfiguration& of);

}  // namespace kiroku::apps

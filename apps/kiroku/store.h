// The store that a home's kiroku.toml names, ready to be asked.
#pragma once

#include <filesystem>
#include <functional>
#include <string>

#include "apps/kiroku/home.h"
#include "base/clock.h"
#include "fleet/object_store.h"

namespace kiroku::apps {

/// [store] of the home, with the name that this appliance's objects begin with. Throws kiroku::UsageError
/// where there is none, or where the device's name cannot be that one.
StoreConfiguration store_of(const Home& home);
/// Where the list of what is in that store under that name lies: another store, or another name, has another
/// list.
std::filesystem::path shipping_list_file(const Home& home, const StoreConfiguration& of);
/// Reads the credentials, reaches nothing yet. `time` says which limit of speed holds. Throws
/// kiroku::UsageError.
fleet::ObjectStore open_store(const Home& home, const StoreConfiguration& of,
                              const Clock& time = Clock::system());

/// Search notes of the home that may be shipped: a folder that may not be there. "" where the key that makes
/// them is not of the name by which the home ships, so that nobody would find by them; `tell` hears so.
std::filesystem::path search_notes_to_ship(const Home& home, const StoreConfiguration& of,
                                           const std::function<void(const std::string& sentence)>& tell);

}  // namespace kiroku::apps

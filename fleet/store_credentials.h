// The file that holds an appliance's access key and secret key of a store.
#pragma once

#include <filesystem>

#include "fleet/object_store.h"

namespace kiroku::fleet {

/// Two lines: "access_key = ..." and "secret_key = ...", in any order; empty lines and such that begin with
/// '#' are passed over. Throws kiroku::UsageError where the file is not there, can be read or written by
/// others than its owner, or holds anything else; kiroku::IoError.
StoreCredentials read_credentials(const std::filesystem::path& file);

}  // namespace kiroku::fleet

// What a folder is called. Thread-safe.
#pragma once

#include <filesystem>
#include <string>

namespace kiroku::archive {

/// The folder's own name, however it is given: "a/b/", ".".
std::string folder_name(const std::filesystem::path& folder);

}  // namespace kiroku::archive

// A folder as a tar archive (POSIX pax, where it needs more than ustar has), made while it is sent.
#pragma once

#include <filesystem>
#include <memory>
#include <string>

#include "viewer/http/response.h"

namespace kiroku::viewer {

/// Regular files and folders of `parent`/`name`, sorted by name, as `name`/…; what is neither is refused with
/// kiroku::Error when it comes up. Owners, times and permissions of this machine do not go in. `keep` lives
/// as long as the stream.
StreamBody tar_stream(const std::filesystem::path& parent, const std::string& name,
                      std::shared_ptr<const void> keep);

}  // namespace kiroku::viewer

// Where lines lie that stood in the appliance log and were not its device's. Header-only; thread-safe.
#pragma once

#include <string_view>

#include "archive/format/case_layout.h"

namespace kiroku::archive {

/// Of a folder in the archive: kLogAsideFolder, or another one beside it ("log-aside-2").
inline bool is_log_aside_name(std::string_view name) {
  return name.starts_with(kLogAsideFolder) &&
         (name.size() == kLogAsideFolder.size() || name[kLogAsideFolder.size()] == '-');
}

}  // namespace kiroku::archive

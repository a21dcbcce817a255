#include "base/error.h"

#include <cerrno>
#include <system_error>

namespace kiroku {

IoError::IoError(const std::string& action, const std::filesystem::path& path, int error_number)
    : Error("cannot " + action + " " + path.string() + ": " + std::generic_category().message(error_number)),
      error_number_(error_number) {}

bool IoError::disk_full() const { return error_number_ == ENOSPC || error_number_ == EDQUOT; }

}  // namespace kiroku

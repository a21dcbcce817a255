// A folder for what comes from the store and goes again.
#pragma once

#include <cerrno>
#include <cstdlib>
#include <filesystem>
#include <optional>
#include <string>

#include "base/error.h"

namespace kiroku::apps {

/// Gone with the object.
class ScratchFolder {
 public:
  /// Below `parent`, or where temporary files lie. Throws kiroku::IoError.
  explicit ScratchFolder(const std::optional<std::string>& parent = {}) {
    const std::filesystem::path below =
        parent ? std::filesystem::path(*parent) : std::filesystem::temp_directory_path();
    std::string name = (below / "kiroku-XXXXXX").string();
    if (::mkdtemp(name.data()) == nullptr) throw IoError("make a folder in", below, errno);
    path_ = name;
  }
  ~ScratchFolder() {
    std::error_code ignored;
    std::filesystem::remove_all(path_, ignored);
  }
  ScratchFolder(const ScratchFolder&) = delete;
  ScratchFolder& operator=(const ScratchFolder&) = delete;
  [[nodiscard]] const std::filesystem::path& path() const { return path_; }

 private:
  std::filesystem::path path_;
};

}  // namespace kiroku::apps

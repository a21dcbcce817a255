// A folder for one running server, beside those of others on the same home (kirokud's and `kiroku view`'s).
#pragma once

#include <filesystem>

#include "base/descriptor.h"

namespace kiroku::viewer {

class OwnFolder {
 public:
  /// Makes `parent` with mode 0700 if it is not there, removes from it all that no running server holds (what
  /// one that died left behind), and makes a folder in it. Throws kiroku::IoError.
  explicit OwnFolder(const std::filesystem::path& parent);
  /// Removes it with all that is in it.
  ~OwnFolder();
  OwnFolder(const OwnFolder&) = delete;
  OwnFolder& operator=(const OwnFolder&) = delete;

  [[nodiscard]] const std::filesystem::path& path() const { return path_; }

 private:
  std::filesystem::path path_;
  Descriptor
      lock_;  // held on the folder itself for as long as this lives: the kernel lets go of a dead one's
};

}  // namespace kiroku::viewer

// Archives of the shared data, unpacked for a test.
#pragma once

#include <stdexcept>

#include "tests/support/process.h"
#include "tests/support/shared_data.h"
#include "tests/support/temporary_folder.h"

namespace kiroku::test {

/// A folder with the files of a .tar.xz of the shared data.
class Unpacked {
 public:
  explicit Unpacked(const std::string& relative) {
    Process::Options unpack;
    unpack.command = {"tar",
                      "--extract",
                      "--xz",
                      "--file",
                      shared_data(relative).string(),
                      "--directory",
                      folder_.path().string()};
    if (const ProcessResult result = run_process(unpack); result.status != 0) {
      throw std::runtime_error("cannot unpack " + relative + ": " + result.err);
    }
  }
  [[nodiscard]] const std::filesystem::path& path() const { return folder_.path(); }

 private:
  TemporaryFolder folder_;
};

}  // namespace kiroku::test

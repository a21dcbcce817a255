#include "apps/train/output_folder.h"

#include <utility>

#include "apps/kiroku/output_file.h"
#include "base/error.h"

namespace kiroku::apps {

namespace fs = std::filesystem;

OutputFolder::OutputFolder(fs::path folder, std::vector<std::string> files, bool force)
    : folder_(std::move(folder)) {
  if (!force) {
    for (const std::string& file : files) {
      if (fs::exists(folder_ / file))
        throw UsageError((folder_ / file).string() + " is there already: name another folder, or --force");
    }
  }
  std::error_code failed;
  fs::create_directories(folder_, failed);
  if (failed) throw IoError("make the folder", folder_, failed.value());
}

void OutputFolder::write(const std::string& name, ByteView bytes) const {
  OutputFile file(folder_ / name);
  file.write(bytes);
  file.commit(OutputFile::Durability::kEventually);
}

}  // namespace kiroku::apps

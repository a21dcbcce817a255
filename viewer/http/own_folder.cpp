#include "viewer/http/own_folder.h"

#include <cerrno>
#include <fcntl.h>
#include <string>
#include <sys/file.h>
#include <sys/stat.h>
#include <system_error>

#include "base/error.h"

namespace kiroku::viewer {
namespace {

namespace fs = std::filesystem;

Descriptor open_folder(const fs::path& folder) {
  return Descriptor(::open(folder.c_str(), O_RDONLY | O_DIRECTORY | O_NOFOLLOW | O_CLOEXEC));
}

bool is_held(const fs::path& entry) {
  const Descriptor folder = open_folder(entry);
  return folder && ::flock(folder.number(), LOCK_EX | LOCK_NB) != 0 && errno == EWOULDBLOCK;
}

}  // namespace

OwnFolder::OwnFolder(const fs::path& parent) {
  if (::mkdir(parent.c_str(), 0700) != 0 && errno != EEXIST) throw IoError("make the folder", parent, errno);
  const Descriptor all = open_folder(parent);
  // One server at a time looks around: no folder is seen between its making and its being held.
  if (!all || ::flock(all.number(), LOCK_EX) != 0 || ::fchmod(all.number(), 0700) != 0) {
    throw IoError("use the folder", parent, errno);
  }
  std::error_code failed;
  for (const fs::directory_entry& entry : fs::directory_iterator(parent, failed)) {
    if (!is_held(entry.path())) fs::remove_all(entry.path(), failed);
    if (failed) break;
  }
  if (failed) throw IoError("empty", parent, failed.value());
  std::string name = (parent / "XXXXXX").string();
  if (::mkdtemp(name.data()) == nullptr) throw IoError("make a folder in", parent, errno);
  path_ = name;
  lock_ = open_folder(path_);
  if (!lock_ || ::flock(lock_.number(), LOCK_EX | LOCK_NB) != 0) throw IoError("hold", path_, errno);
}

OwnFolder::~OwnFolder() {
  std::error_code ignored;
  fs::remove_all(path_, ignored);
}

}  // namespace kiroku::viewer

#include "viewer/http/handout.h"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include "base/error.h"
#include "viewer/http/request.h"

namespace kiroku::viewer {
namespace {

namespace fs = std::filesystem;

/// What a download leaves free on the disk, since a recorder may need it.
constexpr std::uint64_t kAlwaysFree = 2ULL << 30;

fs::path new_folder(const fs::path& parent) {
  std::string name = (parent / "XXXXXX").string();
  if (::mkdtemp(name.data()) == nullptr) throw IoError("make a folder in", parent, errno);
  return name;
}

}  // namespace

Handouts::Handouts(const fs::path& parent) : own_(parent) {}

std::shared_ptr<const Handouts::Place> Handouts::make_place(std::uint64_t bytes) const {
  std::error_code failed;
  const fs::space_info space = fs::space(own_.path(), failed);
  if (failed || space.available < bytes + kAlwaysFree) {
    throw Refusal(
        507, "the disk has no room for this file beside what a recorder may need: choose a shorter time");
  }
  return std::make_shared<const Place>(new_folder(own_.path()));
}

Handouts::Place::Place(fs::path folder) : folder_(std::move(folder)) {}
Handouts::Place::~Place() {
  std::error_code ignored;
  fs::remove_all(folder_, ignored);
}

FileBody open_body(const fs::path& file) {
  auto descriptor =
      std::make_shared<const Descriptor>(::open(file.c_str(), O_RDONLY | O_CLOEXEC | O_NOFOLLOW));
  struct stat status {};
  if (!*descriptor || ::fstat(descriptor->number(), &status) != 0) throw IoError("read", file, errno);
  return {std::move(descriptor), 0, static_cast<std::uint64_t>(status.st_size)};
}

}  // namespace kiroku::viewer

#include "viewer/http/handout.h"

#include <fcntl.h>
#include <limits>
#include <sys/stat.h>
#include <unistd.h>
#include <utility>

#include "base/error.h"
#include "viewer/http/disk_room.h"

namespace kiroku::viewer {
namespace {

namespace fs = std::filesystem;

fs::path new_folder(const fs::path& parent) {
  std::string name = (parent / "XXXXXX").string();
  if (::mkdtemp(name.data()) == nullptr) throw IoError("make a folder in", parent, errno);
  return name;
}

}  // namespace

Handouts::Handouts(const fs::path& parent) : own_(parent) {}

std::shared_ptr<Handouts::Place> Handouts::make_place(std::uint64_t bytes) {
  const std::lock_guard guard(promised_->mutex);
  // Two that are made at once would else both be promised the same room.
  constexpr std::uint64_t kMost = std::numeric_limits<std::uint64_t>::max();
  const std::uint64_t in_all = bytes > kMost - promised_->bytes ? kMost : bytes + promised_->bytes;
  require_disk_room(own_.path(), in_all, "choose a shorter time");
  auto place = std::make_shared<Place>(new_folder(own_.path()), promised_, bytes);
  promised_->bytes += bytes;
  return place;
}

Handouts::Place::Place(fs::path folder, std::shared_ptr<Promised> promised, std::uint64_t bytes)
    : folder_(std::move(folder)), promised_(std::move(promised)), bytes_(bytes) {}

void Handouts::Place::is_made() {
  const std::lock_guard guard(promised_->mutex);
  promised_->bytes -= std::exchange(bytes_, 0);
}

Handouts::Place::~Place() {
  is_made();
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

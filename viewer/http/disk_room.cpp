#include "viewer/http/disk_room.h"

#include <string>
#include <system_error>

#include "viewer/http/request.h"

namespace kiroku::viewer {

void require_disk_room(const std::filesystem::path& folder, std::uint64_t bytes, const char* advice,
                       std::uint64_t left) {
  std::error_code failed;
  const std::filesystem::space_info space = std::filesystem::space(folder, failed);
  if (failed) {
    throw Refusal(500, "the disk of " + folder.string() + " could not be asked how much room it has (" +
                           failed.message() + "), so nothing is written: see to the disk and its mount");
  }
  const bool has_room = space.available >= left && space.available - left >= bytes;
  if (!has_room)
    throw Refusal(
        507, std::string("the disk has no room for this file beside what a recorder may need: ") + advice);
}

}  // namespace kiroku::viewer

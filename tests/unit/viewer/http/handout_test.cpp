#include "viewer/http/handout.h"

#include <gtest/gtest.h>

#include "tests/support/small_disk.h"
#include "viewer/http/disk_room.h"
#include "viewer/http/request.h"

namespace kiroku::viewer {
namespace {

constexpr std::uint64_t kMiB = std::uint64_t{1} << 20;

// Two that are made at once were both promised the room that there was for one, and the recorder's with it.
TEST(HandoutsTest, PromisesNoRoomTwice) {
  const test::SmallDisk disk(kLeftToRecorder + 100 * kMiB);
  if (!disk.mounted()) GTEST_SKIP() << "no file system can be mounted here";
  Handouts handouts(disk.path() / "files");
  const auto first = handouts.make_place(60 * kMiB);
  try {
    (void)handouts.make_place(60 * kMiB);
    ADD_FAILURE() << "both were promised the same room";
  } catch (const Refusal& refusal) {
    EXPECT_EQ(refusal.status(), 507);
  }
  auto second = handouts.make_place(30 * kMiB);
  second.reset();
  first->is_made();
  EXPECT_NO_THROW((void)handouts.make_place(60 * kMiB)) << "what is made is counted by the disk";
  EXPECT_THROW((void)handouts.make_place(UINT64_MAX), Refusal);
}

}  // namespace
}  // namespace kiroku::viewer

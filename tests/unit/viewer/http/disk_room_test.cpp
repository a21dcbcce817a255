#include "viewer/http/disk_room.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/support/temporary_folder.h"
#include "viewer/http/request.h"

namespace kiroku::viewer {
namespace {

using testing::AllOf;
using testing::HasSubstr;
using testing::Not;
using testing::Property;
using testing::ThrowsMessage;

TEST(DiskRoom, SaysThatTheDiskCouldNotBeAskedWhereItCouldNot) {
  const test::TemporaryFolder folder;
  const auto ask = [&] { require_disk_room(folder / "gone", 1, "choose a shorter time"); };
  EXPECT_THAT(ask, ThrowsMessage<Refusal>(AllOf(HasSubstr("could not be asked how much room it has"),
                                                HasSubstr("No such file"), Not(HasSubstr("has no room")))));
  EXPECT_THAT(ask, testing::Throws<Refusal>(Property(&Refusal::status, 500)));
}

TEST(DiskRoom, SaysThatThereIsNoneWhereThereIsNone) {
  const test::TemporaryFolder folder;
  const auto ask = [&] { require_disk_room(folder.path(), UINT64_MAX / 2, "choose a shorter time"); };
  EXPECT_THAT(ask,
              ThrowsMessage<Refusal>(AllOf(HasSubstr("has no room"), HasSubstr("choose a shorter time"))));
  EXPECT_THAT(ask, testing::Throws<Refusal>(Property(&Refusal::status, 507)));
}

}  // namespace
}  // namespace kiroku::viewer

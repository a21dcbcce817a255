#include "fleet/shipping_list.h"

#include <fstream>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/error.h"
#include "tests/support/temporary_folder.h"

namespace kiroku::fleet {
namespace {

using namespace std::chrono_literals;
using testing::HasSubstr;
using testing::ThrowsMessage;

const ShippedObject kSent{{4711, UtcTime(7us)}, "abc", "v1", UtcTime(1h), true};

TEST(ShippingList, RemembersWhatIsInTheStore) {
  const test::TemporaryFolder folder;
  {
    ShippingList list(folder.path() / "shipping.sqlite");
    EXPECT_TRUE(list.is_new());
    EXPECT_FALSE(list.find("or-1/a"));
    list.put("or-1/a", kSent);
    list.set_grown("log", 4096);
  }
  ShippingList list(folder.path() / "shipping.sqlite");
  EXPECT_FALSE(list.is_new());
  const auto found = list.find("or-1/a");
  ASSERT_TRUE(found);
  EXPECT_EQ(found->file, kSent.file);
  EXPECT_EQ(found->sha256, "abc");
  EXPECT_EQ(found->version, "v1");
  EXPECT_EQ(found->lock_ends, kSent.lock_ends);
  EXPECT_TRUE(found->confirmed);
  EXPECT_EQ(list.grown("log"), 4096U);
  EXPECT_EQ(list.grown("another"), 0U);
}

TEST(ShippingList, CountsWhatTheStoreConfirmed) {
  const test::TemporaryFolder folder;
  ShippingList list(folder.path() / "shipping.sqlite");
  list.put("or-1/a", kSent);
  ShippedObject sending = kSent;
  sending.confirmed = false;
  list.put("or-1/b", sending);
  EXPECT_EQ(list.confirmed().objects, 1U);
  EXPECT_EQ(list.confirmed().bytes, 4711U);
}

TEST(ShippingList, ADamagedOneIsMadeAnewAndKnowsIt) {
  const test::TemporaryFolder folder;
  const auto file = folder.path() / "shipping.sqlite";
  { ShippingList(file).put("or-1/a", kSent); }
  std::ofstream(file, std::ios::binary) << std::string(8192, 'x');
  ShippingList list(file);
  EXPECT_TRUE(list.is_new());
  EXPECT_FALSE(list.find("or-1/a"));
}

TEST(ShippingList, OneProcessShipsAtATime) {
  const test::TemporaryFolder folder;
  const auto file = folder.path() / "shipping.sqlite";
  ShippingList second(file);
  {
    ShippingList first(file);
    first.take();
    EXPECT_THAT([&] { second.take(); },
                ThrowsMessage<UsageError>(HasSubstr("another 'kiroku ship' is at work")));
  }
  EXPECT_NO_THROW(second.take());
}

}  // namespace
}  // namespace kiroku::fleet

#include "fleet/shipping_list.h"

#include <fstream>
#include <tuple>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/error.h"
#include "tests/support/temporary_folder.h"

namespace kiroku::fleet {
namespace {

using namespace std::chrono_literals;
using testing::HasSubstr;
using testing::ThrowsMessage;

const ShippedObject kSent{{4711, UtcTime(7us)}, "abc", "v1", UtcTime(1h)};

class ShippingListTest : public testing::Test {
 protected:
  const test::TemporaryFolder folder;
  const std::filesystem::path file = folder.path() / "shipping.sqlite";
};

TEST_F(ShippingListTest, RemembersWhatIsInTheStore) {
  {
    ShippingList list(file);
    EXPECT_TRUE(list.may_be_behind());
    EXPECT_FALSE(list.find("or-1/a"));
    list.before_putting();
    list.enter("or-1/a", kSent);
    list.set_grown("log", {4096, 12});
    list.set_whole("log", "ledger 7");
    EXPECT_EQ(list.hold("a"), std::nullopt);
    list.set_hold("a", true);
    list.set_hold("b", true);
    list.set_hold("b", false);
    EXPECT_FALSE(list.hold_check("a"));
    list.set_hold_check("a", {"7", UtcTime(1h)});
    list.set_hold_check("a", {"7,12", UtcTime(2h)});
    EXPECT_FALSE(list.lock_look());
    list.set_lock_look({.retention = 24h});
    list.set_lock_look({.retention = 48h,
                        .after_key = "or-1/a",
                        .looked_at = 5,
                        .lengthened = 3,
                        .failed = 1,
                        .problem = "or-1/a: why",
                        .finished = true});
    list.finish();
    EXPECT_FALSE(list.may_be_behind());
  }
  ShippingList list(file);
  EXPECT_FALSE(list.may_be_behind());
  const auto found = list.find("or-1/a");
  ASSERT_TRUE(found);
  EXPECT_EQ(found->file, kSent.file);
  EXPECT_EQ(found->sha256, "abc");
  EXPECT_EQ(found->version, "v1");
  EXPECT_EQ(found->lock_ends, kSent.lock_ends);
  EXPECT_EQ(list.grown("log").bytes, 4096U);
  EXPECT_EQ(list.grown("log").lines, 12U);
  EXPECT_EQ(list.grown("another").bytes, 0U);
  EXPECT_EQ(list.whole("log"), "ledger 7");
  EXPECT_EQ(list.hold("a"), true);
  EXPECT_EQ(list.hold("b"), false);
  EXPECT_EQ(list.hold("c"), std::nullopt);
  const auto check = list.hold_check("a");
  ASSERT_TRUE(check);
  EXPECT_EQ(check->entries, "7,12");
  EXPECT_EQ(check->at, UtcTime(2h));
  EXPECT_FALSE(list.hold_check("b"));
  const auto look = list.lock_look();
  ASSERT_TRUE(look);
  EXPECT_EQ(look->retention, 48h);
  EXPECT_EQ(look->after_key, "or-1/a");
  EXPECT_EQ(std::tuple(look->looked_at, look->lengthened, look->failed), std::tuple(5U, 3U, 1U));
  EXPECT_EQ(look->problem, "or-1/a: why");
  EXPECT_TRUE(look->finished);
  EXPECT_EQ(list.whole("another"), "");
  EXPECT_EQ(list.totals().objects, 1U);
  EXPECT_EQ(list.totals().bytes, 4711U);
}

TEST_F(ShippingListTest, AfterAProcessThatDiedTheStoreMayHoldMore) {
  {
    ShippingList list(file);
    list.finish();
  }
  {
    ShippingList list(file);
    EXPECT_FALSE(list.may_be_behind());
    list.before_putting();
    list.enter("or-1/a", kSent);
    list.keep();
    list.enter("or-1/b", kSent);
  }
  ShippingList list(file);
  EXPECT_TRUE(list.may_be_behind());
  EXPECT_TRUE(list.find("or-1/a"));
  EXPECT_FALSE(list.find("or-1/b")) << "was not kept";
  list.finish();
  EXPECT_FALSE(ShippingList(file).may_be_behind());
}

TEST_F(ShippingListTest, ADamagedOneIsMadeAnewAndMayBeBehind) {
  {
    ShippingList list(file);
    list.enter("or-1/a", kSent);
    list.finish();
  }
  std::ofstream(file, std::ios::binary) << std::string(8192, 'x');
  ShippingList list(file);
  EXPECT_TRUE(list.may_be_behind());
  EXPECT_FALSE(list.find("or-1/a"));
}

TEST_F(ShippingListTest, OneProcessShipsAtATime) {
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

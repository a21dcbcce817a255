#include "base/network_address.h"

#include <gtest/gtest.h>

#include "base/error.h"

namespace kiroku {
namespace {

TEST(AddressHolder, IsTheAddressOrItsSlash64) {
  EXPECT_EQ(address_holder("192.0.2.7"), "192.0.2.7");
  EXPECT_EQ(address_holder("::ffff:192.0.2.7"), "192.0.2.7");
  EXPECT_EQ(address_holder("2001:db8:1:2:3:4:5:6"), "2001:db8:1:2::");
  EXPECT_EQ(address_holder("2001:db8:1:2:ffff::1"), address_holder("2001:db8:1:2::9"));
  EXPECT_NE(address_holder("2001:db8:1:3::1"), address_holder("2001:db8:1:2::1"));
  EXPECT_EQ(address_holder("fe80::1%eth0"), "fe80::");
  EXPECT_EQ(address_holder("nobody"), "nobody");
}

TEST(AddressRange, ContainsWhatSharesItsBits) {
  const auto contains = [](const char* range, const char* address) {
    return AddressRange::parse(range).contains(address);
  };
  EXPECT_TRUE(contains("192.168.7.20", "192.168.7.20"));
  EXPECT_FALSE(contains("192.168.7.20", "192.168.7.21"));
  EXPECT_TRUE(contains("192.168.7.0/24", "192.168.7.255"));
  EXPECT_TRUE(contains("192.168.7.0/24", "::ffff:192.168.7.255"));
  EXPECT_FALSE(contains("192.168.7.0/24", "192.168.8.0"));
  EXPECT_TRUE(contains("10.64.0.0/10", "10.127.255.255"));
  EXPECT_FALSE(contains("10.64.0.0/10", "10.128.0.0"));
  EXPECT_TRUE(contains("0.0.0.0/0", "203.0.113.9"));
  EXPECT_FALSE(contains("0.0.0.0/0", "2001:db8::1"));
  EXPECT_TRUE(contains("::/0", "2001:db8::1"));
  EXPECT_TRUE(contains("fd00::/8", "fd12:3456::1"));
  EXPECT_FALSE(contains("fd00::/8", "fe80::1"));
  EXPECT_TRUE(contains("::1", "::1"));
  EXPECT_FALSE(contains("fd00::/8", "nonsense"));
}

TEST(AddressRange, IsReadStrictly) {
  for (const char* text : {"", "10.0.0", "10.0.0.0/33", "10.0.0.0/", "10.0.0.0/-1", "10.0.0.0/8x",
                           "fd00::/129", "monitor.local", "10.1.2.3/8", "fe80::1%eth0", " 10.0.0.1"}) {
    EXPECT_THROW(AddressRange::parse(text), UsageError) << text;
  }
  EXPECT_EQ(AddressRange::parse_list("10.0.0.0/8,192.168.7.20").size(), 2U);
  EXPECT_TRUE(any_contains(AddressRange::parse_list("10.0.0.0/8,192.168.7.20"), "192.168.7.20"));
  EXPECT_FALSE(any_contains(AddressRange::parse_list("10.0.0.0/8,192.168.7.20"), "192.168.7.21"));
  EXPECT_FALSE(any_contains({}, "192.168.7.21"));
  for (const char* text : {"", ",", "10.0.0.0/8,", "10.0.0.0/8,,::1"}) {
    EXPECT_THROW(AddressRange::parse_list(text), UsageError) << text;
  }
}

}  // namespace
}  // namespace kiroku

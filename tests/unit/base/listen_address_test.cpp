#include "base/listen_address.h"

#include <gtest/gtest.h>

#include "base/error.h"

namespace kiroku {
namespace {

TEST(ListenAddress, IsReadAndWritten) {
  for (const char* text : {"127.0.0.1:8443", "0.0.0.0:0", "[::1]:443", "[::]:65535", "192.0.2.7:3161"}) {
    EXPECT_EQ(parse_listen_address(text, 1).to_string(), text);
  }
  EXPECT_EQ(parse_listen_address("[2001:db8::7]:80", 1).host, "2001:db8::7");
}

TEST(ListenAddress, KnowsWhatIsThisMachineAlone) {
  EXPECT_TRUE(parse_listen_address("127.0.0.1:1", 1).is_loopback());
  EXPECT_TRUE(parse_listen_address("127.9.9.9:1", 1).is_loopback());
  EXPECT_TRUE(parse_listen_address("[::1]:1", 1).is_loopback());
  EXPECT_FALSE(parse_listen_address("0.0.0.0:1", 1).is_loopback());
  EXPECT_FALSE(parse_listen_address("[::]:1", 1).is_loopback());
  EXPECT_FALSE(parse_listen_address("192.0.2.7:1", 1).is_loopback());
  EXPECT_TRUE(parse_listen_address("[::]:1", 1).is_any());
  EXPECT_FALSE(parse_listen_address("127.0.0.1:1", 1).is_any());
}

TEST(ListenAddress, IsRefusedWithAnExample) {
  for (const char* text : {"", "localhost:1", "127.0.0.1", "127.0.0.1:", "127.0.0.1:65536", "127.0.0.1:-1",
                           ":80", "127.0.0.1:1x", "127.1:80", "[127.0.0.1:80", "::ffff:zz:80"}) {
    EXPECT_THROW(parse_listen_address(text, 3161), UsageError) << text;
  }
  try {
    parse_listen_address("or-3:3161", 3161);
    FAIL() << "was taken";
  } catch (const UsageError& error) {
    EXPECT_STREQ(error.what(),
                 "'or-3:3161' is no address to listen on: write it as 127.0.0.1:3161 or [::1]:3161");
  }
}

}  // namespace
}  // namespace kiroku

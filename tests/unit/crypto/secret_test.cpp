#include "crypto/secret.h"

#include <fstream>
#include <utility>

#include <gtest/gtest.h>

namespace kiroku::crypto {
namespace {

TEST(Secret, HoldsACopyAndMovesWithoutLeavingOneBehind) {
  Secret secret = Secret::copy_of("hunter2");
  EXPECT_EQ(secret.text(), "hunter2");
  Secret moved = std::move(secret);
  EXPECT_EQ(moved.text(), "hunter2");
  EXPECT_TRUE(secret.empty());  // NOLINT(bugprone-use-after-move): that it is empty is the promise
  EXPECT_TRUE(equal_constant_time(moved.clone().bytes(), moved.bytes()));
}

TEST(Secret, AssigningReplacesTheOldOne) {
  Secret secret = Secret::copy_of("old");
  secret = Secret::copy_of("newer");
  EXPECT_EQ(secret.text(), "newer");
}

TEST(Secret, StartsWithZeros) {
  const Secret secret(5000);
  for (const std::byte byte : secret.bytes()) ASSERT_EQ(byte, std::byte{0});
}

TEST(Secret, TwoRandomOnesDiffer) {
  EXPECT_FALSE(equal_constant_time(Secret::random(16).bytes(), Secret::random(16).bytes()));
}

TEST(Secret, ComparisonSeesLengthAndEachByte) {
  EXPECT_TRUE(equal_constant_time(bytes_of("abc"), bytes_of("abc")));
  EXPECT_FALSE(equal_constant_time(bytes_of("abc"), bytes_of("abd")));
  EXPECT_FALSE(equal_constant_time(bytes_of("abc"), bytes_of("abcd")));
  EXPECT_TRUE(equal_constant_time({}, {}));
}

TEST(Secret, IsExcludedFromCoreDumps) {
  // /proc/self/smaps lists "dd" (do not dump) among the flags of the mapping that holds the secret.
  const Secret secret = Secret::random(32);
  const auto address = reinterpret_cast<std::uintptr_t>(secret.bytes().data());
  std::ifstream maps("/proc/self/smaps");
  if (!maps) GTEST_SKIP() << "no /proc/self/smaps here";
  std::string line;
  bool inside = false;
  std::string flags;
  while (std::getline(maps, line)) {
    unsigned long begin = 0;
    unsigned long end = 0;
    if (std::sscanf(line.c_str(), "%lx-%lx ", &begin, &end) == 2) inside = begin <= address && address < end;
    if (inside && line.starts_with("VmFlags:")) flags = line;
  }
  if (flags.empty()) GTEST_SKIP() << "this kernel does not tell the flags of a mapping";
  EXPECT_NE(flags.find(" dd"), std::string::npos) << flags;
}

TEST(Secret, ZeroiseOverwrites) {
  Bytes bytes = to_bytes("secret");
  zeroise(bytes);
  EXPECT_EQ(bytes, Bytes(6));
}

}  // namespace
}  // namespace kiroku::crypto

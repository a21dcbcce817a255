#include "crypto/secret.h"

#include <algorithm>
#include <fstream>
#include <iterator>
#include <set>
#include <string>
#include <utility>
#include <vector>

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

// A process has 65,530 mappings, and what it may lock is little too.
TEST(Secret, ThousandsOfKeysTakeFewMappingsAndPages) {
  const auto mappings = [] {
    std::ifstream maps("/proc/self/maps");
    return std::count(std::istreambuf_iterator<char>(maps), {}, '\n');
  };
  const auto locked_kib = [] {
    std::ifstream status("/proc/self/status");
    long kib = 0;
    for (std::string line; std::getline(status, line);) {
      if (line.starts_with("VmLck:")) kib = std::stol(line.substr(6));
    }
    return kib;
  };
  constexpr std::size_t kKeys = 5000;
  const auto mappings_before = mappings();
  const long locked_before = locked_kib();
  std::vector<Secret> keys;
  for (std::size_t i = 0; i < kKeys; ++i) keys.push_back(Secret::random(32));
  EXPECT_LT(mappings() - mappings_before, 100);
  EXPECT_LE(locked_kib() - locked_before, 1024);
}

TEST(Secret, SmallOnesNeverShareBytesAndStartWithZerosAgain) {
  std::vector<Secret> secrets;
  std::set<const std::byte*> places;
  for (std::size_t i = 0; i < 1000; ++i) {
    secrets.push_back(Secret::copy_of(std::string(1 + i % 128, static_cast<char>('a' + i % 26))));
    places.insert(secrets.back().bytes().data());
  }
  EXPECT_EQ(places.size(), secrets.size());
  for (std::size_t i = 0; i < 1000; ++i)
    ASSERT_EQ(secrets[i].text(), std::string(1 + i % 128, static_cast<char>('a' + i % 26)));
  secrets.clear();
  for (std::size_t i = 0; i < 1000; ++i) {
    secrets.emplace_back(128);
    for (const std::byte byte : secrets.back().bytes()) ASSERT_EQ(byte, std::byte{0});
  }
}

TEST(Secret, ZeroiseOverwrites) {
  Bytes bytes = to_bytes("secret");
  zeroise(bytes);
  EXPECT_EQ(bytes, Bytes(6));
}

}  // namespace
}  // namespace kiroku::crypto

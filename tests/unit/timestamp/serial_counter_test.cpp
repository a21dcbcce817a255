#include "timestamp/serial_counter.h"

#include <algorithm>
#include <fstream>
#include <set>
#include <thread>
#include <vector>

#include <gtest/gtest.h>

#include "base/error.h"
#include "tests/support/temporary_folder.h"

namespace kiroku::timestamp {
namespace {

using test::TemporaryFolder;

class SerialCounterTest : public ::testing::Test {
 protected:
  void SetUp() override { SerialCounter::create(file_); }
  TemporaryFolder folder_;
  std::filesystem::path file_ = folder_ / "serial";
};

TEST_F(SerialCounterTest, CountsFromOneWithoutHoles) {
  SerialCounter counter(file_);
  for (std::uint64_t expected = 1; expected <= 2 * SerialCounter::kBlock + 1; ++expected) {
    ASSERT_EQ(counter.next(), expected);
  }
}

TEST_F(SerialCounterTest, SkipsTheRestOfABlockAfterARestart) {
  EXPECT_EQ(SerialCounter(file_).next(), 1U);
  EXPECT_EQ(SerialCounter(file_).next(), SerialCounter::kBlock + 1);
}

TEST_F(SerialCounterTest, NeverRepeatsBetweenProcesses) {
  // Two counters on one file stand for two processes: each lock is taken on its own open file.
  SerialCounter first(file_);
  SerialCounter second(file_);
  std::vector<std::uint64_t> of_first(3 * SerialCounter::kBlock);
  std::vector<std::uint64_t> of_second(of_first.size());
  std::thread other(
      [&] { std::generate(of_second.begin(), of_second.end(), [&] { return second.next(); }); });
  std::generate(of_first.begin(), of_first.end(), [&] { return first.next(); });
  other.join();
  std::set<std::uint64_t> all(of_first.begin(), of_first.end());
  all.insert(of_second.begin(), of_second.end());
  EXPECT_EQ(all.size(), of_first.size() + of_second.size());
}

TEST_F(SerialCounterTest, IsNeverGuessedWhenDamagedOrGone) {
  for (const char* text :
       {"", "0\n", "-1\n", "12", "12\n\n", " 12\n", "012\n", "18446744073709551615\n", "x\n"}) {
    std::ofstream(file_) << text;
    EXPECT_THROW(SerialCounter{file_}, Error) << text;
  }
  std::filesystem::remove(file_);
  EXPECT_THROW(SerialCounter{file_}, IoError);
}

TEST_F(SerialCounterTest, IsNotMadeTwice) { EXPECT_THROW(SerialCounter::create(file_), IoError); }

TEST_F(SerialCounterTest, GivesNothingThatItCouldNotReserve) {
  SerialCounter counter(file_);
  // The neighbour that a reservation writes to cannot be made.
  std::filesystem::create_directory(folder_ / "serial.part");
  EXPECT_THROW(counter.next(), IoError);
  std::filesystem::remove(folder_ / "serial.part");
  EXPECT_EQ(counter.next(), 1U);
}

}  // namespace
}  // namespace kiroku::timestamp

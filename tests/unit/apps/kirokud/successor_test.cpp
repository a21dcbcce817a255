#include "apps/kirokud/successor.h"

#include <fstream>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/support/eventually.h"
#include "tests/support/moved_clock.h"
#include "tests/support/temporary_folder.h"

namespace kiroku::apps {
namespace {

using namespace std::chrono_literals;
using testing::ElementsAre;
using testing::HasSubstr;

/// A program in whose place another one is put, which notes that it was asked.
class SuccessorTest : public testing::Test {
 protected:
  SuccessorTest() { install(0); }

  /// As a package manager does it.
  void install(int status) const {
    const std::filesystem::path made = folder.path() / "made";
    std::ofstream(made) << "#!/bin/sh\necho \"$@\" >> '" << asked().string() << "'\nexit " << status << "\n";
    std::filesystem::permissions(made, std::filesystem::perms::owner_all);
    std::filesystem::rename(made, program());
  }
  [[nodiscard]] std::filesystem::path program() const { return folder.path() / "kirokud"; }
  [[nodiscard]] std::filesystem::path asked() const { return folder.path() / "asked"; }
  [[nodiscard]] int times_asked() const {
    std::ifstream in(asked());
    int lines = 0;
    for (std::string line; std::getline(in, line); ++lines) EXPECT_EQ(line, "--check --home h");
    return lines;
  }

  test::TemporaryFolder folder;
  test::MovedClock time;
  bool is_replaced = true;
  std::vector<std::string> told;
  Successor successor{{"--check", "--home", "h"},
                      {.own_file = [this] { return program().string() + (is_replaced ? " (deleted)" : ""); },
                       .tell = [this](const std::string& sentence) { told.push_back(sentence); }},
                      time};
};

TEST_F(SuccessorTest, IsNotThereWhileTheProgramIsTheSame) {
  is_replaced = false;
  EXPECT_FALSE(successor.is_there());
  EXPECT_FALSE(successor.is_ready());
  EXPECT_EQ(times_asked(), 0);
}

// The recorder may have to wait for a day.
TEST_F(SuccessorTest, IsAskedOnceHoweverLongTheRecorderWaits) {
  ASSERT_TRUE(test::eventually([this] { return successor.is_there(); }));
  for (int second = 0; second < 200; ++second) {
    time.move(1s);
    ASSERT_TRUE(successor.is_there()) << second;
  }
  EXPECT_EQ(times_asked(), 1);
  // Right before the recorder ends it is asked for the configuration of now.
  EXPECT_FALSE(successor.is_ready());
  ASSERT_TRUE(test::eventually([this] { return successor.is_ready(); }));
  EXPECT_TRUE(successor.is_ready());
  EXPECT_EQ(times_asked(), 2);
  EXPECT_TRUE(told.empty());
}

TEST_F(SuccessorTest, AnotherOneIsAskedAnew) {
  ASSERT_TRUE(test::eventually([this] { return successor.is_there(); }));
  install(2);
  ASSERT_TRUE(test::eventually([this] {
    EXPECT_FALSE(successor.is_there());
    return !told.empty();
  }));
  EXPECT_EQ(times_asked(), 2);
}

TEST_F(SuccessorTest, OneThatRefusesIsToldOnceAndAskedAgain) {
  install(2);
  const auto has_answered = [this](int times) {
    return test::eventually([&] {
      EXPECT_FALSE(successor.is_ready());
      return times_asked() == times && !told.empty();
    });
  };
  ASSERT_TRUE(has_answered(1));
  EXPECT_THAT(told, ElementsAre(HasSubstr("--check does not take the configuration: this one goes on")));
  EXPECT_FALSE(successor.is_there());
  EXPECT_EQ(times_asked(), 1) << "not at once";
  time.move(10s);
  ASSERT_TRUE(has_answered(2));
  EXPECT_EQ(told.size(), 1U);
}

}  // namespace
}  // namespace kiroku::apps

#include "viewer/api/verification_runner.h"

#include <condition_variable>
#include <mutex>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/support/eventually.h"
#include "tests/support/sample_case.h"

namespace kiroku::viewer {
namespace {

using test::eventually;
using testing::ElementsAre;

/// Copies of one case, each verification of which ends when the test lets it.
class VerificationRunnerTest : public testing::Test {
 protected:
  std::filesystem::path copy(const std::string& name) const {
    const std::filesystem::path to = folder_ / name;
    std::filesystem::copy(sample_, to, std::filesystem::copy_options::recursive);
    return to;
  }
  VerificationRunner::Options options() {
    return {archive_.options(),
            [this](const std::filesystem::path& folder, const archive::VerificationReport& /*report*/) {
              std::unique_lock lock(mutex_);
              done_.push_back(folder.filename());
              changed_.notify_all();
              changed_.wait(lock, [this] { return done_.size() <= may_end_; });
            }};
  }
  void let_end(std::size_t count) {
    const std::lock_guard guard(mutex_);
    may_end_ = count;
    changed_.notify_all();
  }
  std::vector<std::string> done() {
    const std::lock_guard guard(mutex_);
    return done_;
  }

  test::SampleArchive archive_;
  const std::filesystem::path sample_ = test::SampleCase::write(archive_);
  const test::TemporaryFolder folder_;
  std::mutex mutex_;
  std::condition_variable changed_;
  std::vector<std::string> done_;
  std::size_t may_end_ = 0;
};

TEST_F(VerificationRunnerTest, NobodysManyCasesAreBeforeAnothersOne) {
  VerificationRunner runner(options());
  for (const char* name : {"a1", "a2", "a3", "a4"}) EXPECT_TRUE(runner.start(copy(name), "user anna"));
  ASSERT_TRUE(eventually([&] { return done().size() == 1; }));
  EXPECT_TRUE(runner.start(copy("b1"), "user ben"));
  EXPECT_TRUE(runner.start(copy("b2"), "user ben"));
  EXPECT_TRUE(runner.start(folder_ / "a4", "user ben")) << "anna's, too";
  let_end(100);
  ASSERT_TRUE(eventually([&] { return done().size() == 6; }));
  EXPECT_THAT(done(), ElementsAre("a1", "a4", "a2", "b1", "a3", "b2"));
  EXPECT_TRUE(eventually([&] {
    const auto state = runner.state(folder_ / "a3");
    return state && state->report;
  }));
}

TEST_F(VerificationRunnerTest, NobodyTakesAllPlacesOfThoseThatWait) {
  VerificationRunner runner(options());
  EXPECT_TRUE(runner.start(copy("a1"), "user anna"));
  ASSERT_TRUE(eventually([&] { return done().size() == 1; }));
  int taken = 0;
  for (int i = 0; i < 100; ++i)
    taken += runner.start(folder_ / ("missing-" + std::to_string(i)), "user anna") ? 1 : 0;
  EXPECT_EQ(taken, 16);
  EXPECT_TRUE(runner.start(copy("b1"), "user ben"));
  let_end(100);
  EXPECT_TRUE(eventually([&] { return done().size() == 2; }));
  EXPECT_THAT(done(), ElementsAre("a1", "b1"));
}

}  // namespace
}  // namespace kiroku::viewer

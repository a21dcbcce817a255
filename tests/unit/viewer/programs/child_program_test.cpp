#include "viewer/programs/child_program.h"

#include <csignal>
#include <fstream>
#include <poll.h>
#include <unistd.h>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/support/temporary_folder.h"
#include "viewer/programs/comparison_program.h"

namespace kiroku::viewer {
namespace {

using namespace std::chrono_literals;
using testing::HasSubstr;

/// A shell script in the place of `kiroku`.
class AProgram : public testing::Test {
 protected:
  std::filesystem::path script(const std::string& text) {
    const std::filesystem::path file = folder_ / "program";
    std::ofstream(file) << "#!/bin/sh\n" << text << "\n";
    std::filesystem::permissions(file, std::filesystem::perms::owner_all);
    return file;
  }
  ComparisonProgramEnd run(const std::string& text, std::chrono::milliseconds limit,
                           const ComparisonProgramCall& call = {}) {
    ComparisonProgramCall asked = call;
    asked.limit = limit;
    const auto begin = std::chrono::steady_clock::now();
    ComparisonProgramEnd end = run_comparison_program(
        script(text), asked, {},
        [this](const std::string& doing, std::optional<double> /*share*/) { doing_ += doing + "."; }, stop_);
    took_ = std::chrono::steady_clock::now() - begin;
    return end;
  }

  test::TemporaryFolder folder_;
  std::atomic<bool> stop_{false};
  std::string doing_;
  std::chrono::duration<double> took_{};
};

TEST_F(AProgram, IsGivenItsArgumentsItsInputAndAFurtherFile) {
  const ComparisonProgramEnd end =
      run("echo \"$@\"; cat; cat /dev/fd/4; echo '{\"doing\":\"much\",\"share\":null}' >&2\n"
          "echo 'kiroku: warning: none' >&2; echo 'kiroku: no such case' >&2; exit 2",
          20s, {.arguments = {"CASE"}, .input = "said\n", .further_file = "geometry\n", .limit = {}});
  EXPECT_EQ(end.status, 2);
  EXPECT_FALSE(end.overdue);
  EXPECT_EQ(end.out, "compare --identity-socket 3 CASE\nsaid\ngeometry\n");
  EXPECT_EQ(end.problem, "no such case");
  EXPECT_EQ(doing_, "much.");
}

TEST_F(AProgram, ThatTakesTooLongIsEnded) {
  const ComparisonProgramEnd end = run("exec sleep 100", 300ms);
  EXPECT_TRUE(end.overdue);
  EXPECT_EQ(end.status, -1);
  EXPECT_LT(took_, 100s) << "its end was not waited for";
}

TEST_F(AProgram, IsEndedByForceWhereItDoesNotListenAndItsOwnChildrenAreNotWaitedFor) {
  // Whoever is asked before the shell has set its trap ends at once; on a busy machine that takes more than a
  // moment.
  const ComparisonProgramEnd end = run("trap '' TERM; sleep 100 & while :; do wait; done", 5s);
  EXPECT_TRUE(end.overdue);
  EXPECT_EQ(end.status, -1);
  EXPECT_GT(took_, 10s) << "it was asked first";
  EXPECT_LT(took_, 100s) << "its end was not waited for";
}

TEST_F(AProgram, ThatClosesItsEndsAndStaysIsEnded) {
  const ComparisonProgramEnd end = run("exec >&- 2>&-; exec sleep 100", 20s);
  EXPECT_EQ(end.status, -1);
  EXPECT_LT(took_, 100s) << "its end was not waited for";
}

TEST_F(AProgram, IsStopped) {
  stop_ = true;
  const ComparisonProgramEnd end = run("exec sleep 100", 20s);
  EXPECT_FALSE(end.overdue) << "a person stopped it";
  EXPECT_EQ(end.status, -1);
  EXPECT_LT(took_, 100s) << "its end was not waited for";
}

/// Where the handler of this test writes.
int pipe_of_handler = -1;

TEST_F(AProgram, NeverRunsAHandlerOfTheServer) {
  const DescriptorPair pipe = make_pipe();
  pipe_of_handler = pipe.theirs.number();
  struct sigaction action {
  }, before{};
  action.sa_handler = [](int) { static_cast<void>(!::write(pipe_of_handler, "x", 1)); };
  ::sigaction(SIGTERM, &action, &before);
  // Asked to end at once: it has not become another program yet.
  for (int i = 0; i < 20; ++i) {
    ChildProgram child("/bin/sleep", {"100"}, {}, ChildPriority::kAnswering);
    child.ask_to_end();
    EXPECT_EQ(child.wait(20s), -1);
  }
  ::sigaction(SIGTERM, &before, nullptr);
  pollfd waiting{pipe.ours.number(), POLLIN, 0};
  EXPECT_EQ(::poll(&waiting, 1, 0), 0) << "nothing was written";
  sigset_t blocked;
  ::pthread_sigmask(SIG_SETMASK, nullptr, &blocked);
  EXPECT_EQ(sigismember(&blocked, SIGTERM), 0) << "the server hears again";
}

TEST_F(AProgram, ThatIsNotThereIsSaidToBe) {
  const ComparisonProgramEnd end = run_comparison_program(
      folder_ / "nothing", {.arguments = {}, .input = {}, .further_file = {}, .limit = 5s}, {},
      [](const std::string&, std::optional<double>) {}, stop_);
  EXPECT_THAT(end.problem, HasSubstr("cannot be started; install Kiroku anew"));
}

}  // namespace
}  // namespace kiroku::viewer

#include "viewer/programs/plan_picker.h"

#include <atomic>
#include <fstream>
#include <thread>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/support/eventually.h"
#include "tests/support/moved_clock.h"
#include "tests/support/temporary_folder.h"
#include "viewer/http/request.h"

namespace kiroku::viewer {
namespace {

using namespace std::chrono_literals;
using testing::HasSubstr;
namespace fs = std::filesystem;

/// A shell script in the place of `kiroku plan pick`, which notes each start.
class Picker : public testing::Test {
 protected:
  PlanPicker::Options options(const std::string& text) {
    const fs::path file = folder_ / "program";
    std::ofstream(file) << "#!/bin/sh\necho \"$@\" >> " << (folder_ / "starts").string() << "\n"
                        << text << "\n";
    fs::permissions(file, fs::perms::owner_all);
    return {.program = file, .clock = &clock_};
  }
  [[nodiscard]] std::vector<std::string> starts() const {
    std::vector<std::string> all;
    std::ifstream in(folder_ / "starts");
    for (std::string line; std::getline(in, line);) all.push_back(line);
    return all;
  }
  /// Asks until the plan is ready, as the page does.
  static PickingAnswer ask(PlanPicker& picker, const std::string& seal, const std::string& who,
                           const std::string& question) {
    PickingAnswer answer;
    EXPECT_TRUE(test::eventually([&] {
      answer = picker.ask(seal, who, question);
      return answer.ready;
    })) << "never ready";
    return answer;
  }
  /// Its status and sentence.
  template <typename Act>
  static std::pair<int, std::string> refusal(Act act) {
    try {
      if (test::eventually([&] { return act().ready; })) return {200, ""};
      return {202, "never ready"};
    } catch (const Refusal& refused) {
      return {refused.status(), refused.what()};
    }
  }
  /// What a script does to wait for open_gate().
  [[nodiscard]] std::string wait_at_gate() const {
    return "while [ ! -e " + gate().string() + " ]; do sleep 0.02; done";
  }
  void open_gate() const { std::ofstream(gate()) << "open"; }
  [[nodiscard]] fs::path gate() const { return folder_ / "gate"; }
  static constexpr const char* kEcho = "echo ready; while read -r line; do echo \"to $line\"; done";

  test::MovedClock clock_;
  test::TemporaryFolder folder_;
};

TEST_F(Picker, TellsWhatIsDoneUntilThePlanIsReadyAndThenAnswers) {
  PlanPicker picker(options("echo '{\"doing\":\"carrying out the plan\",\"share\":0.5}' >&2\n" +
                            wait_at_gate() + "\n" + kEcho));
  const PickingAnswer first = picker.ask("a.seal.json", "mori", "1");
  EXPECT_FALSE(first.ready) << "at once";
  PickingAnswer second;
  while (second.doing.empty() && !second.ready) second = picker.ask("a.seal.json", "mori", "1");
  EXPECT_EQ(second.doing, "carrying out the plan");
  EXPECT_EQ(second.share, 0.5);
  EXPECT_FALSE(second.ready);
  open_gate();
  EXPECT_EQ(ask(picker, "a.seal.json", "mori", "2").text, "to 2");
  EXPECT_EQ(ask(picker, "a.seal.json", "sato", "3").text, "to 3") << "of the same plan";
  EXPECT_EQ(starts(), std::vector<std::string>{"plan pick a.seal.json"});
}

TEST_F(Picker, AnswersManyAtATimeOneAfterTheOther) {
  PlanPicker picker(options(kEcho));
  EXPECT_EQ(ask(picker, "a.seal.json", "mori", "0").text, "to 0");
  std::vector<std::jthread> askers;
  for (int n = 0; n < 4; ++n) {
    askers.emplace_back([&picker, n] {
      for (int i = 0; i < 20; ++i) {
        const std::string text = std::to_string(100 * n + i);
        EXPECT_EQ(picker.ask("a.seal.json", n % 2 == 0 ? "mori" : "sato", text).text, "to " + text);
      }
    });
  }
}

TEST_F(Picker, RefusesWhoeverWouldWaitBehindTooMany) {
  PlanPicker picker(options("echo ready; read -r line; echo \"to $line\"; while read -r line; do " +
                            wait_at_gate() + "; echo \"to $line\"; done"));
  EXPECT_EQ(ask(picker, "a.seal.json", "mori", "0").text, "to 0");
  std::atomic<int> answered = 0, refused = 0;
  {
    std::vector<std::jthread> askers;
    for (int n = 0; n < 12; ++n) {
      askers.emplace_back([&, who = "mori " + std::to_string(n % 4)] {
        const auto [status, sentence] = refusal([&] { return picker.ask("a.seal.json", who, "1"); });
        ++(status == 200 ? answered : refused);
        EXPECT_THAT(status, testing::AnyOf(200, 503)) << sentence;
      });
    }
    while (refused < 8) std::this_thread::yield();
    open_gate();
  }
  EXPECT_EQ(answered, 4) << "one, and three who wait";
  EXPECT_EQ(refused, 8);
}

TEST_F(Picker, LeavesATurnForOthersThanWhoAsksForAll) {
  PlanPicker picker(options("echo ready; read -r line; echo \"to $line\"; while read -r line; do " +
                            wait_at_gate() + "; echo \"to $line\"; done"));
  EXPECT_EQ(ask(picker, "a.seal.json", "mori", "0").text, "to 0");
  std::atomic<int> answered = 0, refused = 0;
  {
    std::vector<std::jthread> askers;
    for (int n = 0; n < 12; ++n) {
      askers.emplace_back([&] {
        const auto [status, sentence] = refusal([&] { return picker.ask("a.seal.json", "mori", "1"); });
        ++(status == 200 ? answered : refused);
      });
    }
    EXPECT_TRUE(test::eventually([&] { return refused == 9; })) << "the fourth turn is somebody else's";
    open_gate();
  }
  EXPECT_EQ(answered, 3);
}

TEST_F(Picker, GoesToAnotherPlanForWhoeverHasIt) {
  PlanPicker picker(options(kEcho));
  EXPECT_EQ(ask(picker, "a.seal.json", "mori", "1").text, "to 1");
  EXPECT_EQ(ask(picker, "b.seal.json", "mori", "2").text, "to 2") << "one person's own";
  const auto [status, sentence] = refusal([&] { return picker.ask("a.seal.json", "sato", "3"); });
  EXPECT_EQ(status, 409);
  EXPECT_THAT(sentence, HasSubstr("mori picks points on another plan"));
  clock_.move(1min);
  EXPECT_EQ(ask(picker, "a.seal.json", "sato", "4").text, "to 4") << "nobody asked for a while";
  EXPECT_EQ(starts().size(), 3U);
}

TEST_F(Picker, SaysWhyAPlanCannotBeShownAndTriesAgain) {
  PlanPicker picker(options("echo 'kiroku: the plan names no CT' >&2; exit 2"));
  for (int times = 1; times <= 2; ++times) {
    const auto [status, sentence] = refusal([&] { return picker.ask("a.seal.json", "mori", "1"); });
    EXPECT_EQ(status, 422);
    EXPECT_EQ(sentence, "the plan names no CT");
    EXPECT_EQ(starts().size(), static_cast<std::size_t>(times));
  }
}

TEST_F(Picker, EndsWhatTakesTooLong) {
  PlanPicker::Options slow = options("exec sleep 100");
  slow.to_prepare = 300ms;
  slow.clock = &Clock::system();
  {
    PlanPicker picker(slow);
    const auto [status, sentence] = refusal([&] { return picker.ask("a.seal.json", "mori", "1"); });
    EXPECT_EQ(status, 504);
    EXPECT_THAT(sentence, HasSubstr("took too long"));
  }
  PlanPicker::Options silent = options("echo ready; exec sleep 100");
  silent.to_answer = 300ms;
  silent.clock = &Clock::system();
  PlanPicker picker(silent);
  const auto [status, sentence] = refusal([&] { return picker.ask("a.seal.json", "mori", "1"); });
  EXPECT_EQ(status, 504);
  EXPECT_THAT(sentence, HasSubstr("ended"));
  EXPECT_FALSE(picker.ask("a.seal.json", "mori", "1").ready) << "told once; the next question begins anew";
}

TEST_F(Picker, EndsWhenNobodyAsks) {
  PlanPicker picker(options(kEcho));
  EXPECT_EQ(ask(picker, "a.seal.json", "mori", "1").text, "to 1");
  clock_.await_waiting(1);
  clock_.move(5min);
  EXPECT_FALSE(picker.ask("a.seal.json", "mori", "2").ready) << "it is begun anew";
  EXPECT_EQ(ask(picker, "a.seal.json", "mori", "2").text, "to 2");
  EXPECT_EQ(starts().size(), 2U);
}

}  // namespace
}  // namespace kiroku::viewer

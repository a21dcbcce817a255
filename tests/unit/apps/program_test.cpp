#include <array>
#include <filesystem>
#include <string>
#include <system_error>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "apps/common/command_line.h"

namespace kiroku::apps {
namespace {

TEST(Program, TellsWhichPathAFileSystemErrorIsAbout) {
  Program program("kiroku", "records", "");
  program.root().add_command("look", "looks").on_run([]() -> int {
    throw std::filesystem::filesystem_error("status", "/there/round",
                                            std::make_error_code(std::errc::too_many_symbolic_link_levels));
  });
  testing::internal::CaptureStderr();
  const std::array<const char*, 2> words{"kiroku", "look"};
  EXPECT_EQ(program.run(static_cast<int>(words.size()), words.data()), kRefused);
  EXPECT_EQ(testing::internal::GetCapturedStderr(),
            "kiroku: cannot reach /there/round: Too many levels of symbolic links\n");
}

/// A command that takes files by itself, and has another below it.
class CommandsBelow : public testing::Test {
 protected:
  struct Outcome {
    int status;
    std::string out, err;
  };
  Outcome run(std::vector<const char*> words) {
    words.insert(words.begin(), "kiroku");
    Program program("kiroku", "records", "");
    Command& measure = program.root().add_command("measure", "measures films");
    measure.arguments("CLIP", clips, "a film");
    measure.on_run([this] {
      done = "measured";
      return kDone;
    });
    Command& study = measure.add_command("study", "shows films");
    study.argument("FOLDER", folder, "where");
    study.on_run([this] {
      done = "studied";
      return kDone;
    });
    testing::internal::CaptureStdout();
    testing::internal::CaptureStderr();
    const int status = program.run(static_cast<int>(words.size()), words.data());
    return {status, testing::internal::GetCapturedStdout(), testing::internal::GetCapturedStderr()};
  }

  std::vector<std::string> clips;
  std::string folder, done;
};

TEST_F(CommandsBelow, AreToldFromWhatTheCommandTakesItself) {
  EXPECT_EQ(run({"measure", "a.mkv", "b.mkv"}).status, kDone);
  EXPECT_EQ(done, "measured");
  EXPECT_THAT(clips, testing::ElementsAre("a.mkv", "b.mkv"));
  EXPECT_EQ(run({"measure", "study", "reading"}).status, kDone);
  EXPECT_EQ(done, "studied");
  EXPECT_EQ(folder, "reading");
}

TEST_F(CommandsBelow, LeaveItsArgumentsRequired) {
  const Outcome none = run({"measure"});
  EXPECT_EQ(none.status, kRefused);
  EXPECT_EQ(none.err, "kiroku: CLIP is required; see 'kiroku measure --help'\n");
  EXPECT_EQ(done, "");
  EXPECT_THAT(run({"measure", "study"}).err, testing::HasSubstr("FOLDER is required"));
  const std::string help = run({"measure", "--help"}).out;
  EXPECT_THAT(help,
              testing::HasSubstr("Usage: kiroku measure [OPTIONS] CLIP...\n       kiroku measure COMMAND\n"));
  EXPECT_THAT(help, testing::HasSubstr("Commands:\n  study "));
}

}  // namespace
}  // namespace kiroku::apps

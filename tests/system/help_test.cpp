#include <fstream>

#include "tests/support/build_paths.h"
#include "tests/system/program_test.h"

namespace kiroku::test {
namespace {

using testing::HasSubstr;

const std::vector<Arguments> kCommands{{"init"},
                                       {"devices"},
                                       {"record"},
                                       {"cases"},
                                       {"sim", "solve"},
                                       {"sim", "render"},
                                       {"plan", "pick"},
                                       {"plan", "replay"},
                                       {"plan", "serve"},
                                       {"verify"},
                                       {"export"},
                                       {"excerpt"},
                                       {"seal"},
                                       {"unseal"},
                                       {"token", "verify"},
                                       {"tsa", "serve"},
                                       {"log"},
                                       {"log", "compare"},
                                       {"witness", "serve"},
                                       {"sim", "beam"},
                                       {"completion"},
                                       {"recover"},
                                       {"erase"},
                                       {"train", "haptic-rate"},
                                       {"train", "predict"},
                                       {"train", "power"},
                                       {"train", "budget"},
                                       {"train", "exclusion"},
                                       {"train", "serve"},
                                       {"train", "study"},
                                       {"train", "trainee"},
                                       {"train", "results"},
                                       {"report"}};

class Help : public ProgramTest {
 protected:
  [[nodiscard]] std::string page(Arguments command) const {
    command.emplace_back("--help");
    const ProcessResult result = kiroku(command);
    EXPECT_EQ(result.status, 0);
    EXPECT_EQ(result.err, "");
    return result.out;
  }
};

TEST_F(Help, ShowsHowToStartWithoutArguments) {
  const ProcessResult overview = kiroku({});
  EXPECT_EQ(overview.status, 0);
  EXPECT_THAT(overview.out, HasSubstr("kiroku init --demo"));
  EXPECT_THAT(overview.out, HasSubstr("kiroku verify CASE"));
}

TEST_F(Help, TellsTheVersion) {
  EXPECT_THAT(kiroku({"--version"}).out, testing::MatchesRegex("kiroku [0-9]+[.][0-9]+[.][0-9]+\n"));
}

TEST_F(Help, ListsEveryCommandAndExplainsEachWithAnExample) {
  const std::string overview = page({});
  for (const Arguments& command : kCommands) {
    EXPECT_THAT(overview, HasSubstr("\n  " + command[0] + " "));
    const std::string text = page(command);
    EXPECT_THAT(text, testing::ContainsRegex("^kiroku [a-z -]+ - ")) << command[0];
    EXPECT_THAT(text, HasSubstr("\nUsage: kiroku " + command[0])) << command[0];
    EXPECT_THAT(text, testing::ContainsRegex("\nExamples?:\n")) << command[0];
    EXPECT_THAT(text, HasSubstr("--help")) << command[0];
  }
}

TEST_F(Help, RefusesWhatItDoesNotKnowInOneSentenceWithAHint) {
  EXPECT_REFUSED(kiroku({"recrod"}), "'recrod'");
  EXPECT_REFUSED(kiroku({"record", "--endoscpe", "x"}), "'--endoscpe'");
  EXPECT_REFUSED(kiroku({"record", "--endoscpe", "x"}), "see 'kiroku record --help'");
  EXPECT_REFUSED(kiroku({"record", "--profile", "h264"}), "--profile");
  EXPECT_REFUSED(kiroku({"record", "--room", "a", "--room", "b"}), "--room may be given only once");
  EXPECT_REFUSED(kiroku({"record", "--endoscope"}), "--endoscope");
  EXPECT_REFUSED(kiroku({"export", "x", "-o", "y"}), "--stream");
  EXPECT_REFUSED(kiroku({"verify"}), "CASE");
  EXPECT_REFUSED(kiroku({"token"}), "verify");
  EXPECT_REFUSED(kiroku({"completion", "fish"}), "fish");
}

TEST_F(Help, AsksWhatWasMeantInEveryProgram) {
  EXPECT_REFUSED(kiroku({"recrod"}), "did you mean 'record'?");
  EXPECT_REFUSED(kiroku({"caes"}), "did you mean 'case'?");
  EXPECT_REFUSED(kiroku({"expotr", "a-case", "another"}), "did you mean 'export'?");
  EXPECT_REFUSED(kiroku({"case", "strat"}), "did you mean 'start'?");
  EXPECT_REFUSED(kiroku({"sim", "rendr"}), "did you mean 'render'?");
  EXPECT_REFUSED(kiroku({"plan", "repaly"}), "did you mean 'replay'?");
  EXPECT_REFUSED(kiroku({"sim", "solve", "--ouptut", "x"}), "did you mean '--output'?");
  EXPECT_REFUSED(kiroku({"record", "--endoscpe", "x"}), "did you mean '--endoscope'?");
  EXPECT_REFUSED(kiroku({"record", "--profile", "losless"}), "did you mean 'lossless'?");
  EXPECT_REFUSED(kiroku({"completion", "zhs"}), "did you mean 'zsh'?");
  EXPECT_THAT(kiroku({"frobnicate"}).err, testing::Not(HasSubstr("did you mean")));
  EXPECT_REFUSED(tool({built_file("kiroku-verify"), "x", "--devcie", "y"}), "did you mean '--device'?");
  const ProcessResult daemon = tool({built_file("kirokud"), "--chekc"});
  EXPECT_EQ(daemon.status, 2);
  EXPECT_THAT(daemon.err, HasSubstr("did you mean '--check'?"));
}

// Commands are listed once; what the small programs answer is what that list says.
TEST_F(Help, NamesEveryCommandInTheOverview) {
  const std::string overview = kiroku({}).out;
  for (const Arguments& command : kCommands) EXPECT_THAT(overview, HasSubstr(command[0])) << command[0];
}

TEST_F(Help, CompletionForBashIsValidAndKnowsEveryOption) {
  const std::string script = kiroku({"completion", "bash"}).out;
  write_text(folder() / "completion", script);
  const ProcessResult checked = tool({"bash", "-n", "completion"});
  EXPECT_EQ(checked.status, 0) << checked.err;
  const auto completions = [&](const std::string& words, int position) {
    return tool({"bash", "-c",
                 "source completion; COMP_WORDS=(" + words + "); COMP_CWORD=" + std::to_string(position) +
                     "; _kiroku; printf '%s\\n' \"${COMPREPLY[@]}\""})
        .out;
  };
  EXPECT_EQ(completions("kiroku rec", 1), "record\nrecover\n");
  EXPECT_EQ(completions("kiroku record --endo", 2), "--endoscope\n");
  EXPECT_EQ(completions("kiroku record --profile unc", 3), "uncompressed\n");
  EXPECT_EQ(completions("kiroku token ver", 2), "verify\n");
  EXPECT_EQ(completions("kiroku token verify --dig", 3), "--digest\n");
  for (const Arguments& command : kCommands) {
    std::istringstream lines(page(command));
    for (std::string line; std::getline(lines, line);) {
      if (line.rfind("  -", 0) != 0) continue;
      const std::size_t at = line.find("--");
      const std::string option = line.substr(at, line.find_first_of(" ,", at) - at);
      EXPECT_THAT(script, HasSubstr(option)) << command[0];
    }
  }
}

TEST_F(Help, CompletionOffersTheHomesCases) {
  std::filesystem::create_directories(home() / "archive/20260805T091502Z-3f9c21ab");
  std::filesystem::create_directories(home() / "archive/log");
  write_text(folder() / "completion", kiroku({"completion", "bash"}).out);
  Process::Options run = options({});
  run.command = {"bash", "-c",
                 "source completion; compopt() { :; }; COMP_WORDS=(kiroku verify 2026); COMP_CWORD=2; "
                 "_kiroku; printf '%s\\n' "
                 "\"${COMPREPLY[@]}\""};
  EXPECT_EQ(run_process(run).out, "20260805T091502Z-3f9c21ab\n");
}

TEST_F(Help, CompletionForZshIsValid) {
  if (!has_tool("zsh")) GTEST_SKIP() << "zsh is not installed";
  write_text(folder() / "_kiroku", kiroku({"completion", "zsh"}).out);
  const ProcessResult checked = tool({"zsh", "-n", "_kiroku"});
  EXPECT_EQ(checked.status, 0) << checked.err;
}

}  // namespace
}  // namespace kiroku::test

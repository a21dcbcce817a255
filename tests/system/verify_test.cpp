#include <sstream>

#include "tests/support/build_paths.h"
#include "tests/system/program_test.h"

namespace kiroku::test {
namespace {

using testing::HasSubstr;
using testing::Not;

class Verify : public ProgramTest {
 protected:
  void SetUp() override {
    make_demo_home();
    case_ = record();
  }
  [[nodiscard]] ProcessResult small_verifier(Arguments arguments) const {
    Process::Options run = options({});
    run.command = {built_file("kiroku-verify")};
    run.command.insert(run.command.end(), arguments.begin(), arguments.end());
    return run_process(run);
  }
  [[nodiscard]] std::filesystem::path copy_of_case() const {
    const auto copy = folder() / "copy" / case_.filename();
    std::filesystem::create_directories(copy.parent_path());
    std::filesystem::copy(case_, copy, std::filesystem::copy_options::recursive);
    return copy;
  }

  std::filesystem::path case_;
};

TEST_F(Verify, NamesTheFileThatWasTamperedWith) {
  const auto copy = copy_of_case();
  flip_byte(copy / "segments/endoscope/00000001.ts.age", 500);
  const ProcessResult judged = kiroku({"verify", copy.string()});
  EXPECT_EQ(judged.status, 1);
  EXPECT_THAT(judged.out, HasSubstr("TAMPERED: "));
  EXPECT_THAT(judged.out, HasSubstr("segments/endoscope/00000001.ts.age"));
  const auto report = nlohmann::json::parse(kiroku({"verify", "--json", copy.string()}).out);
  EXPECT_EQ(report["verdict"], "tampered");
  std::vector<std::string> tampered;
  for (const auto& finding : report["findings"]) {
    if (finding["severity"] == "tampered") tampered.push_back(finding["file"]);
  }
  EXPECT_THAT(tampered, testing::ElementsAre("segments/endoscope/00000001.ts.age"));
  EXPECT_EQ(kiroku({"verify", case_.string()}).status, 0) << "the original is as it was";
}

// The list of cases tells verdicts by what the home trusts. Whoever makes a case can hand over keys as well.
TEST_F(Verify, TheListOfCasesKnowsNoVerdictByKeysThatSomebodyNamed) {
  const auto listed = [&](const std::filesystem::path& folder) {
    const auto all = kiroku_json({"cases", "--json"});
    for (const auto& each : all["cases"]) {
      if (each["case"] == folder.filename().string()) return each["verdict"];
    }
    return nlohmann::json("not listed");
  };
  ASSERT_EQ(kiroku({"init", "--demo", "--home", path("strange")}).status, 0);
  const std::string key = path("strange/device.pub"), root = path("strange/own-authority.pem");
  ASSERT_EQ(kiroku({"verify", case_.string()}).status, 0);
  EXPECT_EQ(listed(case_), "intact");
  EXPECT_EQ(kiroku({"verify", "--device", key, case_.string()}).status, 3);
  EXPECT_EQ(listed(case_), "intact");

  ASSERT_EQ(kiroku({"record", "--home", path("strange"), "--vitals", "synthetic:patient", "--duration", "2s"})
                .status,
            0);
  std::filesystem::path made;
  for (const auto& each : std::filesystem::directory_iterator(path("strange/archive"))) {
    if (std::filesystem::exists(each.path() / "segments")) made = each.path();
  }
  ASSERT_FALSE(made.empty());
  const std::filesystem::path slipped_in = home() / "archive" / made.filename();
  std::filesystem::copy(made, slipped_in, std::filesystem::copy_options::recursive);
  EXPECT_EQ(kiroku({"verify", "--device", key, "--own-authority", root, "--log", path("strange/archive/log"),
                    slipped_in.string()})
                .status,
            0);
  EXPECT_EQ(listed(slipped_in), nullptr) << "nobody here vouches for it";
  EXPECT_EQ(kiroku({"verify", slipped_in.string()}).status, 3);
  EXPECT_EQ(listed(slipped_in), "unproven");
}

TEST_F(Verify, OfSeveralCasesReturnsTheWorst) {
  const auto copy = copy_of_case();
  flip_byte(copy / "ledger.jsonl", 20);
  EXPECT_EQ(kiroku({"verify", case_.string(), copy.string()}).status, 1);
  EXPECT_EQ(kiroku({"verify", copy.string(), case_.string()}).status, 1);
  const ProcessResult with_absent = kiroku({"verify", "--json", case_.string(), path("absent")});
  EXPECT_EQ(with_absent.status, 2);
  EXPECT_THAT(with_absent.err, HasSubstr("absent"));
  const auto reports = nlohmann::json::parse(with_absent.out);
  EXPECT_EQ(reports["cases"][0]["verdict"], "intact");
  EXPECT_THAT(reports["cases"][1]["error"].get<std::string>(), HasSubstr("absent"));
}

TEST_F(Verify, ALogThatIsGivenAsACaseIsNoTamperedCase) {
  const std::string log = (home() / "archive/log").string();
  EXPECT_REFUSED(kiroku({"verify", log}), "is an appliance log and no case: --as-log verifies it");
  EXPECT_REFUSED(kiroku({"verify", "--as-log", case_.string()}), "is a case and no appliance log");
  const ProcessResult both = kiroku({"verify", case_.string(), log + "/"});
  EXPECT_EQ(both.status, 2);
  EXPECT_THAT(both.out, Not(HasSubstr("TAMPERED")));
  EXPECT_THAT(both.err, HasSubstr("is an appliance log"));
  // What is called like a case is judged as one.
  const auto copy = copy_of_case();
  std::filesystem::copy_file(home() / "archive/log/ledger.jsonl", copy / "ledger.jsonl",
                             std::filesystem::copy_options::overwrite_existing);
  EXPECT_EQ(kiroku({"verify", copy.string()}).status, 1);
}

TEST_F(Verify, BySmallProgramTrustsNothingByItself) {
  const ProcessResult judged = small_verifier({"--json", case_.string()});
  EXPECT_EQ(judged.status, 3) << judged.err;
  EXPECT_EQ(nlohmann::json::parse(judged.out)["verdict"], "unproven");
}

TEST_F(Verify, BySmallProgramFindsTheSameUnderWhatIsTrusted) {
  const Arguments trusted{"--json",
                          "--device",
                          (home() / "device.pub").string(),
                          "--own-authority",
                          (home() / "own-authority.pem").string(),
                          "--log",
                          (home() / "archive/log").string()};
  Arguments arguments = trusted;
  arguments.push_back(case_.string());
  const ProcessResult small = small_verifier(arguments);
  EXPECT_EQ(small.status, 0) << small.out << small.err;
  Arguments large = trusted;
  large.insert(large.begin(), "verify");
  large.push_back(case_.string());
  EXPECT_EQ(small.out, kiroku(large).out);
}

TEST_F(Verify, TakesTheDeviceKeyItselfInsteadOfAFile) {
  std::string key = read_text(home() / "device.pub");
  key.pop_back();
  EXPECT_EQ(small_verifier(
                {"--device", key, "--own-authority", (home() / "own-authority.pem").string(), case_.string()})
                .status,
            0);
  EXPECT_REFUSED(small_verifier({"--device", "or-3+00000000+AAAA", case_.string()}), "or-3");
  EXPECT_REFUSED(small_verifier({"--device", case_.string() + "/ledger.jsonl", case_.string()}),
                 "ledger.jsonl");
}

TEST_F(Verify, CallsTimeUnderTheHomesOwnRootSelfIssuedHoweverItIsGiven) {
  const std::string root = (home() / "own-authority.pem").string();
  const std::string device = (home() / "device.pub").string();
  for (const char* option : {"--own-authority", "--trust"}) {
    const ProcessResult judged = small_verifier({"--json", "--device", device, option, root, case_.string()});
    EXPECT_EQ(judged.status, 0) << judged.out << judged.err;
    EXPECT_EQ(nlohmann::json::parse(judged.out)["time"], "self-issued") << option;
  }
  EXPECT_EQ(nlohmann::json::parse(kiroku({"verify", "--json", case_.string()}).out)["time"], "self-issued");
}

TEST_F(Verify, UnderAnotherDeviceKeyIsNoYes) {
  ASSERT_EQ(kiroku({"init", "--demo", "--home", path("other"), "--device-name", "other"}).status, 0);
  const int status = kiroku({"verify", "--device", path("other/device.pub"), case_.string()}).status;
  EXPECT_TRUE(status == 1 || status == 3) << status;
}

TEST_F(Verify, MissesACaseThatTheLogDoesNotKnow) {
  ASSERT_EQ(kiroku({"init", "--demo", "--home", path("other")}).status, 0);
  const ProcessResult judged = kiroku({"verify", "--log", path("other/archive/log"), case_.string()});
  EXPECT_NE(judged.status, 0) << judged.out;
  EXPECT_THAT(judged.out, HasSubstr("it is another device's, and says nothing of this case"));
}

TEST_F(Verify, SaysOfALogThatNobodyLookedIntoThatItWasNotCompared) {
  std::filesystem::create_directory(folder() / "excerpt");
  write_text(folder() / "excerpt/excerpt.json", "{}");
  const ProcessResult judged = kiroku({"verify", "--log", path("nowhere"), path("excerpt")});
  EXPECT_EQ(judged.status, 1) << judged.out;
  EXPECT_THAT(judged.out, HasSubstr("not compared with " + path("nowhere")));
}

TEST_F(Verify, SmallProgramNeedsOpensslAndNothingHeavier) {
  if (std::string(KIROKU_SANITIZERS) != "") GTEST_SKIP() << "sanitizers bring libraries of their own";
  const ProcessResult listed = tool({"ldd", built_file("kiroku-verify")});
  ASSERT_EQ(listed.status, 0);
  std::istringstream lines(listed.out);
  for (std::string line; std::getline(lines, line);) {
    EXPECT_THAT(line, testing::ContainsRegex(
                          "linux-vdso|ld-linux|libc[.]so|libm[.]so|libgcc_s|libstdc[+][+]|libcrypto[.]so"))
        << line;
  }
}

TEST_F(Verify, ColoursTheVerdictOnlyOnATerminalThatWantsIt) {
  Process::Options run = options({"verify", case_.string()});
  EXPECT_THAT(run_process(run).out, testing::Not(HasSubstr("\x1b[")));
  run.terminal = true;
  Process coloured(run);
  EXPECT_THAT(coloured.wait().out, HasSubstr("\x1b[1;32mINTACT"));
  run.environment["NO_COLOR"] = "1";
  Process plain(run);
  EXPECT_THAT(plain.wait().out, testing::Not(HasSubstr("\x1b[1;")));
}

}  // namespace
}  // namespace kiroku::test

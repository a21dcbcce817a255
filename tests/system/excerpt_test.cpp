#include "tests/system/program_test.h"

namespace kiroku::test {
namespace {

using testing::Contains;
using testing::HasSubstr;
using testing::Not;

class Excerpt : public ProgramTest {
 protected:
  void SetUp() override {
    make_demo_home();
    case_ = record({"--segment", "1s"}, "00:00:08").filename().string();
  }
  [[nodiscard]] Arguments cut(const std::string& output, const Arguments& more = {}) const {
    Arguments arguments{"excerpt", case_, "--from", "00:00:02", "--to", "00:00:04", "-o", output};
    arguments.insert(arguments.end(), more.begin(), more.end());
    return arguments;
  }
  std::string case_;
};

TEST_F(Excerpt, VerifiesByItself) {
  Arguments json = cut("part", {"--json"});
  const auto made = kiroku_json(json);
  EXPECT_EQ(made["segments"], 5);  // two of pictures, three shorter ones of vital signs
  EXPECT_EQ(made["case"], case_);
  EXPECT_EQ(made["from_ns"], 2'000'000'000);
  EXPECT_EQ(made["to_ns"], 4'000'000'000);
  EXPECT_THAT(made["from_utc"].get<std::string>(), testing::EndsWith("Z"));
  EXPECT_TRUE(made["clock_set"].empty());
  const ProcessResult judged = kiroku({"verify", path("part")});
  EXPECT_EQ(judged.status, 4) << judged.out << judged.err;
  EXPECT_THAT(judged.out, HasSubstr("INTACT EXCERPT: a part of a case, not the case"));
  EXPECT_THAT(judged.out, Not(HasSubstr("everything is as it was recorded")));
  EXPECT_EQ(kiroku({"verify", "--excerpt", path("part")}).status, 0);
}

TEST_F(Excerpt, SaysByBothClocksWhichStretchItIs) {
  const ProcessResult made = kiroku(cut("part"));
  ASSERT_EQ(made.status, 0) << made.err;
  EXPECT_THAT(made.out, testing::ContainsRegex("It is 00:00:02 to 00:00:04 of the case: [0-9TZ:.-]+ to "
                                               "[0-9TZ:.-]+ by the recorder's clock"));
}

TEST_F(Excerpt, ANameCommandsNoTerminal) {
  const ProcessResult made = kiroku(cut(path("part\033[31m")));
  EXPECT_EQ(made.status, 0) << made.err;
  EXPECT_THAT(made.out, HasSubstr("part\\u{001B}[31m"));
  EXPECT_THAT(made.out, Not(HasSubstr("\033")));
}

TEST_F(Excerpt, IsToldAsThePartThatItIs) {
  ASSERT_EQ(kiroku(cut("part", {"--stream", "endoscope", "--by", "Dr. Mori"})).status, 0);
  const std::string text = kiroku({"verify", path("part")}).out;
  EXPECT_THAT(text, HasSubstr("00:00:02.000 to 00:00:04.000 of the case: endoscope"));
  EXPECT_THAT(text, HasSubstr("by Dr. Mori: the excerpt's own words, nothing proves them"));
  EXPECT_THAT(text, testing::ContainsRegex("left out +the streams [a-z, ]*vitals"));
  EXPECT_THAT(text, testing::ContainsRegex("endoscope +2 +8 +[0-9]+ +[0-9]+ +0:02 "));
  const auto report = kiroku_json({"verify", "--excerpt", "--json", path("part")});
  EXPECT_EQ(report["verdict"], "intact-excerpt");
  ASSERT_EQ(report["streams"].size(), 1U);
  EXPECT_EQ(report["streams"][0]["segments"], 2);
  const auto& part = report["excerpt"];
  EXPECT_EQ(part["from_ns"], 2'000'000'000);
  EXPECT_EQ(part["to_ns"], 4'000'000'000);
  EXPECT_EQ(part["streams"][0]["held_segments"], 2);
  EXPECT_EQ(part["streams"][0]["case_segments"], 8);
  EXPECT_EQ(part["stated"]["made_by"], "Dr. Mori");
  EXPECT_EQ(kiroku_json({"verify", "--json", case_})["excerpt"], nullptr);
}

TEST_F(Excerpt, AnExitStatusOfItsOwnGivesWayToWorse) {
  ASSERT_EQ(kiroku(cut("part")).status, 0);
  EXPECT_EQ(kiroku({"verify", "--excerpt", case_}).status, 0);
  EXPECT_EQ(kiroku({"verify", case_, path("part")}).status, 4);
  EXPECT_EQ(kiroku({"verify", "--excerpt", case_, path("part")}).status, 0);
  EXPECT_EQ(kiroku({"verify", path("part"), path("nothing")}).status, 2);
  ASSERT_EQ(kiroku(cut("changed")).status, 0);
  write_text(path("changed/segments/stray"), "x");
  EXPECT_EQ(kiroku({"verify", "--excerpt", path("changed")}).status, 1);
  EXPECT_EQ(kiroku({"verify", path("part"), path("changed")}).status, 1);
}

TEST_F(Excerpt, InAnArchiveIsNoCase) {
  const std::filesystem::path archive = home() / "archive";
  ASSERT_EQ(kiroku(cut(path("20260101T000000Z-00000000"))).status, 0);
  std::filesystem::rename(path("20260101T000000Z-00000000"), archive / "20260101T000000Z-00000000");
  const auto cases = kiroku_json({"cases", "--json"})["cases"];
  ASSERT_EQ(cases.size(), 1U);
  EXPECT_EQ(cases[0]["case"], case_);
  EXPECT_EQ(cases[0]["verdict"], nullptr);
  EXPECT_EQ(kiroku({"verify", (archive / "20260101T000000Z-00000000").string()}).status, 4);
  EXPECT_EQ(kiroku_json({"cases", "--json"})["cases"].size(), 1U);
  EXPECT_REFUSED(kiroku({"verify", "20260101T000000Z-00000000"}), "neither a folder nor a case");
  EXPECT_EQ(kiroku({"recover"}).status, 0);
  EXPECT_EQ(kiroku({"erase", "--older-than", "1s", "--stream", "kitchen", "--policy", "test"}).status, 0);
}

TEST_F(Excerpt, HoldsOnlyTheStreamsAskedFor) {
  ASSERT_EQ(kiroku(cut("part", {"--stream", "vitals"})).status, 0);
  const auto files = files_below(folder() / "part");
  EXPECT_THAT(files, Contains(HasSubstr("segments/vitals/")));
  EXPECT_THAT(files, Not(Contains(HasSubstr("segments/endoscope/0"))));
  EXPECT_EQ(kiroku({"verify", "--excerpt", path("part")}).status, 0);
}

TEST_F(Excerpt, WithASegmentTakenOutIsTampered) {
  ASSERT_EQ(kiroku(cut("part")).status, 0);
  for (const std::string& file : files_below(folder() / "part")) {
    if (!file.starts_with("segments/endoscope/") || !file.ends_with(".age")) continue;
    std::filesystem::remove(folder() / "part" / file);
    break;
  }
  EXPECT_EQ(kiroku({"verify", path("part")}).status, 1);
}

TEST_F(Excerpt, IsOpenedByTheNewReaderAlone) {
  if (!has_tool("age-keygen")) GTEST_SKIP() << "age is not installed";
  ASSERT_EQ(tool({"age-keygen", "-o", "expert.txt"}).status, 0);
  std::string expert = tool({"age-keygen", "-y", "expert.txt"}).out;
  expert.pop_back();
  const ProcessResult made = kiroku(cut("part", {"--to-recipient", expert}));
  ASSERT_EQ(made.status, 0) << made.err;
  // Only who can open it sees that the new header still leads to the same film.
  EXPECT_EQ(kiroku({"verify", path("part")}).status, 3);
  for (const std::string& file : files_below(folder() / "part")) {
    if (!file.ends_with(".age") || file.find("/events/") != std::string::npos) continue;
    const std::string sealed = path("part/" + file);
    EXPECT_EQ(tool({"age", "-d", "-i", "expert.txt", "-o", "opened", sealed}).status, 0) << file;
    EXPECT_NE(tool({"age", "-d", "-i", (home() / "identity.txt").string(), "-o", "opened", sealed}).status, 0)
        << file;
  }
  EXPECT_EQ(kiroku({"verify", "--excerpt", "-i", "expert.txt", path("part")}).status, 0);
  EXPECT_THAT(kiroku({"log"}).out, HasSubstr("excerpt for a new reader"));
}

TEST_F(Excerpt, RefusesWhatItCannotDoAndLeavesNothing) {
  std::filesystem::create_directory(folder() / "there");
  const auto before = files_below(folder());
  EXPECT_REFUSED(kiroku(cut("there")), "there");
  EXPECT_REFUSED(kiroku(cut("part", {"--stream", "kitchen"})), "kitchen");
  EXPECT_REFUSED(kiroku({"excerpt", case_, "--from", "00:00:04", "--to", "00:00:02", "-o", "part"}), "");
  EXPECT_REFUSED(kiroku({"excerpt", case_, "--from", "01:00:00", "--to", "01:00:02", "-o", "part"}), "");
  EXPECT_REFUSED(kiroku({"excerpt", case_, "--from", "noon", "--to", "00:00:02", "-o", "part"}), "noon");
  EXPECT_REFUSED(kiroku(cut("part", {"-i", (home() / "identity.txt").string()})), "--to-recipient");
  EXPECT_EQ(files_below(folder()), before);
}

}  // namespace
}  // namespace kiroku::test

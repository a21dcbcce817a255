// Legal holds, by the program that people run.
#include <filesystem>

#include "tests/system/program_test.h"

namespace kiroku::test {
namespace {

namespace fs = std::filesystem;
using testing::HasSubstr;

class LegalHold : public ProgramTest {
 protected:
  void SetUp() override {
    make_demo_home();
    case_ = record();
    ASSERT_FALSE(case_.empty());
  }
  [[nodiscard]] std::string name() const { return case_.filename().string(); }
  [[nodiscard]] fs::path log() const { return home() / "archive/log"; }
  [[nodiscard]] ProcessResult erase() const {
    return kiroku({"erase", name(), "--stream", "endoscope", "--policy", "30 days", "--only-copy"});
  }
  [[nodiscard]] std::size_t segments() const {
    return static_cast<std::size_t>(std::distance(fs::directory_iterator(case_ / "segments/endoscope"), {}));
  }

  fs::path case_;
};

TEST_F(LegalHold, KeepsEverythingUntilTheLastIsReleased) {
  const std::size_t before = segments();
  EXPECT_REFUSED(kiroku({"hold", name()}), "say why with --reason");
  const int first = kiroku_json({"hold", name(), "--reason", "court", "--json"})["hold"];
  const int second = kiroku_json({"hold", name(), "--reason", "insurer", "--json"})["hold"];
  const ProcessResult kept = erase();
  EXPECT_EQ(kept.status, 1) << kept.err;
  EXPECT_THAT(kept.err, HasSubstr("it is under legal hold since "));
  EXPECT_THAT(kept.err, HasSubstr(": court; 1 more hold stands"));
  EXPECT_REFUSED(kiroku({"release", name(), "--reason", "settled"}), "say which one ends with --hold");
  for (const int each : {first, second}) {
    EXPECT_EQ(erase().status, 1);
    EXPECT_EQ(segments(), before);
    EXPECT_EQ(kiroku({"release", name(), "--reason", "settled", "--hold", std::to_string(each)}).status, 0);
  }
  EXPECT_THAT(kiroku({"hold", "--list"}).out, HasSubstr("No case is under legal hold."));
  EXPECT_EQ(erase().status, 0);
  EXPECT_LT(segments(), before);
  EXPECT_EQ(kiroku({"log", "--verify"}).status, 0);
}

TEST_F(LegalHold, IsNotReleasedByALineThatNobodySigned) {
  const int held = kiroku_json({"hold", name(), "--reason", "court", "--json"})["hold"];
  const std::string line = R"({"type":"case-released","seq":)" + std::to_string(held + 1) +
                           R"(,"utc":"2026-11-26T20:00:00.000000Z","mono_ns":0,"case":")" + name() +
                           R"(","hold":)" + std::to_string(held) + R"(,"reason":"none","who":"nobody"})";
  write_text(log() / "ledger.jsonl", read_text(log() / "ledger.jsonl") + line + "\n");
  EXPECT_NE(erase().status, 0);
  EXPECT_GT(segments(), 0U);
}

TEST_F(LegalHold, OfALogThatWasRemovedNobodyCanTell) {
  const std::size_t before = segments();
  EXPECT_EQ(kiroku({"hold", name(), "--reason", "court"}).status, 0);
  fs::rename(log(), folder() / "log-away");
  const ProcessResult kept = erase();
  EXPECT_EQ(kept.status, 2) << kept.out << kept.err;
  EXPECT_THAT(kept.err, HasSubstr("nobody can tell which cases are under legal hold"));
  EXPECT_EQ(segments(), before);
  const ProcessResult listed = kiroku({"hold", "--list"});
  EXPECT_EQ(listed.status, 2) << listed.out;
  EXPECT_THAT(listed.err, HasSubstr("nobody can tell which cases are under legal hold"));
  EXPECT_THAT(listed.out, testing::Not(HasSubstr("No case is under legal hold")));
}

// The next entry's checkpoint is over the changed line, too.
TEST_F(LegalHold, OfALogThatWasChangedAndSignedOnNobodyCanTell) {
  EXPECT_EQ(kiroku({"hold", name(), "--reason", "court"}).status, 0);
  std::string lines = read_text(log() / "ledger.jsonl");
  char& digit = lines[lines.rfind(name()) + name().size() - 1];
  digit = digit == '0' ? '1' : '0';
  write_text(log() / "ledger.jsonl", lines);
  const ProcessResult exported = kiroku({"export", name(), "--stream", "endoscope", "-o", path("film.mkv")});
  EXPECT_EQ(exported.status, 0) << exported.err;
  EXPECT_THAT(exported.err, HasSubstr("it was changed on the disk"));
  const std::size_t before = segments();
  for (const Arguments& asked :
       {Arguments{"hold", "--list"},
        Arguments{"erase", name(), "--stream", "endoscope", "--policy", "p", "--only-copy"}}) {
    const ProcessResult told = kiroku(asked);
    EXPECT_EQ(told.status, 2) << told.out;
    EXPECT_THAT(told.err, HasSubstr("says in its entry "));
  }
  EXPECT_EQ(segments(), before);
}

// What the home remembers is not rolled back by files that look like checkpoints.
TEST_F(LegalHold, OfAnOlderLogThatWasPutBackNobodyCanTellHoweverItsCheckpointsLook) {
  const fs::path older = folder() / "older";
  fs::copy(log(), older, fs::copy_options::recursive);
  for (int i = 0; i < 12; ++i) {
    EXPECT_EQ(kiroku({"hold", name(), "--reason", "court"}).status, 0);
  }
  fs::path newest;
  for (const auto& note : fs::directory_iterator(log() / "checkpoints"))
    newest = std::max(newest, note.path());
  const fs::path kept = folder() / newest.filename();
  fs::copy_file(newest, kept);
  fs::remove_all(log());
  fs::copy(older, log(), fs::copy_options::recursive);
  fs::copy_file(kept, newest);
  write_text(log() / "checkpoints/99999999.note", "nothing");
  EXPECT_EQ(kiroku({"export", name(), "--stream", "endoscope", "-o", path("film.mkv")}).status, 0);
  fs::remove(newest);
  fs::remove(log() / "checkpoints/99999999.note");
  const std::size_t before = segments();
  EXPECT_EQ(kiroku({"hold", "--list"}).status, 2);
  EXPECT_EQ(erase().status, 2);
  EXPECT_EQ(segments(), before);
}

// Rewritten without the hold and without a signature, it says as little.
TEST_F(LegalHold, OfALogWithoutCheckpointsNobodyCanTell) {
  const std::string before = read_text(log() / "ledger.jsonl");
  EXPECT_EQ(kiroku({"hold", name(), "--reason", "court"}).status, 0);
  write_text(log() / "ledger.jsonl", before);
  for (const auto& note : fs::directory_iterator(log() / "checkpoints")) fs::remove(note);
  for (const Arguments& asked :
       {Arguments{"hold", "--list"},
        Arguments{"erase", name(), "--stream", "endoscope", "--policy", "p", "--only-copy"}}) {
    const ProcessResult told = kiroku(asked);
    EXPECT_EQ(told.status, 2) << told.out;
    EXPECT_THAT(told.err, HasSubstr("has no checkpoint"));
  }
}

TEST_F(LegalHold, OfAHomeThatRecordedNothingThereIsNone) {
  EXPECT_EQ(kiroku({"init", "--demo", "--home", path("fresh")}).status, 0);
  EXPECT_THAT(kiroku({"hold", "--list", "--home", path("fresh")}).out,
              HasSubstr("No case is under legal hold."));
}

}  // namespace
}  // namespace kiroku::test

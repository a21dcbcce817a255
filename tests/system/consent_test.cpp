// Written consent, by the program that people run.
#include <filesystem>

#include "tests/system/program_test.h"

namespace kiroku::test {
namespace {

namespace fs = std::filesystem;
using testing::HasSubstr;
using testing::Not;

class ConsentTest : public ProgramTest {
 protected:
  void SetUp() override {
    make_demo_home();
    case_ = record();
    ASSERT_FALSE(case_.empty());
    write_text(path("who.txt"), "Hana Mori, patient\n");
    write_text(path("scan.pdf"), "a form that was signed");
  }
  [[nodiscard]] std::string name() const { return case_.filename().string(); }
  [[nodiscard]] fs::path log() const { return home() / "archive/log"; }
  [[nodiscard]] ProcessResult state(const std::string& kind, const Arguments& purposes,
                                    const Arguments& more = {}) const {
    Arguments all{"consent", kind, name(), "--person", path("who.txt")};
    for (const std::string& each : purposes) all.insert(all.end(), {"--purpose", each});
    all.insert(all.end(), more.begin(), more.end());
    return kiroku(all);
  }
  [[nodiscard]] ProcessResult export_for(const std::string& purpose, const std::string& file) const {
    return kiroku({"export", name(), "--stream", "vitals", "-o", path(file), "--purpose", purpose});
  }
  void configure(const std::string& section) const {
    write_text(home() / "kiroku.toml", read_text(home() / "kiroku.toml") + "\n[consent]\n" + section);
  }

  fs::path case_;
};

TEST_F(ConsentTest, OpensAnExportForItsPurposeUntilItIsWithdrawn) {
  EXPECT_REFUSED(export_for("teaching", "a.jsonl"), "no consent to the purpose teaching was given");
  EXPECT_EQ(state("give", {"teaching", "research"}).status, 0);
  EXPECT_EQ(export_for("teaching", "b.jsonl").status, 0);
  EXPECT_TRUE(fs::exists(path("b.jsonl")));
  EXPECT_REFUSED(export_for("publication", "c.jsonl"), "no consent to the purpose publication was given");
  EXPECT_EQ(state("withdraw", {"teaching"}).status, 0);
  EXPECT_REFUSED(export_for("teaching", "d.jsonl"), "the consent to the purpose teaching was withdrawn");
  EXPECT_EQ(export_for("research", "e.jsonl").status, 0);
  for (const char* not_made : {"a.jsonl", "c.jsonl", "d.jsonl"}) EXPECT_FALSE(fs::exists(path(not_made)));
  EXPECT_THAT(read_text(log() / "ledger.jsonl"), HasSubstr(R"("purpose":"teaching")"));
  EXPECT_EQ(kiroku({"log", "--verify"}).status, 0);
}

TEST_F(ConsentTest, NamesThePurposeInTheManifest) {
  EXPECT_EQ(state("give", {"teaching"}).status, 0);
  EXPECT_EQ(kiroku({"export", name(), "--all", "-o", path("all"), "--purpose", "teaching"}).status, 0);
  EXPECT_EQ(nlohmann::json::parse(read_text(path("all") + "/manifest.json"))["purpose"], "teaching");
}

TEST_F(ConsentTest, SaysInTheClearNothingThatNamesAnybody) {
  EXPECT_EQ(state("give", {"teaching"}, {"--form", path("scan.pdf"), "--keep-form"}).status, 0);
  for (const std::string& file : files_below(log())) {
    const std::string text = fs::is_regular_file(log() / file) ? read_text(log() / file) : "";
    EXPECT_THAT(text, Not(HasSubstr("Mori"))) << file;
    EXPECT_THAT(text, Not(HasSubstr("a form that was signed"))) << file;
  }
  const nlohmann::json shown = kiroku_json({"consent", "show", name(), "--json"});
  EXPECT_EQ(shown["entries"][0]["person"], "Hana Mori, patient");
  EXPECT_EQ(shown["entries"][0]["form"]["bytes"], 22);
  EXPECT_EQ(kiroku({"consent", "show", name(), "--write-form", path("again.pdf")}).status, 0);
  EXPECT_EQ(read_text(path("again.pdf")), "a form that was signed");
  EXPECT_THAT(read_text(log() / "ledger.jsonl"), HasSubstr("read the consents"));
}

TEST_F(ConsentTest, RefusesWhatDoesNotFitWhatStands) {
  EXPECT_REFUSED(state("withdraw", {"teaching"}), "there is nothing to withdraw");
  EXPECT_REFUSED(state("withdraw", {}), "there is nothing to withdraw");
  EXPECT_EQ(state("give", {"teaching"}).status, 0);
  EXPECT_REFUSED(state("give", {"research", "teaching"}), "to teaching stands already");
  EXPECT_REFUSED(state("give", {"research", "research"}), "twice");
  EXPECT_REFUSED(state("give", {"billing"}), "is no purpose of this site");
  EXPECT_REFUSED(state("give", {"res\xE2\x80\xAE"
                                "earch"}),
                 "is no purpose of this site");
  EXPECT_REFUSED(state("give", {"research"}, {"--since", "2999-01-01"}), "still to come");
  EXPECT_REFUSED(state("give", {"research"}, {"--since", "yesterday"}), "write a day as 2026-08-05");
  write_text(path("who.txt"), "Hana \xE2\x80\xAEiroM\n");
  EXPECT_REFUSED(state("give", {"research"}), "who consented");
  write_text(path("who.txt"), "");
  EXPECT_REFUSED(state("give", {"research"}), "is empty");
  const nlohmann::json listed = kiroku_json({"consent", "list", "--json"});
  EXPECT_EQ(listed["consents"][0]["purposes"].size(), 1U);
}

TEST_F(ConsentTest, RefusesAHugeForm) {
  write_text(path("huge.pdf"), "");
  fs::resize_file(path("huge.pdf"), std::uintmax_t{1} << 30U);
  EXPECT_REFUSED(state("give", {"teaching"}, {"--form", path("huge.pdf"), "--keep-form"}), "the form");
  EXPECT_THAT(kiroku({"consent", "list"}).out, HasSubstr("No consent is entered"));
}

TEST_F(ConsentTest, OfOneCaseServesNoOther) {
  EXPECT_EQ(state("give", {"teaching"}).status, 0);
  const fs::path other = record();
  EXPECT_REFUSED(kiroku({"export", other.filename().string(), "--stream", "vitals", "-o", path("o.jsonl"),
                         "--purpose", "teaching"}),
                 "no consent to the purpose teaching was given for case " + other.filename().string());
}

TEST_F(ConsentTest, IsNotGivenByALineThatNobodySigned) {
  EXPECT_EQ(state("give", {"research"}).status, 0);
  std::string text = read_text(log() / "ledger.jsonl");
  const std::size_t at = text.rfind("{\"type\":\"consent-given\"");
  ASSERT_NE(at, std::string::npos);
  std::string line = text.substr(at);
  line.replace(line.find("research"), 8, "teaching");
  write_text(log() / "ledger.jsonl", text + line);
  EXPECT_NE(export_for("teaching", "t.jsonl").status, 0);
  EXPECT_FALSE(fs::exists(path("t.jsonl")));
}

// As for legal holds: a log that was cut back fits no checkpoint any more, or none that others saw.
TEST_F(ConsentTest, OfALogThatLostTheWithdrawalNobodyCanTell) {
  EXPECT_EQ(state("give", {"teaching"}).status, 0);
  const std::string before = read_text(log() / "ledger.jsonl");
  EXPECT_EQ(state("withdraw", {"teaching"}).status, 0);
  write_text(log() / "ledger.jsonl", before);
  EXPECT_REFUSED(kiroku({"consent", "list"}), "nobody can tell what was consented to");
  EXPECT_NE(export_for("teaching", "x.jsonl").status, 0);
  EXPECT_FALSE(fs::exists(path("x.jsonl")));
  EXPECT_EQ(kiroku({"log", "--verify"}).status, 1);
}

// Cut back with its checkpoints, it says what it said before. Its sealed statement is still there.
TEST_F(ConsentTest, WithdrawnInALogThatWasCutBackWithItsCheckpointsLeavesATrace) {
  EXPECT_EQ(state("give", {"teaching"}).status, 0);
  const std::string kept = path("kept");
  fs::copy(log(), kept, fs::copy_options::recursive);
  EXPECT_EQ(state("withdraw", {"teaching"}).status, 0);
  fs::remove_all(log() / "checkpoints");
  fs::copy(kept + "/checkpoints", log() / "checkpoints");
  write_text(log() / "ledger.jsonl", read_text(kept + "/ledger.jsonl"));
  EXPECT_THAT(kiroku({"log", "--verify", "--json"}).out, HasSubstr("consent-not-entered"));
}

TEST_F(ConsentTest, IsDemandedOfEveryExportAndExcerptWhereTheSiteSaysSo) {
  configure("demand_purpose = true\n");
  const Arguments without{"export", name(), "--stream", "vitals", "-o", path("w.jsonl")};
  EXPECT_REFUSED(kiroku(without), "this site demands a purpose of every export");
  EXPECT_FALSE(fs::exists(path("w.jsonl")));
  const Arguments excerpt{"excerpt", name(), "--from", "0:00", "--to", "0:01", "-o", path("part")};
  Arguments excerpt_for = excerpt;
  excerpt_for.insert(excerpt_for.end(), {"--purpose", "teaching"});
  EXPECT_REFUSED(kiroku(excerpt), "this site demands a purpose of every export");
  EXPECT_REFUSED(kiroku(excerpt_for), "no consent to the purpose teaching was given");
  EXPECT_FALSE(fs::exists(path("part")));
  EXPECT_EQ(state("give", {"teaching"}).status, 0);
  EXPECT_EQ(export_for("teaching", "w.jsonl").status, 0);
  EXPECT_EQ(kiroku(excerpt_for).status, 0);
  EXPECT_THAT(read_text(log() / "ledger.jsonl"), HasSubstr("took an excerpt, sealed as it is"));
}

TEST_F(ConsentTest, WithdrawnErasesOnlyWhereTheSiteSaysSoAndNoHoldStands) {
  const std::string endoscope = "segments/endoscope";
  const auto left = [&] { return fs::exists(case_ / endoscope) && !fs::is_empty(case_ / endoscope); };
  EXPECT_EQ(state("give", {"treatment-record"}).status, 0);
  EXPECT_THAT(state("withdraw", {}).out, HasSubstr("Nothing is erased"));
  EXPECT_EQ(kiroku({"erase", "--due"}).status, 0);
  EXPECT_TRUE(left());
  configure("erase_when_withdrawn = [\"treatment-record\"]\n");
  EXPECT_EQ(kiroku({"hold", name(), "--reason", "court"}).status, 0);
  const ProcessResult held = kiroku({"erase", "--due"});
  EXPECT_EQ(held.status, 1);
  EXPECT_THAT(held.err, HasSubstr("the legal hold wins"));
  EXPECT_TRUE(left());
  EXPECT_EQ(kiroku({"release", name(), "--reason", "settled"}).status, 0);
  const ProcessResult gone = kiroku({"erase", "--due"});
  EXPECT_EQ(gone.status, 0) << gone.err;
  EXPECT_THAT(gone.out, HasSubstr("consent to treatment-record withdrawn"));
  EXPECT_FALSE(left());
  EXPECT_EQ(kiroku({"log", "--verify"}).status, 0);
}

}  // namespace
}  // namespace kiroku::test

// Written consent, by the program that people run.
#include <fcntl.h>
#include <filesystem>
#include <sys/stat.h>
#include <unistd.h>

#include "base/descriptor.h"
#include "tests/system/program_test.h"

namespace kiroku::test {
namespace {

namespace fs = std::filesystem;
using testing::AllOf;
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
  [[nodiscard]] std::size_t segments() const {
    return static_cast<std::size_t>(std::distance(fs::directory_iterator(case_ / "segments/endoscope"), {}));
  }
  /// A withdrawal of what the newest entry gives, and a line behind it; nobody signs either.
  void forge_withdrawal() const {
    const std::string text = read_text(log() / "ledger.jsonl");
    const std::string given = text.substr(text.rfind("{\"type\":\"consent-given\""));
    const nlohmann::ordered_json entry = nlohmann::ordered_json::parse(given);
    nlohmann::ordered_json withdrawn = entry;
    withdrawn["type"] = "consent-withdrawn";
    withdrawn["seq"] = entry["seq"].get<int>() + 1;
    const nlohmann::ordered_json after{{"type", "shutdown"},
                                       {"seq", entry["seq"].get<int>() + 2},
                                       {"utc", entry["utc"]},
                                       {"mono_ns", entry["mono_ns"]}};
    write_text(log() / "ledger.jsonl", text + withdrawn.dump() + "\n" + after.dump() + "\n");
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
  // A copy elsewhere is the same case, whatever its folder is called.
  fs::copy(case_, path("copied"), fs::copy_options::recursive);
  Arguments of_copy = excerpt;
  of_copy[1] = path("copied");
  EXPECT_REFUSED(kiroku(of_copy), "is a copy of this home's case " + name());
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

// Whoever can write to the disk, and has no key, adds a withdrawal and another line behind it, so that the
// recorder takes neither back.
TEST_F(ConsentTest, WithdrawnByALineThatNobodySignedErasesNothing) {
  configure("erase_when_withdrawn = [\"treatment-record\"]\n");
  EXPECT_EQ(state("give", {"treatment-record"}).status, 0);
  const std::size_t before = segments();
  forge_withdrawal();
  const ProcessResult refused = export_for("treatment-record", "f.jsonl");
  EXPECT_NE(refused.status, 0);
  EXPECT_THAT(refused.err, AllOf(HasSubstr("have no checkpoint of this device"),
                                 HasSubstr("nobody signed that entry in time")));
  const ProcessResult nothing = kiroku({"erase", "--due"});
  EXPECT_EQ(nothing.status, 0) << nothing.err;
  EXPECT_THAT(nothing.out, HasSubstr("Nothing is due to be erased."));
  EXPECT_EQ(segments(), before);
  EXPECT_EQ(kiroku({"hold", name(), "--reason", "a line that the device signs behind it"}).status, 0);
  EXPECT_EQ(kiroku({"release", name(), "--reason", "it did"}).status, 0);
  EXPECT_EQ(kiroku({"erase", "--due"}).status, 0);
  EXPECT_EQ(segments(), before);
  EXPECT_THAT(kiroku({"consent", "show", name()}).out, HasSubstr("it forbids the use and erases nothing"));
  // Who did withdraw has it entered again.
  const ProcessResult again = state("withdraw", {});
  EXPECT_EQ(again.status, 0) << again.err;
  EXPECT_EQ(kiroku({"erase", "--due"}).status, 0);
  EXPECT_EQ(segments(), 0U);
  const std::string found = kiroku({"log", "--verify", "--json"}).out;
  EXPECT_THAT(found, HasSubstr("consent-doubted"));
  EXPECT_THAT(found, Not(HasSubstr("consent-not-given")));
}

TEST_F(ConsentTest, WaitsForWhoTypesWithoutKeepingOthersWaiting) {
  const std::string who = path("who.fifo");
  ASSERT_EQ(::mkfifo(who.c_str(), 0600), 0);
  Process giving(options({"consent", "give", name(), "--purpose", "teaching", "--person", who}));
  // Opens once the program reads from it.
  Descriptor typing(::open(who.c_str(), O_WRONLY | O_CLOEXEC));
  ASSERT_TRUE(typing);
  const ProcessResult held = run_process(options({"hold", name(), "--reason", "court"}));
  EXPECT_FALSE(held.timed_out);
  EXPECT_EQ(held.status, 0) << held.err;
  const std::string line = "Hana Mori, patient\n";
  ASSERT_EQ(::write(typing.number(), line.data(), line.size()), static_cast<ssize_t>(line.size()));
  typing = Descriptor();
  EXPECT_EQ(giving.wait().status, 0);
}

TEST_F(ConsentTest, IsWithdrawnWhollyOrNotAtAll) {
  EXPECT_EQ(state("give", {"teaching"}).status, 0);
  const std::vector<std::string> before = files_below(log());
  const std::string toml = read_text(home() / "kiroku.toml");
  configure("erase_when_withdrawn = [\"billing\"]\n");
  EXPECT_REFUSED(state("withdraw", {"teaching"}), "which is none of the purposes");
  EXPECT_EQ(files_below(log()), before);
  EXPECT_THAT(read_text(log() / "ledger.jsonl"), Not(HasSubstr("consent-withdrawn")));
  write_text(home() / "kiroku.toml", toml);
  EXPECT_EQ(state("withdraw", {"teaching"}).status, 0);
}

// The checkpoint of the entry cannot be written: the entry is taken back, and what was sealed for it goes.
TEST_F(ConsentTest, ThatCouldNotBeEnteredLeavesNothingBehind) {
  EXPECT_EQ(state("give", {"research"}).status, 0);
  const std::vector<std::string> sealed = files_below(log() / "consents");
  const fs::path newest = files_below(log() / "checkpoints").back();
  std::string next = std::to_string(std::stoull(newest.stem().string()) + 1);
  next.insert(0, newest.stem().string().size() - next.size(), '0');
  const fs::path in_the_way = log() / "checkpoints" / (next + newest.extension().string() + ".part");
  fs::create_directories(in_the_way / "in the way");
  EXPECT_EQ(state("give", {"teaching"}, {"--form", path("scan.pdf"), "--keep-form"}).status, 2);
  EXPECT_EQ(files_below(log() / "consents"), sealed);
  fs::remove_all(in_the_way);
  EXPECT_EQ(state("give", {"teaching"}).status, 0);
  EXPECT_EQ(kiroku({"log", "--verify"}).status, 0);
}

TEST_F(ConsentTest, TellsWhatWouldBeErasedBeforeAnythingIs) {
  EXPECT_EQ(state("give", {"treatment-record"}).status, 0);
  EXPECT_EQ(state("withdraw", {}).status, 0);
  // Added afterwards: it reaches back to that withdrawal.
  configure("erase_when_withdrawn = [\"treatment-record\"]\n");
  const std::string before = read_text(log() / "ledger.jsonl");
  const std::size_t segments_before = segments();
  const ProcessResult told = kiroku({"erase", "--due", "--dry-run"});
  EXPECT_EQ(told.status, 0) << told.err;
  EXPECT_THAT(told.out, HasSubstr(name() + ": would erase endoscope, by the policy: consent to "));
  const nlohmann::json json = kiroku_json({"erase", "--due", "--dry-run", "--json"});
  EXPECT_EQ(json["dry_run"], true);
  EXPECT_EQ(json["cases"][0]["case"], name());
  EXPECT_REFUSED(kiroku({"erase", name(), "--stream", "nobody", "--policy", "p", "--only-copy", "--dry-run"}),
                 "has no stream nobody");
  EXPECT_EQ(segments(), segments_before);
  EXPECT_EQ(read_text(log() / "ledger.jsonl"), before);
}

// It waits for no copy, so a store that cannot be asked keeps nothing of it.
TEST_F(ConsentTest, WithdrawnErasesAlsoWhereTheStoreCannotBeAsked) {
  EXPECT_EQ(state("give", {"treatment-record"}).status, 0);
  EXPECT_EQ(state("withdraw", {}).status, 0);
  configure(
      "erase_when_withdrawn = [\"treatment-record\"]\n\n[store]\n"
      "endpoint = \"https://127.0.0.1:1\"\nbucket = \"recordings\"\nretain = \"3653d\"\n"
      "credentials = \"not-there\"\n");
  const ProcessResult gone = kiroku({"erase", "--due"});
  EXPECT_EQ(gone.status, 0) << gone.out << gone.err;
  EXPECT_EQ(segments(), 0U);
}

}  // namespace
}  // namespace kiroku::test

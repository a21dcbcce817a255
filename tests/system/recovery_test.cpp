#include <algorithm>
#include <csignal>
#include <sys/timex.h>
#include <thread>

#include "tests/support/eventually.h"
#include "tests/system/program_test.h"

namespace kiroku::test {
namespace {

using testing::AllOf;
using testing::HasSubstr;
using testing::Not;

class Recovering : public ProgramTest {
 protected:
  void SetUp() override { make_demo_home(); }
  [[nodiscard]] Process::Options endless() const {
    return options({"record", "--endoscope", "synthetic:endoscope?size=64x48&rate=10", "--vitals",
                    "synthetic:patient", "--segment", "500ms"});
  }
  /// Until a recording has at least one whole segment; its case's folder.
  [[nodiscard]] std::filesystem::path wait_for_segment() const {
    std::filesystem::path folder;
    EXPECT_TRUE(eventually([&] {
      for (const std::string& file : files_below(home() / "archive")) {
        if (file.ends_with("0.ts.age")) folder = home() / "archive" / *std::filesystem::path(file).begin();
      }
      return !folder.empty();
    })) << "no segment";
    return folder;
  }
  [[nodiscard]] nlohmann::json verified(const std::filesystem::path& folder) const {
    return kiroku_json(
        {"verify", "--json", "--identity", (home() / "identity.txt").string(), folder.string()});
  }
};

TEST_F(Recovering, AKilledRecordingIsClosedByRecover) {
  std::filesystem::path folder;
  {
    Process recording(endless());
    folder = wait_for_segment();
    recording.signal(SIGKILL);
    EXPECT_EQ(recording.wait().status, 128 + SIGKILL);
  }
  EXPECT_EQ(kiroku({"verify", folder.string()}).status, 3) << "incomplete";
  const nlohmann::json recovered = kiroku_json({"recover", "--json"});
  ASSERT_EQ(recovered["cases"].size(), 1U);
  EXPECT_EQ(recovered["cases"][0]["case"], folder.filename().string());
  EXPECT_EQ(recovered["cases"][0]["outcome"], "recovered");
  EXPECT_EQ(recovered["cases"][0]["after"], "crash");
  EXPECT_EQ(recovered["cases"][0]["stamped"], true);
  EXPECT_EQ(recovered["cases"][0]["problem"], "");
  const nlohmann::json report = verified(folder);
  EXPECT_EQ(report["verdict"], "intact-with-gaps");
  EXPECT_THAT(report["findings"].dump(), HasSubstr("\"recovered\""));
  EXPECT_THAT(kiroku({"recover"}).out, HasSubstr("was brought to its end"));
  const auto row = kiroku_json({"cases", "--json"})["cases"][0];
  EXPECT_EQ(row["state"], "closed");
  EXPECT_EQ(kiroku({"log", "--verify"}).status, 0);
}

TEST_F(Recovering, TheNextRecordingRecoversFirstAndSaysSo) {
  std::filesystem::path folder;
  {
    Process recording(endless());
    folder = wait_for_segment();
    recording.signal(SIGKILL);
    recording.wait();
  }
  const ProcessResult next = kiroku({"record", "--duration", "00:00:01", "--endoscope",
                                     "synthetic:endoscope?size=64x48&rate=10&speed=max"});
  EXPECT_EQ(next.status, 0);
  EXPECT_THAT(next.err, HasSubstr("case " + folder.filename().string() + " was cut off by a crash"));
  EXPECT_EQ(verified(folder)["verdict"], "intact-with-gaps");
}

TEST_F(Recovering, WhileARecorderLivesNothingIsTouchedAndNoneBeginsBesideIt) {
  Process recording(endless());
  const std::filesystem::path folder = wait_for_segment();
  EXPECT_REFUSED(kiroku({"recover"}), "another recorder (process ");
  EXPECT_REFUSED(kiroku({"record", "--duration", "00:00:01", "--endoscope",
                         "synthetic:endoscope?size=64x48&rate=10&speed=max"}),
                 "another recorder (process ");
  recording.signal(SIGINT);
  EXPECT_EQ(recording.wait().status, 0);
  EXPECT_EQ(verified(folder)["verdict"], "intact");
}

TEST_F(Recovering, ErasesOneStreamAndTheRestStaysProved) {
  const std::filesystem::path folder = record();
  EXPECT_REFUSED(kiroku({"erase", "--stream", "endoscope", "--policy", "p"}), "--older-than");
  EXPECT_REFUSED(kiroku({"erase", folder.filename().string(), "--stream", "nobody", "--policy", "p"}),
                 "no stream");
  EXPECT_REFUSED(kiroku({"erase", folder.filename().string(), "--stream", "endoscope", "--policy", "p",
                         "--older-than", "1d"}),
                 "is not older than 1d");
  EXPECT_REFUSED(kiroku({"erase", "--stream", "endoscope", "--policy", "p", "--older-than", "soon"}),
                 "--older-than is 'soon'");
  const nlohmann::json none =
      kiroku_json({"erase", "--json", "--stream", "endoscope", "--policy", "p", "--older-than", "30d"});
  EXPECT_EQ(none["cases"].size(), 0U);
  EXPECT_EQ(verified(folder)["verdict"], "intact");

  const ProcessResult only_copy =
      kiroku({"erase", "--stream", "endoscope", "--policy", "p", "--older-than", "10ms", "--clock-is-right"});
  EXPECT_EQ(only_copy.status, 1);
  EXPECT_THAT(only_copy.err, AllOf(HasSubstr("nothing else holds it"), HasSubstr("--only-copy")));
  EXPECT_EQ(verified(folder)["verdict"], "intact");
  const nlohmann::json erased =
      kiroku_json({"erase", "--json", "--stream", "endoscope", "--policy", "room: at once", "--older-than",
                   "10ms", "--only-copy", "--clock-is-right"});
  ASSERT_EQ(erased["cases"].size(), 1U);
  EXPECT_GT(erased["cases"][0]["segments"], 0);
  EXPECT_EQ(erased["cases"][0]["stamped"], true);
  EXPECT_TRUE(std::filesystem::is_empty(folder / "segments/endoscope"));
  const nlohmann::json report = verified(folder);
  EXPECT_EQ(report["verdict"], "intact-with-gaps");
  EXPECT_THAT(report["findings"].dump(),
              AllOf(HasSubstr("segments-erased"), HasSubstr(R"(erased by the policy \"room: at once\")")));
  EXPECT_THAT(kiroku({"log"}).out, HasSubstr(R"(stream=endoscope  policy="room: at once")"));
}

// What its ledger states is done with is no only copy: an erasure that was cut off ends without the flag,
// too.
TEST_F(Recovering, AnErasureThatWasCutOffEndsWithoutAskingForCopiesAgain) {
  const std::filesystem::path folder = record();
  const std::string name = folder.filename().string();
  const std::filesystem::path segment = folder / "segments/endoscope/00000000.ts.age";
  const std::string kept = read_text(segment);
  EXPECT_EQ(kiroku({"erase", name, "--stream", "endoscope", "--policy", "p"}).status, 1) << "its only copy";
  EXPECT_EQ(kiroku({"erase", name, "--stream", "endoscope", "--policy", "p", "--only-copy"}).status, 0);
  write_text(segment, kept);
  EXPECT_THAT(kiroku({"erase", name, "--stream", "endoscope", "--policy", "p", "--dry-run"}).out,
              HasSubstr("would erase endoscope"));
  const ProcessResult again = kiroku({"erase", name, "--stream", "endoscope", "--policy", "p"});
  EXPECT_EQ(again.status, 0) << again.err;
  EXPECT_THAT(again.out, HasSubstr("removed 1 file of endoscope that an erasure had left which was cut off"));
  EXPECT_FALSE(std::filesystem::exists(segment));
}

// The nightly erasure goes on where one folder is damaged, and says which.
TEST_F(Recovering, OneDamagedCaseKeepsNothingFromBeingErasedInTheOthers) {
  const std::filesystem::path sound = record();
  const std::filesystem::path empty = home() / "archive/20200101T000000Z-00000000";
  const std::filesystem::path cut = home() / "archive/20200101T000000Z-11111111";
  std::filesystem::create_directory(empty);
  std::filesystem::create_directory(cut);
  write_text(cut / "ledger.jsonl", "{\n");
  const ProcessResult erased =
      kiroku({"erase", "--json", "--stream", "endoscope", "--policy", "room: at once", "--older-than", "10ms",
              "--only-copy", "--clock-is-right"});
  EXPECT_EQ(erased.status, 2);
  const nlohmann::json told = nlohmann::json::parse(erased.out);
  ASSERT_EQ(told["cases"].size(), 1U);
  EXPECT_EQ(told["cases"][0]["case"], sound.filename().string());
  ASSERT_EQ(told["refused"].size(), 2U);
  EXPECT_EQ(told["refused"][0]["case"], empty.filename().string());
  EXPECT_THAT(erased.err, AllOf(HasSubstr(empty.filename().string() + ": nothing was erased from it: "),
                                HasSubstr(cut.filename().string() + ": nothing was erased from it: ")));
  EXPECT_TRUE(std::filesystem::is_empty(sound / "segments/endoscope"));
  // One that is named is refused by itself.
  EXPECT_REFUSED(kiroku({"erase", empty.filename().string(), "--stream", "endoscope", "--policy", "p"}),
                 empty.filename().string());
}

TEST_F(Recovering, ErasesWhatIsDueOnceAReplicaHoldsIt) {
  const std::filesystem::path folder = record({"--room", "synthetic:room?size=64x48&rate=10&speed=max"});
  const std::filesystem::path replica = path("copies");
  write_text(home() / "kiroku.toml", "[storage]\nreplicas = [\"" + replica.string() +
                                         "\"]\n[[retention]]\nstream = \"room\"\nafter = \"10ms\"\n"
                                         "policy = \"room: at once\"\n" +
                                         read_text(home() / "kiroku.toml"));
  EXPECT_REFUSED(kiroku({"erase", "--due", "--stream", "room"}), "--due goes by [[retention]]");
  const ProcessResult kept = kiroku({"erase", "--due", "--json", "--clock-is-right"});
  EXPECT_EQ(kept.status, 1);
  EXPECT_THAT(kept.out, HasSubstr("there is no copy of the case"));
  std::filesystem::create_directories(replica);
  std::filesystem::copy(folder, replica / folder.filename(), std::filesystem::copy_options::recursive);
  const nlohmann::json erased = kiroku_json({"erase", "--due", "--json", "--clock-is-right"});
  ASSERT_EQ(erased["cases"].size(), 1U);
  EXPECT_EQ(erased["cases"][0]["stream"], "room");
  EXPECT_TRUE(std::filesystem::is_empty(folder / "segments/room"));
  EXPECT_FALSE(std::filesystem::is_empty(folder / "segments/endoscope"));
  EXPECT_EQ(verified(folder)["verdict"], "intact-with-gaps");
  EXPECT_EQ(kiroku({"erase", "--due"}).out, "Nothing is due to be erased.\n");
}

// Ten years by one rule, at once by another: the first one of the file that was due would have erased.
TEST_F(Recovering, OfTwoRulesForOneStreamTheLongerOneHolds) {
  const std::filesystem::path folder = record();
  const std::string configuration = read_text(home() / "kiroku.toml");
  const std::string ledger = read_text(folder / "ledger.jsonl");
  const auto opening = nlohmann::json::parse(ledger.substr(0, ledger.find('\n')));
  const std::string purpose = opening["streams"][0]["purpose"];
  const std::string longer =
      "[[retention]]\nstream = \"endoscope\"\nafter = \"3650d\"\npolicy = \"by law\"\n";
  const std::string shorter =
      "[[retention]]\npurpose = \"" + purpose + "\"\nafter = \"10ms\"\npolicy = \"a while\"\n";
  for (const std::string& rules : {longer + shorter, shorter + longer}) {
    write_text(home() / "kiroku.toml", rules + configuration);
    EXPECT_EQ(kiroku({"erase", "--due", "--clock-is-right"}).out, "Nothing is due to be erased.\n");
  }
  // Alone it would erase, and says since when.
  write_text(home() / "kiroku.toml", shorter + configuration);
  const Arguments dry{"erase",       "--older-than",     "10ms",     "--stream", "endoscope", "--policy", "p",
                      "--only-copy", "--clock-is-right", "--dry-run"};
  EXPECT_THAT(kiroku(dry).out, AllOf(HasSubstr("would erase endoscope, by the policy: p; opened 20"),
                                     HasSubstr(" UTC, it may go since 20")));
  Arguments json = dry;
  json.emplace_back("--json");
  EXPECT_THAT(kiroku_json(json)["cases"][0].dump(),
              AllOf(HasSubstr("\"opened\":\"20"), HasSubstr("\"due\":\"20")));
  EXPECT_REFUSED(kiroku({"erase", "--older-than", "6m", "--stream", "endoscope", "--policy", "p"}),
                 "may be months or minutes");
}

TEST_F(Recovering, ErasingOneFormOfPicturesNamesTheOtherThatIsLeft) {
  const std::filesystem::path folder = record({"--also", "endoscope=lossless"});
  const auto erase = [&](const std::string& stream) {
    return kiroku({"erase", folder.filename().string(), "--stream", stream, "--policy", "p", "--only-copy"})
        .out;
  };
  EXPECT_THAT(erase("endoscope"),
              HasSubstr("the same pictures are left in another form: endoscope-lossless"));
  EXPECT_THAT(erase("endoscope-lossless"), Not(HasSubstr("the same pictures")));
}

// A machine that has just started, or whose battery is empty, may believe itself years ahead.
TEST_F(Recovering, AClockThatNobodySetErasesNothingByAge) {
  timex state{};
  const bool synchronised = ::adjtimex(&state) != TIME_ERROR && (state.status & STA_UNSYNC) == 0;
  if (synchronised) GTEST_SKIP() << "this machine's clock is synchronised";
  const std::filesystem::path folder = record();
  const Arguments by_age{"erase",        "--stream",     "endoscope", "--policy",
                         "room: a week", "--older-than", "10ms",      "--only-copy"};
  const ProcessResult kept = kiroku(by_age);
  EXPECT_EQ(kept.status, 1);
  EXPECT_THAT(kept.err,
              AllOf(HasSubstr(folder.filename().string() + ": endoscope is kept: the kernel does not "
                                                           "call this machine's clock synchronised"),
                    HasSubstr("--clock-is-right")));
  EXPECT_FALSE(std::filesystem::is_empty(folder / "segments/endoscope"));
  // A person who names the case asks for no age.
  EXPECT_EQ(kiroku({"erase", folder.filename().string(), "--stream", "endoscope", "--policy",
                    "consent withdrawn", "--only-copy"})
                .status,
            0);
  EXPECT_TRUE(std::filesystem::is_empty(folder / "segments/endoscope"));
}

}  // namespace
}  // namespace kiroku::test

// Sound of an ALSA device in a room: the real daemon, the real alsa-lib, and a card that the test plays.
#include <csignal>
#include <sstream>

#include "tests/support/build_paths.h"
#include "tests/support/eventually.h"
#include "tests/support/sound_card.h"
#include "tests/system/program_test.h"

namespace kiroku::test {
namespace {

using testing::AllOf;
using testing::ContainsRegex;
using testing::HasSubstr;

class MicrophoneOfARoom : public ProgramTest {
 protected:
  void SetUp() override {
    make_demo_home();
    card_->runs = true;
  }
  [[nodiscard]] Process::Options with_card(const Arguments& arguments) const {
    Process::Options started = options(arguments);
    started.environment["ALSA_CONFIG_PATH"] = card_.configuration().string();
    return started;
  }
  [[nodiscard]] ProcessResult run(const Arguments& arguments) const {
    return run_process(with_card(arguments));
  }
  void configure() const {
    write_text(home() / "kiroku.toml", with_short_timeout(read_text(home() / "kiroku.toml")) + R"(
[[room]]
name = "or-1"
[[room.stream]]
name = "room"
source = "synthetic:room?size=64x48&rate=10"
microphone = "alsa:card"
[daemon]
socket = ")" + path("s") + "\"\n");
  }
  [[nodiscard]] std::vector<nlohmann::json> gaps_of(const std::string& id) const {
    std::vector<nlohmann::json> gaps;
    std::istringstream lines(read_text(home() / "archive" / id / "ledger.jsonl"));
    for (std::string line; std::getline(lines, line);) {
      const nlohmann::json entry = nlohmann::json::parse(line);
      if (entry["type"] == "gap") gaps.push_back(entry);
    }
    return gaps;
  }
  [[nodiscard]] std::string identity() const { return (home() / "identity.txt").string(); }

  SoundCard card_{folder()};

 private:
  static std::string with_short_timeout(std::string text) {
    const std::string usual = "source_timeout = \"5s\"";
    return text.replace(text.find(usual), usual.size(), "source_timeout = \"500ms\"");
  }
};

TEST_F(MicrophoneOfARoom, IsRecordedByHand) {
  const ProcessResult recorded = run({"record", "--json", "--duration", "3s", "--room",
                                      "synthetic:room?size=64x48&rate=10", "--microphone", "alsa:card"});
  ASSERT_EQ(recorded.status, 0) << recorded.err;
  const std::string id = nlohmann::json::parse(recorded.out)["case"];
  ASSERT_EQ(
      kiroku({"export", id, "--stream", "room", "--identity", identity(), "-o", path("room.mkv")}).status, 0);
  const ProcessResult probed = tool(
      {"ffprobe", "-v", "error", "-show_entries", "stream=codec_type", "-of", "csv=p=0", path("room.mkv")});
  EXPECT_THAT(probed.out, AllOf(HasSubstr("video"), HasSubstr("audio")));

  card_->fault = CardFault::kUnplugged;
  const ProcessResult absent = run({"record", "--duration", "1s", "--room",
                                    "synthetic:room?size=64x48&rate=10", "--microphone", "alsa:card"});
  EXPECT_NE(absent.status, 0);
  EXPECT_THAT(absent.err, HasSubstr("sound 'alsa:card' cannot be opened: No such device"));
  EXPECT_REFUSED(run({"record", "--vitals", "synthetic:patient", "--microphone", "alsa:card"}),
                 "--microphone needs pictures");
}

TEST_F(MicrophoneOfARoom, ThatIsUnpluggedOrStuckCostsTheRoomNothingButAStatedGapOfSound) {
  configure();
  Process::Options daemon_options = with_card({});
  daemon_options.command.front() = built_file("kirokud");
  Process daemon(daemon_options);
  ASSERT_TRUE(daemon.wait_for("recording for 1 room"));
  const std::string id = kiroku_json({"case", "start", "--json"})["case"];
  const auto recorded_ns = [this] {
    return kiroku_json({"status", "--json"})["rooms"][0]["streams"][0]["frames"].get<int>();
  };
  ASSERT_TRUE(eventually([&] { return recorded_ns() > 20; }));
  card_->fault = CardFault::kUnplugged;
  ASSERT_TRUE(daemon.wait_for("is gone: it was unplugged. Pictures are recorded without its sound"));
  card_->fault = CardFault::kNone;
  ASSERT_TRUE(daemon.wait_for("sound 'alsa:card' is back: 48000 Hz, 1 channel"));
  card_->fault = CardFault::kSilent;
  ASSERT_TRUE(daemon.wait_for("gives nothing; check its plug"));
  card_->fault = CardFault::kStuck;
  ASSERT_TRUE(daemon.wait_for("its thread is left behind"));
  const ProcessResult stopped = run_process(options({"case", "stop"}), std::chrono::seconds(30));
  EXPECT_FALSE(stopped.timed_out) << "the case does not end";
  EXPECT_EQ(stopped.status, 0) << stopped.err;
  daemon.signal(SIGTERM);
  EXPECT_EQ(daemon.wait(std::chrono::seconds(30)).status, 0);
  card_->fault = CardFault::kNone;

  const std::vector<nlohmann::json> gaps = gaps_of(id);
  ASSERT_GE(gaps.size(), 2U);
  EXPECT_EQ(gaps.front()["cause"], "device-removed");
  for (const nlohmann::json& gap : gaps) EXPECT_EQ(gap["of"], "sound") << gap;
  const nlohmann::json report = kiroku_json({"verify", "--json", "--identity", identity(), id});
  EXPECT_EQ(report["verdict"], "intact-with-gaps");
  EXPECT_THAT(report["findings"].dump(), HasSubstr("the sound of room was not recorded from"));
  ASSERT_EQ(kiroku({"export", id, "--all", "--identity", identity(), "-o", path("all")}).status, 0);
  const auto manifest = nlohmann::json::parse(read_text(path("all") + "/manifest.json"));
  EXPECT_THAT(manifest.dump(), AllOf(HasSubstr("\"sound_gaps\":[{"), HasSubstr("\"gaps\":[]")));
}

TEST_F(MicrophoneOfARoom, IsExamined) {
  configure();
  EXPECT_THAT(run({"doctor"}).out, ContainsRegex("good +microphone or-1/room: 48000 Hz, 1 channel"));
  card_->fault = CardFault::kUnplugged;
  EXPECT_THAT(run({"doctor"}).out, AllOf(HasSubstr("microphone or-1/room"), HasSubstr("No such device"),
                                         HasSubstr("kiroku devices")));
}

}  // namespace
}  // namespace kiroku::test

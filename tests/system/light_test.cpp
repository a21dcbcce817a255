// A display in a synthetic room, from the ledger to the verification.
#include <filesystem>
#include <optional>
#include <sys/stat.h>

#include "tests/support/sound_card.h"
#include "tests/system/program_test.h"

namespace kiroku::test {
namespace {

using testing::HasSubstr;

class Light : public ProgramTest {
 protected:
  void SetUp() override { make_demo_home(); }
  [[nodiscard]] std::string room() const {
    return "synthetic:room?size=640x360&rate=10&light_height=44&light=" + path("light.pgm");
  }
  /// A case of 8 s with that room's pictures alone.
  [[nodiscard]] std::string record(const std::string& source) const {
    const ProcessResult recorded = kiroku({"record", "--room", source, "--duration", "8s"});
    EXPECT_EQ(recorded.status, 0) << recorded.err;
    for (const auto& line : files_below(home() / "archive")) {
      if (line.ends_with("/ledger.jsonl") && !line.starts_with("log"))
        return (home() / "archive" / line).parent_path().string();
    }
    return "";
  }
};

TEST_F(Light, ThatCannotBeComparedHidesNoVerdict) {
  const std::filesystem::path changed = ProgramTest::record();
  const std::string ledger = read_text(changed / "ledger.jsonl");
  const std::size_t second = ledger.find("\"seq\":1,");
  ASSERT_NE(second, std::string::npos);
  write_text(changed / "ledger.jsonl", std::string(ledger).insert(second + 7, ".0"));
  const ProcessResult told = kiroku({"verify", changed.string(), "--light"});
  EXPECT_EQ(told.status, 1) << told.err;
  EXPECT_THAT(told.out, testing::AllOf(HasSubstr("TAMPERED"), HasSubstr("Light: could not check: ")));
  const ProcessResult json = kiroku({"verify", changed.string(), "--light", "--json"});
  EXPECT_EQ(json.status, 1);
  const auto report = nlohmann::json::parse(json.out);
  EXPECT_EQ(report["verdict"], "tampered");
  EXPECT_THAT(report["light"]["error"].get<std::string>(), HasSubstr("cannot read entry 1"));

  const ProcessResult mistyped = kiroku({"verify", changed.string(), "--light", "--light-stream", "rom"});
  EXPECT_EQ(mistyped.status, 1);
  EXPECT_THAT(mistyped.out, HasSubstr("TAMPERED"));
}

// Real time: a display's codes are of the machine's seconds, and a camera sees them while they pass.
using LightRealTime = Light;

TEST_F(LightRealTime, PicturesOfADisplayAgreeWithTheLedger) {
  const Process display(options({"display", "-o", path("light.pgm"), "--cell", "2"}));
  const std::string recorded = record(room());
  const ProcessResult judged = kiroku({"verify", recorded, "--light", "--json"});
  const auto light = nlohmann::json::parse(judged.out)["light"]["streams"][0];
  EXPECT_EQ(light["stream"], "room");
  EXPECT_EQ(light["old"], 0) << light;
  EXPECT_EQ(light["foreign"], 0) << light;
  EXPECT_GE(light["agreeing"].get<int>(), 6) << light;
  // The home stamps with its own authority, which is nobody outside.
  ASSERT_TRUE(light["finished_after"].is_object()) << light;
  EXPECT_EQ(light["finished_after"]["outside"], false);
  EXPECT_THAT(kiroku({"verify", recorded, "--light"}).out,
              HasSubstr("by the recorder's own authority (embedded): its clock is the recorder's"));

  // Whoever trusts none of its roots is told no time: a ledger's words about its tokens are not repeated.
  ASSERT_EQ(kiroku({"init", "--demo", "--home", path("other")}).status, 0);
  const ProcessResult rootless = kiroku({"verify", recorded, "--light", "--json", "--home", path("other"),
                                         "-i", (home() / "identity.txt").string()});
  EXPECT_EQ(rootless.status, 3);
  const auto of_rootless = nlohmann::json::parse(rootless.out)["light"];
  EXPECT_EQ(of_rootless["streams"][0]["agreeing"], light["agreeing"]);
  EXPECT_EQ(of_rootless["proves_nothing"], false);
  EXPECT_TRUE(of_rootless["streams"][0]["finished_after"].is_null()) << of_rootless;

  // The token's bytes are changed, so the ledger's words about it hold no more.
  const std::string changed = path("changed");
  std::filesystem::copy(recorded, changed, std::filesystem::copy_options::recursive);
  for (const auto& file : files_below(changed)) {
    if (file.starts_with("tokens/")) flip_byte(std::filesystem::path(changed) / file, 300);
  }
  const ProcessResult tampered = kiroku({"verify", changed, "--light", "--json"});
  EXPECT_EQ(tampered.status, 1);
  const auto of_tampered = nlohmann::json::parse(tampered.out)["light"];
  EXPECT_EQ(of_tampered["proves_nothing"], true);
  EXPECT_EQ(of_tampered["streams"][0]["agreeing"], light["agreeing"]);
  EXPECT_TRUE(of_tampered["streams"][0]["finished_after"].is_null()) << of_tampered;
  EXPECT_THAT(kiroku({"verify", changed, "--light"}).out,
              testing::AllOf(HasSubstr("what agrees with its ledger proves nothing"),
                             testing::Not(HasSubstr("were finished after 20"))));

  ASSERT_EQ(
      kiroku({"excerpt", recorded, "--from", "00:00:02", "--to", "00:00:04", "-o", path("part")}).status, 0);
  const ProcessResult part = kiroku({"verify", path("part"), "--light"});
  EXPECT_EQ(part.status, 3) << part.out << part.err;
  EXPECT_THAT(part.out, HasSubstr("could not check: codes are made of a whole ledger"));
}

/// A room with a loudspeaker and a microphone: what is written into the FIFO is heard.
class LoudspeakerRealTime : public Light {
 protected:
  void SetUp() override {
    Light::SetUp();
    ASSERT_EQ(::mkfifo(path("air").c_str(), 0600), 0);
    card_.emplace(folder(), folder() / "air");
    (*card_)->runs = true;
  }
  /// What a shell runs beside the recording.
  [[nodiscard]] Process played(const std::string& command) const {
    Process::Options shell = options({});
    shell.command = {"sh", "-c", command};
    return Process(shell);
  }
  /// A case with a microphone in the room; its folder.
  [[nodiscard]] std::string record_sound(const std::string& duration) const {
    Process::Options recorder = options({"record", "--json", "--duration", duration, "--room",
                                         "synthetic:room?size=64x48&rate=10", "--microphone", "alsa:card"});
    recorder.environment["ALSA_CONFIG_PATH"] = card_->configuration().string();
    const ProcessResult recorded = run_process(recorder);
    EXPECT_EQ(recorded.status, 0) << recorded.err;
    return (home() / "archive" / nlohmann::json::parse(recorded.out)["case"].get<std::string>()).string();
  }
  [[nodiscard]] nlohmann::json sound_of(const std::string& recorded) const {
    const ProcessResult judged = kiroku({"verify", recorded, "--light", "--json"});
    const auto light = nlohmann::json::parse(judged.out)["light"];
    EXPECT_EQ(light["sound"].size(), 1U) << light;
    return light["sound"][0];
  }
  std::optional<SoundCard> card_;
};

TEST_F(LoudspeakerRealTime, SoundOfTheRoomAgreesWithTheLedgerAndOfAnotherCaseDoesNot) {
  std::string first;
  {
    // What the loudspeaker plays is also kept, as somebody may. Each shell becomes its program, so that it
    // ends here.
    ASSERT_EQ(::mkfifo(path("wire").c_str(), 0600), 0);
    const Process keeping =
        played("exec tee '" + path("kept.pcm") + "' < '" + path("wire") + "' > '" + path("air") + "'");
    const Process display = played("exec '" + built_file("kiroku") +
                                   "' display --listen 127.0.0.1:0 --pcm > '" + path("wire") + "'");
    first = record_sound("23s");
  }
  const auto live = sound_of(first);
  EXPECT_EQ(live["old"], 0) << live;
  EXPECT_EQ(live["foreign"], 0) << live;
  EXPECT_GE(live["agreeing"].get<int>(), 2) << live;
  EXPECT_EQ(live["period_s"], 5);
  ASSERT_TRUE(live["delay_ns"].is_object()) << live;
  EXPECT_LT(live["delay_ns"]["most"].get<std::int64_t>(), 2'000'000'000) << live;
  ASSERT_TRUE(live["finished_after"].is_object()) << live;
  EXPECT_EQ(live["finished_after"]["outside"], false);
  const ProcessResult of_first = kiroku({"verify", first, "--light"});
  EXPECT_EQ(of_first.status, 3) << "the pictures show no code, and sound says nothing of them";
  EXPECT_THAT(of_first.out, testing::AllOf(HasSubstr("Sound in stream room: sound and ledger agree"),
                                           HasSubstr("stretches of 5 s"), HasSubstr("a code is heard")));

  // The next case hears what was kept of the first.
  const Process replay = played("exec cat '" + path("kept.pcm") + "' > '" + path("air") + "'");
  const std::string second = record_sound("17s");
  const ProcessResult judged = kiroku({"verify", second, "--light"});
  EXPECT_EQ(judged.status, 1) << judged.out;
  EXPECT_THAT(judged.out, testing::AllOf(HasSubstr("SOUND AND LEDGER DISAGREE"),
                                         HasSubstr("sound carries a code that this ledger never had")));
  EXPECT_EQ(sound_of(second)["agreeing"], 0);
}

TEST_F(LoudspeakerRealTime, ARoomWithoutOneAccusesNobody) {
  const std::string recorded = record_sound("12s");
  const ProcessResult judged = kiroku({"verify", recorded, "--light"});
  EXPECT_EQ(judged.status, 3) << judged.out;
  EXPECT_THAT(judged.out,
              testing::AllOf(HasSubstr("INTACT"), HasSubstr("could not check: no code could be heard")));
  EXPECT_EQ(sound_of(recorded)["answer"], "not-seen");
}

TEST_F(Light, WithoutADisplayNothingCouldBeChecked) {
  const std::string recorded = record(room() + "&speed=max");
  const ProcessResult judged = kiroku({"verify", recorded, "--light"});
  EXPECT_EQ(judged.status, 3) << judged.out;
  EXPECT_THAT(judged.out, HasSubstr("could not check: no code could be read"));
  EXPECT_THAT(judged.out, HasSubstr("INTACT"));
  EXPECT_THAT(judged.out, testing::Not(HasSubstr("Sound in stream"))) << "the case has none";
}

TEST_F(Light, RefusesInOneSentence) {
  EXPECT_REFUSED(kiroku({"display", "--once"}), "--output");
  EXPECT_REFUSED(kiroku({"display", "--once", "-o", path("light.jpg")}), ".png or .pgm");
  EXPECT_REFUSED(kiroku({"display", "--once", "-o", path("light.png")}), "no case is being recorded");
  EXPECT_REFUSED(kiroku({"display", "--once", "-o", path("light.png"), "--cell", "0"}), "--cell");
  EXPECT_REFUSED(kiroku({"display", "--once", "--pcm", "-o", path("light.png")}), "--pcm");
  EXPECT_REFUSED(kiroku({"display", "--json", "--pcm"}), "standard output");
  EXPECT_REFUSED(kiroku({"verify", "CASE", "--light-stream", "room"}), "--light");
  EXPECT_REFUSED(kiroku({"record", "--endoscope", "synthetic:endoscope?light=a.pgm", "--duration", "1s"}),
                 "synthetic:room");
}

}  // namespace
}  // namespace kiroku::test

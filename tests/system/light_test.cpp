// A display in a synthetic room, from the ledger to the verification.
#include "tests/system/program_test.h"

namespace kiroku::test {
namespace {

using testing::HasSubstr;

// Real time: a display's codes are of the machine's seconds, and a camera sees them while they pass.
class LightRealTime : public ProgramTest {
 protected:
  void SetUp() override { make_demo_home(); }
  [[nodiscard]] std::string room() const {
    return "synthetic:room?size=640x360&rate=10&light_height=44&light=" + path("light.pgm");
  }
  /// A case with a room's pictures alone.
  [[nodiscard]] std::string record_room() const {
    const ProcessResult recorded = kiroku({"record", "--room", room(), "--duration", "8s"});
    EXPECT_EQ(recorded.status, 0) << recorded.err;
    for (const auto& line : files_below(home() / "archive")) {
      if (line.ends_with("/ledger.jsonl") && !line.starts_with("log"))
        return (home() / "archive" / line).parent_path().string();
    }
    return "";
  }
};

TEST_F(LightRealTime, PicturesOfADisplayAgreeWithTheLedger) {
  const Process display(options({"display", "-o", path("light.pgm"), "--cell", "2"}));
  const std::string recorded = record_room();
  const ProcessResult judged = kiroku({"verify", recorded, "--light", "--json"});
  const auto light = nlohmann::json::parse(judged.out)["light"]["streams"][0];
  EXPECT_EQ(light["stream"], "room");
  EXPECT_EQ(light["old"], 0) << light;
  EXPECT_EQ(light["foreign"], 0) << light;
  EXPECT_GE(light["agreeing"].get<int>(), 6) << light;
}

TEST_F(LightRealTime, WithoutADisplayNothingCouldBeChecked) {
  const std::string recorded = record_room();
  const ProcessResult judged = kiroku({"verify", recorded, "--light"});
  EXPECT_EQ(judged.status, 3) << judged.out;
  EXPECT_THAT(judged.out, HasSubstr("could not check: no code could be read"));
  EXPECT_THAT(judged.out, HasSubstr("INTACT"));
}

using Light = ProgramTest;

TEST_F(Light, RefusesInOneSentence) {
  make_demo_home();
  EXPECT_REFUSED(kiroku({"display", "--once"}), "--output");
  EXPECT_REFUSED(kiroku({"display", "--once", "-o", path("light.jpg")}), ".png or .pgm");
  EXPECT_REFUSED(kiroku({"display", "--once", "-o", path("light.png")}), "no case is being recorded");
  EXPECT_REFUSED(kiroku({"display", "--once", "-o", path("light.png"), "--cell", "0"}), "--cell");
  EXPECT_REFUSED(kiroku({"verify", "CASE", "--light-stream", "room"}), "--light");
  EXPECT_REFUSED(kiroku({"record", "--endoscope", "synthetic:endoscope?light=a.pgm", "--duration", "1s"}),
                 "synthetic:room");
}

}  // namespace
}  // namespace kiroku::test

// A display in a synthetic room, from the ledger to the verification.
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

TEST_F(Light, WithoutADisplayNothingCouldBeChecked) {
  const std::string recorded = record(room() + "&speed=max");
  const ProcessResult judged = kiroku({"verify", recorded, "--light"});
  EXPECT_EQ(judged.status, 3) << judged.out;
  EXPECT_THAT(judged.out, HasSubstr("could not check: no code could be read"));
  EXPECT_THAT(judged.out, HasSubstr("INTACT"));
}

TEST_F(Light, RefusesInOneSentence) {
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

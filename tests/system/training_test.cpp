// 'kiroku train' as a person calls it.
#include <set>

#include "tests/system/program_test.h"

namespace kiroku::test {
namespace {

using testing::HasSubstr;

class Training : public ProgramTest {};

TEST_F(Training, TheHapticRateExperimentGivesThresholdsAndKeepsThem) {
  const nlohmann::json found =
      kiroku_json({"train", "haptic-rate", "-o", path("rates"), "--simulated", "3", "--fingers", "1,5",
                   "--trials", "30", "--method", "staircase", "--json"});
  EXPECT_EQ(found["simulated"], true);
  ASSERT_EQ(found["thresholds"].size(), 2U);
  EXPECT_NEAR(found["thresholds"][0]["mean_hz"].get<double>(), 23.3, 5);
  EXPECT_NEAR(found["thresholds"][1]["mean_hz"].get<double>(), 1.2, 0.3);
  EXPECT_LT(found["pairs"][0]["p_holm"].get<double>(), 0.05);
  EXPECT_EQ(found["recovered"]["thresholds"], 6);
  EXPECT_THAT(read_text(folder() / "rates/trials.csv"), HasSubstr("simulated 3,yes,5,60,"));
  EXPECT_THAT(read_text(folder() / "rates/thresholds.svg"), HasSubstr("<svg"));
  EXPECT_THAT(read_text(folder() / "rates/touch.png"), testing::StartsWith("\x89PNG"));
  // Three more, with the same numbers, in the same database.
  EXPECT_EQ(kiroku({"train", "haptic-rate", "-o", path("again"), "--simulated", "3", "--fingers", "1,5",
                    "--trials", "30", "--method", "staircase", "--database", path("rates/results.sqlite")})
                .status,
            0);
  EXPECT_EQ(read_text(folder() / "again/trials.csv"), read_text(folder() / "rates/trials.csv"));
}

TEST_F(Training, OneSubjectGetsASentenceInsteadOfAPValue) {
  const ProcessResult result = kiroku(
      {"train", "haptic-rate", "-o", path("one"), "--simulated", "1", "--fingers", "2,3", "--trials", "10"});
  EXPECT_EQ(result.status, 0) << result.err;
  EXPECT_THAT(result.out, HasSubstr("no p-value: a test needs at least 3 pairs"));
}

TEST_F(Training, RefusesInOneSentence) {
  const auto rates = [&](const Arguments& more) {
    Arguments all{"train", "haptic-rate", "-o", path("refused")};
    all.insert(all.end(), more.begin(), more.end());
    return kiroku(all);
  };
  EXPECT_REFUSED(rates({"--fingers", "0"}), "--fingers");
  EXPECT_REFUSED(rates({"--fingers", "1,6"}), "--fingers");
  EXPECT_REFUSED(rates({"--fingers", "1.5"}), "whole fingers");
  EXPECT_REFUSED(rates({"--method", "guess"}), "--method");
  EXPECT_REFUSED(rates({"--thresholds", "20", "--fingers", "2"}), "--thresholds has 1");
  EXPECT_REFUSED(rates({"--hand", "usb:1"}), "udp:PORT");
  EXPECT_REFUSED(rates({"--hand", "udp:0", "--subject", "Aoki"}), "--hand udp:0");
  EXPECT_REFUSED(rates({"--hand", "udp:7001"}), "--subject");
  write_text(folder() / "words.sqlite", std::string(4096, 'x'));
  EXPECT_REFUSED(rates({"--database", path("words.sqlite")}), "no database");
  write_text(folder() / "refused/touch.png", "mine");
  EXPECT_REFUSED(rates({}), "--force");
  EXPECT_EQ(read_text(folder() / "refused/touch.png"), "mine");
}

}  // namespace
}  // namespace kiroku::test

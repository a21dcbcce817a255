// 'kiroku sim lens' as a person calls it: a chessboard that is recorded with an endoscope.
#include <cmath>

#include "tests/support/chessboard.h"
#include "tests/system/program_test.h"

namespace kiroku::test {
namespace {

namespace fs = std::filesystem;
using testing::HasSubstr;

constexpr int kWidth = 640, kHeight = 480, kColumns = 9, kRows = 6;

/// What a pixel shows of a lens whose corners are drawn in by a tenth of where they are shown.
std::array<double, 2> straight(double x, double y) {
  constexpr double kFocal = 460, kDrawnIn = 0.1, kCorner2 = 319.5 * 319.5 + 239.5 * 239.5;
  const double s = x - 319.5, t = y - 239.5, scale = (1 + kDrawnIn * (s * s + t * t) / kCorner2) / kFocal;
  return {scale * s, scale * t};
}

/// A film without compression, two pictures a second.
std::string film_of(const std::vector<BoardPose>& poses) {
  std::string film = "YUV4MPEG2 W640 H480 F2:1 Ip A1:1 C420jpeg\n";
  for (const BoardPose& pose : poses) {
    const auto grey = chessboard_picture(kWidth, kHeight, kColumns, kRows, pose, straight);
    film += "FRAME\n";
    film.append(grey.begin(), grey.end());
    film.append(std::size_t{kWidth} * kHeight / 2, static_cast<char>(128));
  }
  return film;
}

class LensProgram : public ProgramTest {
 protected:
  void SetUp() override { make_demo_home(); }

  [[nodiscard]] std::string record(const std::vector<BoardPose>& poses) const {
    write_text(folder() / "board.y4m", film_of(poses));
    const auto seconds = std::to_string(poses.size() / 2);
    return kiroku_json({"record", "--json", "--endoscope", "board.y4m?speed=max", "--profile", "lossless",
                        "--duration", "00:00:0" + seconds})["case"];
  }
};

TEST_F(LensProgram, IsFoundInARecordingOfABoard) {
  std::vector<BoardPose> poses = board_poses();
  ASSERT_EQ(poses.size(), 11U);
  poses.push_back(poses.back());            // held still
  poses.push_back({0, 0, 0, {40, 0, 14}});  // out of the picture
  poses.push_back({0.1, 0, 0, {-3, 0.5, 14}});
  const std::string recorded = record(poses);
  const nlohmann::json made =
      kiroku_json({"sim", "lens", recorded, "--board", "9x6", "-o", "endoscope.yml", "--json"});
  EXPECT_GE(made["used"].size(), 10U);
  EXPECT_GE(made["alike"], 1);
  EXPECT_GE(made["without_board"], 1);
  EXPECT_EQ(made["used"][0]["picture"].get<std::string>().substr(0, 8), "00:00:00");
  EXPECT_LT(made["error_px"], 0.3);
  EXPECT_NEAR(made["drawn_in"].get<double>(), 1 - 1 / 1.1, 0.02);
  EXPECT_THAT(read_text(folder() / "endoscope.yml"), HasSubstr("distortion_coefficients"));
  EXPECT_THAT(kiroku_json({"log", "--json"}).dump(), HasSubstr("opened to calibrate a lens"));

  EXPECT_REFUSED(kiroku({"sim", "lens", recorded, "--board", "9x6", "-o", "endoscope.yml"}), "endoscope.yml");
  const ProcessResult told =
      kiroku({"sim", "lens", recorded, "--board", "9x6", "-o", "endoscope.json", "--from", "00:00:00"});
  EXPECT_EQ(told.status, 0) << told.err;
  EXPECT_THAT(told.out, HasSubstr("reprojection error 0."));
  EXPECT_THAT(told.out, HasSubstr("barrel distortion of "));
}

TEST_F(LensProgram, IsNotMadeOfTooLittle) {
  const std::string recorded = record({{0, 0, 0, {0, 0, 12}}, {0, 0.5, 0, {0, 0, 14}}});
  const auto asked = [&](const std::string& board, const std::string& output) {
    return kiroku({"sim", "lens", recorded, "--board", board, "-o", output});
  };
  EXPECT_REFUSED(asked("9x6", "lens.yml"), "the whole board lies differently in 2 pictures only: 8 at least");
  EXPECT_REFUSED(asked("8x5", "lens.yml"), "in 0 pictures only");
  EXPECT_REFUSED(asked("9", "lens.yml"), "--board");
  EXPECT_REFUSED(asked("9x9", "lens.yml"), "not as many in both");
  EXPECT_REFUSED(asked("9x6", "lens.txt"), "must be .yml, .yaml, .xml or .json");
  EXPECT_REFUSED(kiroku({"sim", "lens", recorded, "board.png", "--board", "9x6", "-o", "lens.yml"}),
                 "name one recorded case, or pictures that all end in .png");
  write_text(folder() / "board.png", "no picture");
  EXPECT_REFUSED(kiroku({"sim", "lens", "board.png", "--board", "9x6", "-o", "lens.yml"}), "board.png");
  EXPECT_FALSE(fs::exists(folder() / "lens.yml"));
}

}  // namespace
}  // namespace kiroku::test

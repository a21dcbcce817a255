// 'kiroku quality', as a hospital uses it.

#include <filesystem>

#include "media/film_writer.h"
#include "tests/support/textured_film.h"
#include "tests/system/program_test.h"

namespace kiroku::test {
namespace {

using testing::HasSubstr;
using testing::Not;

class QualityTest : public ProgramTest {
 protected:
  std::string film(const std::string& name, int pictures) const {
    write_textured_film(path(name), 192, 176, pictures);
    return path(name);
  }
};

TEST_F(QualityTest, WritesATableAPageAndPlots) {
  const std::string clip = film("an <b> odd name.mp4", 40);
  const ProcessResult made =
      kiroku({"quality", clip, "--rate", "1M", "--measured", "3", "--pictures", "2", "-o", path("out")});
  ASSERT_EQ(made.status, 0) << made.err;
  EXPECT_THAT(made.out, HasSubstr("MPEG-2 4:2:0, 1 Mbit/s"));
  EXPECT_THAT(made.out, HasSubstr("lossless (FFV1)"));
  EXPECT_THAT(made.out, HasSubstr("identical"));
  EXPECT_THAT(made.out, HasSubstr("quality.html"));
  EXPECT_THAT(files_below(path("out")),
              testing::UnorderedElementsAre("an--b--odd-name-colour.svg", "an--b--odd-name-fine-texture.svg",
                                            "an--b--odd-name-ms-ssim.svg", "an--b--odd-name-psnr.svg",
                                            "an--b--odd-name-ssim.svg", "quality.html", "quality.json",
                                            "quality.pdf"));
  const nlohmann::json found = nlohmann::json::parse(read_text(folder() / "out/quality.json"));
  const nlohmann::json& codings = found.at("clips").at(0).at("codings");
  ASSERT_EQ(codings.size(), 6U);
  for (const nlohmann::json& one : codings) {
    const bool kept = one.at("coding") == "lossless" || one.at("coding") == "uncompressed";
    EXPECT_EQ(one.at("identical"), kept) << one;
    EXPECT_EQ(one.at("psnr_db").is_null(), kept) << one;
    EXPECT_GT(one.at("bytes_per_hour"), 0) << one;
  }
  // The page asks nothing of anybody, and a name cannot end its data.
  const std::string page = read_text(folder() / "out/quality.html");
  EXPECT_THAT(page, HasSubstr("default-src 'none'"));
  EXPECT_THAT(page, Not(HasSubstr("<b> odd")));
  EXPECT_THAT(page, HasSubstr("\\u003cb> odd name.mp4"));
  EXPECT_THAT(page, Not(HasSubstr("http://")));
  EXPECT_THAT(page, Not(HasSubstr("https://")));
  EXPECT_THAT(page, Not(HasSubstr("src=\"")));
  EXPECT_EQ(std::filesystem::status(folder() / "out").permissions(), std::filesystem::perms::owner_all);

  EXPECT_REFUSED(kiroku({"quality", clip, "-o", path("out")}), "is already there");
  const ProcessResult again =
      kiroku({"quality", clip, "--coding", "lossless", "--measured", "1", "-o", path("out"), "--force"});
  EXPECT_EQ(again.status, 0) << again.err;
}

TEST_F(QualityTest, SaysEverywhereWhatItDidNotTryAndWhatTheFilmHasLost) {
  // RGB becomes 4:4:4, for which Matroska has no name.
  media::FilmWriter rgb(path("rgb.mkv"), {192, 176, 3, 25, 1});
  for (int n = 0; n < 30; ++n)
    rgb.add({192, 176, 3, std::vector<std::uint8_t>(std::size_t{192} * 176 * 3, std::uint8_t(4 * n))});
  rgb.finish();
  constexpr const char* kSentence = "uncompressed was not tried: Matroska";
  const ProcessResult made = kiroku({"quality", path("rgb.mkv"), "--coding", "lossless", "--coding",
                                     "uncompressed", "--measured", "1", "-o", path("out")});
  ASSERT_EQ(made.status, 0) << made.err;
  EXPECT_THAT(made.out, HasSubstr(kSentence));
  EXPECT_THAT(made.out, Not(HasSubstr("compressed itself"))) << "FFV1 loses nothing";
  EXPECT_THAT(read_text(folder() / "out/quality.html"), HasSubstr(kSentence));
  const nlohmann::json clip =
      nlohmann::json::parse(read_text(folder() / "out/quality.json")).at("clips").at(0);
  EXPECT_EQ(clip.at("coded_as"), "ffv1");
  EXPECT_EQ(clip.at("coding_loses"), "no");
  if (has_tool("pdftotext")) {
    EXPECT_THAT(tool({"pdftotext", "-layout", path("out/quality.pdf"), "-"}).out, HasSubstr(kSentence));
  }

  // However long the film is, and however little of it is measured.
  const ProcessResult part = kiroku(
      {"quality", film("film.mp4", 250), "--duration", "1s", "--coding", "lossless", "--measured", "1"});
  EXPECT_THAT(part.out, HasSubstr("The film is compressed itself (h264): what that has lost is missing"));
}

TEST_F(QualityTest, SaysFiguresToOtherPrograms) {
  const std::string clip = film("film.mp4", 40);
  const nlohmann::json found = kiroku_json({"quality", clip, clip, "--coding", "mpeg2", "--rate", "200k",
                                            "--rate", "2M", "--measured", "2", "--json"});
  ASSERT_EQ(found.at("clips").size(), 2U);
  const nlohmann::json& codings = found.at("clips").at(1).at("codings");
  ASSERT_EQ(codings.size(), 2U);
  EXPECT_LT(codings.at(0).at("psnr_db"), codings.at(1).at("psnr_db"));
  EXPECT_EQ(codings.at(0).at("bit_rate"), 200'000);
  // Twice the same clip, twice the same figures.
  EXPECT_EQ(found.at("clips").at(0), found.at("clips").at(1));
}

TEST_F(QualityTest, RefusesInOneSentence) {
  EXPECT_REFUSED(kiroku({"quality", path("none.mkv")}), "there is no film");
  EXPECT_REFUSED(kiroku({"quality", film("short.mp4", 5)}), "0.2 s of pictures");
  EXPECT_REFUSED(kiroku({"quality", film("film.mp4", 30), "--coding", "vp9"}), "there is no coding 'vp9'");
  EXPECT_REFUSED(kiroku({"quality", path("film.mp4"), "--from", "5s"}), "0 s of pictures");
  EXPECT_REFUSED(kiroku({"quality", path("film.mp4"), "--measured", "0"}), "--measured");
  write_text(path("notes.txt"), "no film at all\n");
  EXPECT_REFUSED(kiroku({"quality", path("notes.txt")}), "notes.txt");
  write_text(path("empty.mp4"), "");
  EXPECT_REFUSED(kiroku({"quality", path("empty.mp4")}), "empty");
  // A folder that is no earlier result is never replaced.
  std::filesystem::create_directory(folder() / "mine");
  write_text(path("mine/letter"), "dear");
  EXPECT_REFUSED(kiroku({"quality", path("film.mp4"), "-o", path("mine"), "--force"}), "no earlier result");
  EXPECT_EQ(read_text(folder() / "mine/letter"), "dear");
  if (has_tool("ffmpeg")) {
    ASSERT_EQ(
        tool({"ffmpeg", "-v", "error", "-nostdin", "-f", "lavfi", "-i", "sine=duration=3", path("sound.wav")})
            .status,
        0);
    EXPECT_REFUSED(kiroku({"quality", path("sound.wav")}), "holds no video");
  }
}

}  // namespace
}  // namespace kiroku::test

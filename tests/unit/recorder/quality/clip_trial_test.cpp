#include "recorder/quality/clip_trial.h"

#include <fstream>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/error.h"
#include "recorder/quality/shown_film.h"
#include "tests/support/full_range_film.h"
#include "tests/support/temporary_folder.h"
#include "tests/support/textured_film.h"

namespace kiroku::recorder {
namespace {

using testing::HasSubstr;
using testing::Throws;
using testing::ThrowsMessage;

class ClipTrial : public testing::Test {
 protected:
  std::filesystem::path film(int width, int height, int pictures) {
    const std::filesystem::path file = folder_ / ("film" + std::to_string(++films_) + ".mp4");
    test::write_textured_film(file, width, height, pictures);
    return file;
  }
  static CodingFigures figures_of(const TrialResult& result, CodingFamily family, std::int64_t rate = 0) {
    for (const CodingFigures& one : result.codings) {
      if (one.coding.family == family && one.coding.bit_rate == rate) return one;
    }
    throw Error("not tried");
  }

  test::TemporaryFolder folder_;
  int films_ = 0;
};

TEST_F(ClipTrial, TellsWhatEachCodingLeaves) {
  using enum CodingFamily;
  TrialOptions options;
  options.measured = 4;
  options.shown = 2;
  const TrialResult result = try_codings(film(320, 192, 50),
                                         {{kMpeg2, 300'000},
                                          {kMpeg2, 4'000'000},
                                          {kMpeg2Chroma422, 4'000'000},
                                          {kLossless, 0},
                                          {kUncompressed, 0},
                                          {kH264, 4'000'000},
                                          {kH265, 4'000'000}},
                                         options);
  EXPECT_EQ(result.facts.pictures, 50U);
  EXPECT_NEAR(result.facts.seconds, 2, 0.05);
  EXPECT_EQ(result.facts.width, 320);
  EXPECT_EQ(result.facts.shown.size(), 2U);
  EXPECT_EQ(result.facts.originals.size(), 2U);
  EXPECT_GT(result.facts.fine_texture, 0);
  for (const CodingFigures& one : result.codings) EXPECT_EQ(one.refused, "") << one.coding.name();

  for (const CodingFamily family : {kLossless, kUncompressed}) {
    const CodingFigures kept = figures_of(result, family);
    EXPECT_TRUE(kept.identical);
    EXPECT_FALSE(kept.psnr);
    EXPECT_NEAR(kept.ssim, 1, 1e-6);
    EXPECT_NEAR(kept.ms_ssim, 1, 1e-6);
    EXPECT_NEAR(kept.fine_kept, 1, 1e-9);
    EXPECT_NEAR(kept.edges, 1, 1e-9);
    EXPECT_EQ(kept.colour_mean, 0);
    EXPECT_TRUE(kept.pictures.empty());
  }
  // 4:2:0 of 320x192, 25 a second, and what the container adds.
  const double raw = 320 * 192 * 1.5 * 25 * 3600;
  EXPECT_NEAR(figures_of(result, kUncompressed).bytes_per_hour, raw, 0.02 * raw);
  EXPECT_LT(figures_of(result, kLossless).bytes_per_hour, raw);

  const CodingFigures poor = figures_of(result, kMpeg2, 300'000),
                      good = figures_of(result, kMpeg2, 4'000'000);
  EXPECT_LT(*poor.psnr, *good.psnr);
  EXPECT_LT(poor.ssim, good.ssim);
  EXPECT_LT(poor.ms_ssim, good.ms_ssim);
  EXPECT_LT(poor.fine_kept, good.fine_kept);
  EXPECT_LT(poor.edges, good.edges);
  EXPECT_GT(poor.colour_mean, good.colour_mean);
  EXPECT_GE(poor.colour_worst, poor.colour_mean);
  EXPECT_LT(poor.bytes_per_hour, good.bytes_per_hour);
  EXPECT_EQ(poor.pictures.size(), 2U);
  // A picture beside its neighbour would be far off: what comes back is compared with what it was.
  for (const CodingFamily family : {kMpeg2, kMpeg2Chroma422, kH264, kH265})
    EXPECT_GT(*figures_of(result, family, 4'000'000).psnr, 30) << coding_word(family);
}

TEST_F(ClipTrial, TakesNoContrastOfFullRangeThatACodingDidNot) {
  using enum CodingFamily;
  test::write_full_range_film(folder_ / "full.mkv", 320, 192, 30);
  ASSERT_EQ(Clip(folder_ / "full.mkv", {}).format().colour_range, AVCOL_RANGE_JPEG);
  TrialOptions options;
  options.measured = 2;
  const TrialResult result =
      try_codings(folder_ / "full.mkv",
                  {{kMpeg2, 4'000'000}, {kLossless, 0}, {kH264, 4'000'000}, {kH265, 4'000'000}}, options);
  for (const CodingFigures& one : result.codings) {
    ASSERT_EQ(one.refused, "") << one.coding.name();
    if (one.psnr) {
      EXPECT_GT(*one.psnr, 40) << one.coding.name();
      EXPECT_LT(one.colour_mean, 1) << one.coding.name();
    }
  }
  EXPECT_TRUE(figures_of(result, kLossless).identical);
  for (const CodingFamily family : {kH264, kH265})
    EXPECT_GT(*figures_of(result, family, 4'000'000).psnr, 45) << coding_word(family);
}

TEST_F(ClipTrial, KnowsWhetherTheFilmsOwnCodingLoses) {
  const auto coding_of = [&](const std::filesystem::path& file) { return Clip(file, {}).coding(); };
  const std::filesystem::path lossy = film(320, 192, 30);
  EXPECT_EQ(coding_of(lossy).name, "h264");
  EXPECT_EQ(coding_of(lossy).loss, CodingLoss::kCertain);
  test::write_full_range_film(folder_ / "ffv1.mkv", 192, 176, 30);
  EXPECT_EQ(coding_of(folder_ / "ffv1.mkv").name, "ffv1");
  EXPECT_EQ(coding_of(folder_ / "ffv1.mkv").loss, CodingLoss::kNone);
  test::write_full_range_film(folder_ / "raw.mkv", 192, 176, 30, Profile::kUncompressed);
  EXPECT_EQ(coding_of(folder_ / "raw.mkv").name, "rawvideo");
  EXPECT_EQ(coding_of(folder_ / "raw.mkv").loss, CodingLoss::kNone);
  // H.264 without loss: nothing but its pictures tells.
  write_shown_film(lossy, {}, {CodingFamily::kUncompressed, 0}, folder_ / "shown.mp4", {});
  EXPECT_EQ(coding_of(folder_ / "shown.mp4").loss, CodingLoss::kPossible);
  // What is told of a film is what its trial tells.
  TrialOptions options;
  options.measured = 1;
  options.stretch = {0, 1'000'000'000};
  EXPECT_EQ(try_codings(lossy, {}, options).facts.coding.loss, CodingLoss::kCertain);
}

TEST_F(ClipTrial, MeasuresTheStretchThatIsAskedFor) {
  TrialOptions options;
  options.measured = 2;
  options.stretch = {500'000'000, 1'000'000'000};
  const TrialResult result = try_codings(film(192, 176, 60), {{CodingFamily::kLossless, 0}}, options);
  EXPECT_EQ(result.facts.pictures, 25U);
  EXPECT_TRUE(result.codings.front().identical);
}

TEST_F(ClipTrial, GoesOnWhereACodingCannotHoldThePictures) {
  TrialOptions options;
  options.measured = 2;
  const TrialResult result =
      try_codings(film(192, 176, 30), {{CodingFamily::kMpeg2, 10}, {CodingFamily::kLossless, 0}}, options);
  EXPECT_THAT(result.codings.front().refused, HasSubstr("bit rate"));
  EXPECT_TRUE(result.codings.back().identical);
}

TEST_F(ClipTrial, RefusesWhatCannotBeMeasured) {
  const std::vector<Coding> codings{{CodingFamily::kLossless, 0}};
  const auto tried = [&](const std::filesystem::path& file) {
    return [&, file] { try_codings(file, codings, {}); };
  };
  EXPECT_THAT(tried(folder_ / "none.mp4"), ThrowsMessage<UsageError>(HasSubstr("there is no film")));
  EXPECT_THAT(tried(film(192, 176, 10)), ThrowsMessage<UsageError>(HasSubstr("has 0.4 s of pictures")));
  EXPECT_THAT(tried(film(320, 160, 30)), ThrowsMessage<UsageError>(HasSubstr("at least 176")));
  std::ofstream(folder_ / "notes.mp4") << "no film at all\n";
  EXPECT_THAT(tried(folder_ / "notes.mp4"), ThrowsMessage<Error>(HasSubstr("notes.mp4")));
}

TEST_F(ClipTrial, EndsWhenItsProgressSaysSo) {
  TrialOptions options;
  options.progress = [](const std::string& doing, std::uint64_t, std::uint64_t) {
    if (doing.starts_with("MPEG-2")) throw Error("enough");
  };
  EXPECT_THAT([&] { try_codings(film(192, 176, 30), usual_codings(), options); },
              ThrowsMessage<Error>(HasSubstr("enough")));
}

TEST(Coding, HasAWordForEachFamilyAndEachProfileIsUsual) {
  for (const Coding& coding : usual_codings()) {
    EXPECT_EQ(parse_coding(coding_word(coding.family)), coding.family);
    EXPECT_EQ(has_rate(coding.family), coding.bit_rate > 0);
  }
  EXPECT_EQ((Coding{CodingFamily::kMpeg2, 4'000'000}.name()), "MPEG-2 4:2:0, 4 Mbit/s");
  EXPECT_EQ((Coding{CodingFamily::kH265, 800'000}.name()), "H.265, 0.8 Mbit/s");
  EXPECT_THAT([] { (void)parse_coding("vp9"); },
              ThrowsMessage<UsageError>(HasSubstr("known are mpeg2, mpeg2-422")));
}

}  // namespace
}  // namespace kiroku::recorder

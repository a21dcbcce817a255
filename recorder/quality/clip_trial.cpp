#include "recorder/quality/clip_trial.h"

extern "C" {
#include <libavutil/frame.h>
}

#include <algorithm>
#include <cmath>
#include <deque>
#include <future>
#include <map>
#include <memory>
#include <utility>

#include "base/error.h"
#include "base/number_text.h"
#include "media/png.h"
#include "media/quality/colour_difference.h"
#include "media/quality/edges.h"
#include "media/quality/fine_texture.h"
#include "media/quality/picture_pair_filter.h"
#include "media/quality/structural_similarity.h"
#include "media/rgb_converter.h"
#include "recorder/encoder/frame_filter.h"

namespace kiroku::recorder {
namespace {

constexpr double kFinePeriod = 4, kMiddlePeriod = 8;
/// With less tissue than this the clip shows something else.
constexpr double kLeastTissue = 0.05;

struct Colours {
  int width = 0, height = 0;
  std::vector<std::uint8_t> samples;
  [[nodiscard]] media::PictureView view() const { return {width, height, 3, samples}; }
};

/// The clip's own pictures first, so that what is measured is chosen by what was filmed, whatever the coding.
class Survey {
 public:
  Survey(const std::filesystem::path& file, const TrialOptions& options) {
    look(file, options);
    choose(file, options);
  }

  ClipFacts facts;
  std::vector<std::uint64_t> measured;  // numbers of pictures, rising

 private:
  void look(const std::filesystem::path& file, const TrialOptions& options) {
    Clip clip(file, options.stretch);
    const PictureFormat& format = clip.format();
    facts.pictures_are = clip.described();
    facts.coding = clip.coding();
    facts.width = format.width;
    facts.height = format.height;
    facts.depth = clip.depth();
    facts.rate = double(clip.frame_rate().numerator) / clip.frame_rate().denominator;
    facts.file_bytes = std::filesystem::file_size(file);
    if (std::min(facts.width, facts.height) < media::kFewestMsSsimPixels) {
      throw UsageError(file.string() + " shows pictures of " + std::to_string(facts.width) + "x" +
                       std::to_string(facts.height) + ": each side must have at least " +
                       std::to_string(media::kFewestMsSsimPixels) + " pixels");
    }
    std::int64_t last_ns = 0;
    while (const media::Frame frame = clip.next()) {
      last_ns = frame->pts;
      ++facts.pictures;
      if (options.progress) options.progress("counting pictures", facts.pictures, 0);
    }
    facts.seconds = facts.pictures == 0 ? 0 : static_cast<double>(last_ns) * 1e-9 + 1 / facts.rate;
    if (facts.seconds < kShortestClipSeconds) {
      throw UsageError(file.string() + " has " + number_text(facts.seconds, 3) +
                       " s of pictures where it is measured; an encoder needs at least 1 s to find its rate");
    }
    const std::uint64_t count = std::min<std::uint64_t>(options.measured, facts.pictures);
    for (std::uint64_t i = 0; i < count; ++i) measured.push_back((2 * i + 1) * facts.pictures / (2 * count));
  }

  void choose(const std::filesystem::path& file, const TrialOptions& options) {
    Clip clip(file, options.stretch);
    media::RgbConverter converter;
    struct Seen {
      std::uint64_t number = 0;
      double energy = 0;
      Bytes png;
    };
    std::vector<Seen> seen;
    double tissue = 0;
    media::TextureKept on_tissue, everywhere;
    std::uint64_t number = 0;
    for (const std::uint64_t wanted : measured) {
      media::Frame frame;
      do {
        frame = clip.next();
      } while (frame && number++ < wanted);
      if (!frame) throw Error(file.string() + " changed while it was measured");
      const Colours colours{frame->width, frame->height, converter.convert(*frame)};
      const std::vector<std::uint8_t> mask = media::tissue_mask(colours.view());
      tissue += media::share_of(mask) / static_cast<double>(measured.size());
      const media::Plane band = media::band_of(media::luma_of(*frame), kFinePeriod);
      on_tissue.add(band, band, mask);
      media::TextureKept own;
      own.add(band, band, std::vector<std::uint8_t>(mask.size(), 1));
      everywhere.add(band, band, std::vector<std::uint8_t>(mask.size(), 1));
      seen.push_back({wanted, own.energy(), {}});
      if (options.shown > 0) seen.back().png = media::png_of(colours.view());
      if (options.progress) options.progress("looking at pictures", seen.size(), measured.size());
    }
    facts.tissue = tissue;
    facts.whole_picture = tissue < kLeastTissue;
    facts.fine_texture = std::sqrt((facts.whole_picture ? everywhere : on_tissue).energy());
    std::ranges::stable_sort(seen, std::greater<>(), &Seen::energy);
    const std::size_t shown = std::min(options.shown, seen.size());
    // From the most textured on, evenly through all.
    std::vector<const Seen*> kept;
    for (std::size_t i = 0; i < shown; ++i) kept.push_back(&seen[i * seen.size() / shown]);
    std::ranges::sort(kept, {}, &Seen::number);
    for (Seen const* one : kept) {
      facts.shown.push_back(one->number);
      facts.originals.push_back(one->png);
    }
  }
};

/// Measures the pictures of one coding as they come.
class Judge {
 public:
  Judge(const Survey& survey, const PictureFormat& format) : survey_(survey), format_(format) {}

  void take(const AVFrame& original, media::Frame coded) {
    coded->pts = original.pts;
    coded = as_format(std::move(coded), format_, filter_);
    if (!pairs_) pairs_ = std::make_unique<media::PicturePairFilter>(original);
    const media::PairMeasures measures = pairs_->measure(*coded, original);
    identical_ = identical_ && same_samples(original, *coded);
    error_ += measures.mean_square_error;
    ssim_ += measures.ssim;
    if (std::ranges::binary_search(survey_.measured, pictures_)) look_closely(original, *coded);
    ++pictures_;
  }

  [[nodiscard]] std::uint64_t pictures() const { return pictures_; }
  void state(CodingFigures& figures) {
    const auto all = static_cast<double>(pictures_), some = static_cast<double>(closely_);
    figures.psnr = media::psnr_of(error_ / all, survey_.facts.depth);
    figures.identical = identical_;
    figures.ssim = ssim_ / all;
    figures.ms_ssim = ms_ssim_ / some;
    figures.fine_kept = fine_.kept();
    figures.fine_foreign = fine_.foreign();
    figures.middle_kept = middle_.kept();
    figures.edges = edges_ / some;
    figures.colour_mean = colours_.mean();
    constexpr double kNearlyAll = 0.95;
    figures.colour_worst = colours_.quantile(kNearlyAll);
    if (!figures.identical) figures.pictures = std::move(pngs_);
  }

 private:
  void look_closely(const AVFrame& original, const AVFrame& coded) {
    const Colours before{original.width, original.height, converter_.convert(original)};
    const Colours after{coded.width, coded.height, converter_.convert(coded)};
    const media::Plane luma1 = media::luma_of(original), luma2 = media::luma_of(coded);
    // Three measures of about the same weight, side by side.
    std::future<void> colours =
        std::async(std::launch::async, [&] { colours_.add(before.view(), after.view()); });
    std::future<void> structure = std::async(std::launch::async, [&] {
      ms_ssim_ += media::ms_ssim(luma1, luma2);
      edges_ += media::edges_kept(luma1, luma2);
    });
    std::vector<std::uint8_t> mask = media::tissue_mask(before.view());
    if (survey_.facts.whole_picture) std::ranges::fill(mask, std::uint8_t{1});
    fine_.add(media::band_of(luma1, kFinePeriod), media::band_of(luma2, kFinePeriod), mask);
    middle_.add(media::band_of(luma1, kMiddlePeriod), media::band_of(luma2, kMiddlePeriod), mask);
    colours.get();
    structure.get();
    if (std::ranges::binary_search(survey_.facts.shown, pictures_))
      pngs_.push_back(media::png_of(after.view()));
    ++closely_;
  }

  const Survey& survey_;
  const PictureFormat format_;
  std::unique_ptr<FrameFilter> filter_;
  std::unique_ptr<media::PicturePairFilter> pairs_;
  media::RgbConverter converter_;
  media::ColourError colours_;
  media::TextureKept fine_, middle_;
  bool identical_ = true;
  double error_ = 0, ssim_ = 0, ms_ssim_ = 0, edges_ = 0;
  std::uint64_t pictures_ = 0, closely_ = 0;
  std::vector<Bytes> pngs_;
};

CodingFigures try_coding(const std::filesystem::path& file, const Coding& coding, const Survey& survey,
                         const TrialOptions& options) {
  CodingFigures figures;
  figures.coding = coding;
  Clip clip(file, options.stretch);
  std::unique_ptr<RoundTrip> trip;
  try {
    trip = std::make_unique<RoundTrip>(coding, clip.format(), clip.frame_rate());
  } catch (const Error& error) {
    figures.refused = error.what();
    return figures;
  }
  Judge judge(survey, clip.format());
  std::deque<media::Frame> waiting;
  const RoundTrip::Taker take = [&](media::Frame coded) {
    if (waiting.empty()) throw Error(coding.name() + " gave more pictures than it was given");
    judge.take(*waiting.front(), std::move(coded));
    waiting.pop_front();
    if (options.progress) options.progress(coding.name(), judge.pictures(), survey.facts.pictures);
  };
  while (media::Frame frame = clip.next()) {
    waiting.push_back(media::reference(*frame));
    trip->put(*frame, take);
  }
  trip->finish(take);
  if (judge.pictures() != survey.facts.pictures || !waiting.empty()) {
    throw Error(coding.name() + " gave " + std::to_string(judge.pictures()) + " pictures of " +
                std::to_string(survey.facts.pictures) + " back, so they cannot be compared");
  }
  judge.state(figures);
  constexpr double kHour = 3600;
  figures.bytes_per_hour = static_cast<double>(trip->bytes()) * kHour / survey.facts.seconds;
  return figures;
}

}  // namespace

TrialResult try_codings(const std::filesystem::path& clip, const std::vector<Coding>& codings,
                        const TrialOptions& options) {
  if (options.measured == 0) throw UsageError("at least one picture must be measured");
  const Survey survey(clip, options);
  TrialResult result{survey.facts, {}};
  for (const Coding& coding : codings) result.codings.push_back(try_coding(clip, coding, survey, options));
  return result;
}

}  // namespace kiroku::recorder

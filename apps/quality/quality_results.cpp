#include "apps/quality/quality_results.h"

#include <algorithm>
#include <array>
#include <cstdio>
#include <functional>
#include <optional>

#include <nlohmann/json.hpp>

#include "apps/common/command_line.h"
#include "apps/common/format.h"
#include "base/number_text.h"
#include "trainer/report/plot.h"

namespace kiroku::apps {
namespace {

using nlohmann::ordered_json;
using recorder::CodingFamily;
using recorder::CodingFigures;

std::string fixed(double value, int digits) {
  char text[48];
  std::snprintf(text, sizeof text, "%.*f", digits, value);
  return text;
}

std::string percent(double share) { return fixed(100 * share, 1) + " %"; }
double megabits(const CodingFigures& figures) { return figures.bytes_per_hour * 8 / 3600 * 1e-6; }

/// Of quality_table().
constexpr std::ptrdiff_t kMiddleTextureColumn = 7;

struct Measure {
  const char* file;
  const char* title;
  const char* y_label;
  std::function<std::optional<double>(const CodingFigures&)> value;
};
const std::vector<Measure>& measures() {
  static const std::vector<Measure> all{
      {"fine-texture", "Fine texture kept (periods of about 4 pixels)", "kept, %",
       [](const CodingFigures& f) { return std::optional(100 * f.fine_kept); }},
      {"psnr", "PSNR", "dB", [](const CodingFigures& f) { return f.psnr; }},
      {"ssim", "SSIM", "SSIM", [](const CodingFigures& f) { return std::optional(f.ssim); }},
      {"ms-ssim", "MS-SSIM", "MS-SSIM", [](const CodingFigures& f) { return std::optional(f.ms_ssim); }},
      {"colour", "Colour error", "mean CIEDE2000",
       [](const CodingFigures& f) { return std::optional(f.colour_mean); }}};
  return all;
}

struct Line {
  CodingFamily family;
  const char* name;
};
constexpr std::array<Line, 6> kLines{{{CodingFamily::kMpeg2, "MPEG-2 4:2:0"},
                                      {CodingFamily::kMpeg2Chroma422, "MPEG-2 4:2:2"},
                                      {CodingFamily::kH264, "H.264"},
                                      {CodingFamily::kH265, "H.265"},
                                      {CodingFamily::kLossless, "lossless"},
                                      {CodingFamily::kUncompressed, "uncompressed"}}};

trainer::Plot plot_of(const ClipResult& clip, const Measure& measure) {
  trainer::Plot plot;
  plot.title = measure.title;
  plot.x_label = "Mbit/s, as coded";
  plot.y_label = measure.y_label;
  plot.logarithmic_x = true;
  plot.note = clip.name;
  for (const Line& line : kLines) {
    trainer::PlotSeries series;
    series.name = line.name;
    std::vector<std::pair<double, double>> points;
    for (const CodingFigures& one : clip.trial.codings) {
      if (one.coding.family != line.family || !one.refused.empty()) continue;
      if (const auto value = measure.value(one)) points.emplace_back(megabits(one), *value);
    }
    std::ranges::sort(points);
    for (const auto& [x, y] : points) series.x.push_back(x), series.y.push_back(y);
    // Each family keeps its colour in all plots.
    plot.series.push_back(std::move(series));
  }
  return plot;
}

const char* word_of(recorder::CodingLoss loss) {
  switch (loss) {
    case recorder::CodingLoss::kNone:
      return "no";
    case recorder::CodingLoss::kPossible:
      return "possibly";
    case recorder::CodingLoss::kCertain:
      return "yes";
    case recorder::CodingLoss::kUnknown:
      break;
  }
  return "unknown";
}

/// What the film's own coding has taken before; "" where that is nothing.
std::string loss_sentence(const recorder::SourceCoding& coding) {
  const std::string named = coding.name.empty() ? "" : " (" + coding.name + ")";
  constexpr const char* kRest = ": what that has lost is missing before, and all figures are of the rest.";
  switch (coding.loss) {
    case recorder::CodingLoss::kNone:
      return "";
    case recorder::CodingLoss::kPossible:
      return " The film may be compressed itself" + named + kRest;
    case recorder::CodingLoss::kCertain:
      return " The film is compressed itself" + named + kRest;
    case recorder::CodingLoss::kUnknown:
      break;
  }
  return " Whether the film is compressed itself" + named + " is not known.";
}

}  // namespace

std::vector<std::vector<std::string>> quality_table(const ClipResult& clip) {
  std::vector<std::vector<std::string>> rows{{"coding", "an hour", "PSNR", "SSIM", "MS-SSIM", "fine texture",
                                              "false", "8 px texture", "edges", "dE mean", "dE 95 %"}};
  for (const CodingFigures& one : clip.trial.codings) {
    if (!one.refused.empty()) continue;
    rows.push_back({one.coding.name(), format_bytes(static_cast<std::uint64_t>(one.bytes_per_hour)),
                    one.identical ? "identical"
                    : one.psnr    ? fixed(*one.psnr, 1) + " dB"
                                  : "no error",
                    fixed(one.ssim, 4), fixed(one.ms_ssim, 4), percent(one.fine_kept),
                    percent(one.fine_foreign), percent(one.middle_kept), fixed(one.edges, 3),
                    fixed(one.colour_mean, 2), fixed(one.colour_worst, 2)});
  }
  return rows;
}

std::string quality_facts(const ClipResult& clip) {
  const recorder::ClipFacts& facts = clip.trial.facts;
  std::string text = clip.name + ": " + facts.pictures_are + ", " + std::to_string(facts.pictures) +
                     " pictures measured, " + fixed(facts.seconds, 1) + " s. ";
  text += facts.whole_picture
              ? "It shows hardly any lit tissue (" + percent(facts.tissue) +
                    " of it), so that texture is measured in the whole picture. "
              : percent(facts.tissue) + " of it is lit tissue, in which texture is measured. ";
  text += "Its fine texture has " + fixed(facts.fine_texture, 2) + " of 255 steps (root mean square).";
  text += loss_sentence(facts.coding);
  return text;
}

std::vector<std::string> not_tried(const ClipResult& clip) {
  std::vector<std::string> sentences;
  for (const CodingFigures& one : clip.trial.codings) {
    if (!one.refused.empty()) sentences.push_back(one.coding.name() + " was not tried: " + one.refused);
  }
  return sentences;
}

std::string quality_text(const ClipResult& clip) {
  std::string text =
      printable(quality_facts(clip)) + "\n\n" + format_table(quality_table(clip), "lrrrrrrrrrr", 0);
  for (const std::string& sentence : not_tried(clip)) text += "\n" + printable(sentence) + "\n";
  return text;
}

ordered_json quality_json(const std::vector<ClipResult>& clips) {
  ordered_json all{
      {"measures",
       {{"bytes_per_hour", "of the container before sealing; MPEG-TS or Matroska in segments of 2 s"},
        {"psnr_db", "FFmpeg's filter psnr, over all samples of all pictures; null: no error"},
        {"ssim", "FFmpeg's filter ssim, mean of all pictures"},
        {"ms_ssim", "Wang, Simoncelli and Bovik 2003, luma"},
        {"fine_texture_kept",
         "share of the original's energy in periods of about 4 pixels that comes back in phase"},
        {"fine_texture_false",
         "energy in that band that is not the original's, as a share of the original's"},
        {"texture_8px_kept", "as fine_texture_kept, in periods of about 8 pixels"},
        {"edges", "correlation after a Laplacian, Sattar et al. 1997"},
        {"colour_mean", "mean CIEDE2000"},
        {"colour_95", "CIEDE2000 that 95 of 100 pixels do not exceed"}}},
      {"clips", ordered_json::array()}};
  for (const ClipResult& clip : clips) {
    const recorder::ClipFacts& facts = clip.trial.facts;
    ordered_json codings = ordered_json::array();
    for (const CodingFigures& one : clip.trial.codings) {
      ordered_json entry{{"coding", recorder::coding_word(one.coding.family)},
                         {"name", one.coding.name()},
                         {"kiroku_profile", one.coding.is_ours()}};
      if (one.coding.bit_rate > 0) entry["bit_rate"] = one.coding.bit_rate;
      if (!one.refused.empty()) {
        entry["refused"] = one.refused;
      } else {
        entry.update({{"bytes_per_hour", one.bytes_per_hour},
                      {"identical", one.identical},
                      {"psnr_db", one.psnr ? ordered_json(*one.psnr) : ordered_json(nullptr)},
                      {"ssim", one.ssim},
                      {"ms_ssim", one.ms_ssim},
                      {"fine_texture_kept", one.fine_kept},
                      {"fine_texture_false", one.fine_foreign},
                      {"texture_8px_kept", one.middle_kept},
                      {"edges", one.edges},
                      {"colour_mean", one.colour_mean},
                      {"colour_95", one.colour_worst}});
      }
      codings.push_back(std::move(entry));
    }
    all["clips"].push_back(
        {{"clip", clip.name},
         {"pictures_are", facts.pictures_are},
         {"coded_as", facts.coding.name.empty() ? ordered_json(nullptr) : ordered_json(facts.coding.name)},
         {"coding_loses", word_of(facts.coding.loss)},
         {"rate", facts.rate},
         {"pictures", facts.pictures},
         {"seconds", facts.seconds},
         {"file_bytes", facts.file_bytes},
         {"tissue_share", facts.tissue},
         {"texture_measured_in", facts.whole_picture ? "whole picture" : "lit tissue"},
         {"fine_texture_rms", facts.fine_texture},
         {"shown_pictures", facts.shown},
         {"codings", std::move(codings)}});
  }
  return all;
}

std::vector<NamedPlot> quality_plots(const ClipResult& clip) {
  std::vector<NamedPlot> plots;
  for (const Measure& measure : measures()) {
    plots.push_back({clip.prefix + "-" + measure.file + ".svg",
                     trainer::plot_file(plot_of(clip, measure), trainer::PlotForm::kSvg)});
  }
  return plots;
}

Bytes quality_pdf(const std::vector<ClipResult>& clips) {
  std::vector<trainer::ReportBlock> blocks;
  for (const ClipResult& clip : clips) {
    trainer::ReportBlock block;
    block.heading = clip.name;
    block.text = quality_facts(clip);
    block.table = quality_table(clip);
    // A4 has no room for it; the page and the JSON have it.
    for (auto& row : block.table) row.erase(row.begin() + kMiddleTextureColumn);
    blocks.push_back(std::move(block));
    for (const std::string& sentence : not_tried(clip)) blocks.push_back({"", sentence, {}, {}});
    for (const Measure& measure : measures()) blocks.push_back({"", "", {}, plot_of(clip, measure)});
  }
  return trainer::report_pdf("What each coding leaves of a clip", blocks);
}

}  // namespace kiroku::apps

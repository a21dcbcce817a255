#include "apps/sim/comparison_films.h"

#include <algorithm>
#include <cmath>
#include <memory>
#include <string>

#include "apps/common/command_line.h"
#include "apps/common/file.h"
#include "apps/sim/number_option.h"
#include "apps/sim/picture_options.h"
#include "apps/sim/plan_reading.h"
#include "base/error.h"
#include "crypto/hash.h"
#include "media/film_writer.h"
#include "media/png.h"
#include "sim/align/lens_file.h"
#include "sim/drr/dicom_radiograph.h"
#include "sim/drr/picture.h"
#include "sim/volume/volume_reader.h"

namespace kiroku::apps {
namespace {

namespace fs = std::filesystem;

constexpr std::int64_t kNsPerSecond = 1'000'000'000;

compare::CompositionForm form_of(const ComparisonRequest& request, const compare::PictureSize& size) {
  compare::CompositionForm form;
  const std::string arrangement = request.form.value_or("beside");
  form.arrangement = arrangement == "overlay" ? compare::Arrangement::kOverlay
                     : arrangement == "wipe"  ? compare::Arrangement::kWipe
                                              : compare::Arrangement::kSideBySide;
  if (request.share) form.share = parse_number(*request.share, "--share", 0, 1);
  form.width = size.width;
  form.height = size.height;
  form.from_plan = request.colours == "plan";
  return form;
}

/// A picture each time step, with a key frame each half a second.
media::FilmFormat plan_film_format(const sim::Plan& plan, int width, int height, int channels) {
  constexpr int kMillisecondsPerSecond = 1000;
  const int step_ms = static_cast<int>(std::lround(plan.time_step_s * kMillisecondsPerSecond));
  media::FilmFormat format{width, height, channels, kMillisecondsPerSecond, step_ms};
  format.key_interval = std::max(1, kMillisecondsPerSecond / step_ms / 2);
  return format;
}

/// Each time step, as fast as it was planned.
void for_each_moment(const sim::Plan& plan, const sim::PlanFrames& frames, ComparisonTold& told,
                     const std::function<void(const sim::PlanFrames::Kept&)>& take) {
  const auto count = std::llround(duration_s(plan) / plan.time_step_s) + 1;
  for (long long number = 0; number < count; ++number) {
    constexpr double kSameMomentS = 1e-9;
    const double at_s = double(number) * plan.time_step_s + kSameMomentS;
    const auto after = std::ranges::upper_bound(
        frames.all(), at_s, {}, [](const sim::PlanFrames::Kept& kept) { return kept.frame.time_s; });
    take(*std::prev(after));  // the first is of time 0
    told.update(double(number) / double(count));
  }
}

}  // namespace

const sim::PlanFrames& SimulatedPlan::get() {
  if (!frames_) {
    told_.begin("carrying out the plan");
    const double all_s = std::max(1e-9, duration_s(plan_));
    frames_.emplace(plan_, [&](double time_s) { told_.update(time_s / all_s); });
  }
  return *frames_;
}

const sim::Volume& PlanCt::get() {
  if (!volume_) {
    told_.begin("reading the CT");
    const fs::path ct = request_.volume ? fs::path(*request_.volume) : plan_.volume;
    if (ct.empty()) {
      throw UsageError(
          "the plan names no CT that could be shown: name one with --volume, or ask for figures alone "
          "(-o OUT.json)");
    }
    // The plan was made on it as it lies: what is uneven or may be missing is told.
    sim::VolumeFile file = sim::read_volume(ct, {request_.series.value_or(""), true});
    told_.clear();
    // Programs read standard error by the line.
    if (request_.progress != "json") {
      for (const std::string& finding : file.findings) print_error("kiroku", "warning: the CT: " + finding);
    }
    volume_ = std::move(file.volume);
  }
  return *volume_;
}

PlanView::PlanView(const ComparisonRequest& request, const archive::CaseReader& recording,
                   const crypto::AgeIdentities& identities, const compare::Comparison& comparison,
                   const sim::Plan& plan, PlanCt& ct, std::int64_t from_ns) {
  PictureOptions options;
  options.transfer = request.transfer;
  options.view = request.view;
  options.zoom = request.zoom;
  options.gpu = request.gpu;
  constexpr int kWidest = 640;
  const int widest =
      request.width ? static_cast<int>(parse_number(*request.width, "--width", 64, 4096)) : kWidest;
  size_ = compare::picture_size(recording, identities, comparison.stream, from_ns, widest);
  options.size = std::to_string(size_.width) + "x" + std::to_string(size_.height);
  const sim::Scene scene = options.scene(sim::view_of_plan(plan));
  background_ = scene.background;
  pictures_.emplace(plan,
                    std::make_shared<const sim::ShadedVolume>(
                        sim::shade(ct.get(), sim::extent_of(plan.body.mesh), options.shading())),
                    options.transfer_function("liver"), options.engine_choice(), scene);
}

compare::CompositionForm PlanView::form(const ComparisonRequest& request,
                                        const compare::Provenance& made) const {
  compare::CompositionForm form = form_of(request, size_);
  form.plan_background = background_;
  form.cautions = compare::cautions_of(made);
  return form;
}

archive::Span shown_span(const ComparisonRequest& request, const archive::CaseReader& recording,
                         const compare::Comparison& comparison) {
  const auto& pieces = comparison.map->pieces();
  archive::Span span{
      std::max(comparison.case_begins_ns, pieces.front().knots.front().case_ns - kNsPerSecond),
      std::min(comparison.recording_end_ns, pieces.back().knots.back().case_ns + kNsPerSecond)};
  const archive::Span asked = recording.parse_stretch(request.from, request.to);
  if (request.from) span.start_ns = asked.start_ns;
  if (request.to) span.end_ns = asked.end_ns;
  recording.require_stretch(span, {"--from", request.from.value_or("a second before the first step")},
                            {"--to", request.to.value_or("a second after the last step")});
  return span;
}

std::uint64_t write_film(const ComparisonRequest& request, const archive::Span& span, int width, int height,
                         const std::function<sim::Picture(std::int64_t case_ns)>& picture_at,
                         ComparisonTold& told) {
  constexpr int kRate = 25;
  const double speed = request.speed ? parse_number(*request.speed, "--speed", 0.05, 1000) : 1;
  const double step_ns = speed * double(kNsPerSecond) / kRate;
  media::FilmWriter film(*request.output, {width, height, 3, kRate, 1}, request.force);
  told.begin("making the film");
  const double all_ns = double(span.end_ns - span.start_ns);
  for (std::int64_t number = 0;; ++number) {
    const double since_ns = double(number) * step_ns;
    if (since_ns >= all_ns) break;
    const sim::Picture picture = picture_at(span.start_ns + std::llround(since_ns));
    film.add(view_of(picture));
    told.update(since_ns / all_ns);
  }
  film.finish();
  return film.frames();
}

std::uint64_t write_plan_film(const fs::path& file, const sim::Plan& plan, const sim::PlanFrames& frames,
                              sim::PlanPictures& pictures, ComparisonTold& told) {
  media::FilmWriter film(file, plan_film_format(plan, pictures.scene().width, pictures.scene().height, 3));
  told.begin("making the plan's film");
  for_each_moment(plan, frames, told, [&](const sim::PlanFrames::Kept& kept) {
    film.add(view_of(pictures.picture(kept.frame, *kept.mesh)));
  });
  film.finish();
  return film.frames();
}

std::uint64_t write_radiograph_film(const fs::path& file, const sim::Plan& plan,
                                    const sim::PlanFrames& frames, compare::PlanRadiographs& radiographs,
                                    const compare::Fluoroscopy& fluoroscopy, ComparisonTold& told) {
  const int width = static_cast<int>(fluoroscopy.geometry.columns()),
            height = static_cast<int>(fluoroscopy.geometry.rows());
  media::FilmWriter film(file, plan_film_format(plan, width, height, 1));
  told.begin("making the film of the plan's radiographs");
  const sim::Window window =
      sim::window_of(radiographs.project(frames.all().front(), fluoroscopy.geometry), sim::Response::kFilm);
  std::vector<std::uint8_t> samples;
  const sim::PlanFrames::Kept* shown = nullptr;
  for_each_moment(plan, frames, told, [&](const sim::PlanFrames::Kept& kept) {
    if (&kept != shown) {
      constexpr unsigned kByte = 8;
      const sim::GreyPicture picture = sim::picture_of(radiographs.project(kept, fluoroscopy.geometry),
                                                       sim::Response::kFilm, window, fluoroscopy.polarity);
      samples.clear();
      for (const std::uint16_t grey : picture.values)
        samples.push_back(static_cast<std::uint8_t>(grey >> kByte));
      shown = &kept;
    }
    film.add({width, height, 1, samples});
  });
  film.finish();
  return film.frames();
}

compare::FluoroscopyRequest fluoroscopy_request(const ComparisonRequest& request,
                                                const archive::CaseReader& recording,
                                                const compare::Comparison& comparison) {
  if (!comparison.map) {
    throw UsageError(
        "no step was found in the recording, so that it is not known which radiograph of the plan belongs to "
        "the "
        "fluoroscopy: match steps by hand (--by-hand)");
  }
  const auto& first = comparison.map->pieces().front().knots;
  const std::int64_t middle_ns = (first.front().case_ns + first.back().case_ns) / 2;
  const fs::path file = *request.geometry;
  return {compare::fluoroscopy_of(recording, request.fluoroscopy, "--fluoroscopy"),
          (sim::is_dicom_file(file) ? sim::read_dicom_geometry(file) : sim::read_geometry(file)).geometry,
          request.polarity == "bone-white" ? sim::Polarity::kBoneWhite : sim::Polarity::kBoneBlack,
          request.align_at ? recording.parse_time(*request.align_at, "--align-at") : middle_ns,
          request.align_at.has_value()};
}

double alignment_field_deg(const ComparisonRequest& request) {
  return parse_number(*request.field, "--field", sim::OrganTrack::kLeastFieldDeg,
                      sim::OrganTrack::kGreatestFieldDeg);
}

std::optional<compare::UsedLens> alignment_lens(const ComparisonRequest& request) {
  if (!request.lens) return {};
  const Bytes text = read_small_file(*request.lens, "the lens");
  const sim::LensCalibration calibration = sim::read_lens_calibration(text_of(text), *request.lens);
  try {
    return compare::UsedLens{
        sim::Lens(calibration),
        {"lens", fs::path(*request.lens).filename().string(), text.size(), crypto::sha256(text)}};
  } catch (const UsageError& error) {
    throw UsageError(*request.lens + ": " + error.what());
  }
}

bool is_deformed(const ComparisonRequest& request) { return request.organ == "deformed"; }

compare::AlignmentRequest alignment_request(const ComparisonRequest& request,
                                            const std::optional<compare::UsedLens>& lens,
                                            const archive::CaseReader& recording,
                                            const compare::Comparison& comparison) {
  compare::AlignmentRequest asked;
  asked.lens = lens;
  asked.field_deg = lens ? lens->lens.field_deg() : alignment_field_deg(request);
  asked.deformed = is_deformed(request);
  const sim::Camera from =
      sim::camera_looking_at({}, sim::view_direction(request.view.value_or("front")), 1, 1);
  asked.range.from = from.to_view.row(2).transpose();
  if (comparison.map) {
    asked.span = shown_span(request, recording, comparison);
    return asked;
  }
  const archive::Span stretch = recording.parse_stretch(request.from, request.to);
  asked.span = {request.from ? stretch.start_ns : comparison.case_begins_ns,
                request.to ? stretch.end_ns : comparison.recording_end_ns};
  return asked;
}

compare::RadiographForm radiograph_form(const ComparisonRequest& request) {
  using Form = compare::RadiographForm;
  const std::string form = request.form.value_or("beside");
  if (form == "overlay") return Form::kOpacity;
  if (form == "wipe") return Form::kWipe;
  if (form == "difference") return Form::kDifference;
  if (form == "checkerboard") return Form::kCheckerboard;
  if (form == "contour") return Form::kContour;
  return Form::kBeside;
}

std::vector<compare::StillPicture> stills(const compare::Comparison& comparison,
                                          compare::PairedPictures& pictures, ComparisonTold& told) {
  told.begin("making pictures");
  std::vector<compare::StillPicture> all;
  for (const compare::StepMatch& match : comparison.matching.matches) {
    const std::int64_t at_ns = (match.span.start_ns + match.span.end_ns) / 2;
    const sim::Picture picture = pictures.at(at_ns);
    const compare::Caption caption = pictures.caption_at(at_ns);
    all.push_back({std::to_string(match.step + 1) + ". " + comparison.steps[match.step].name + ": " +
                       caption.plan + ", " + caption.recording,
                   media::png_of(view_of(picture))});
  }
  return all;
}

}  // namespace kiroku::apps

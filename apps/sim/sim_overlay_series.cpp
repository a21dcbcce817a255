// 'kiroku sim overlay --radiographs': computed radiographs of a breathing patient over real ones, as a film.
#include <algorithm>
#include <cmath>
#include <iostream>
#include <memory>
#include <optional>

#include <nlohmann/json.hpp>

#include "apps/common/json_output.h"
#include "apps/common/progress.h"
#include "apps/sim/frame_series.h"
#include "apps/sim/moving_frames.h"
#include "apps/sim/overlay_request.h"
#include "apps/sim/patient_of_material.h"
#include "apps/sim/radiograph_series.h"
#include "base/error.h"
#include "base/number_text.h"
#include "media/film_writer.h"
#include "sim/drr/registration.h"
#include "sim/model/body_model.h"
#include "sim/respiration/line_plot.h"

namespace kiroku::apps {
namespace {

constexpr double kMostRate = 240;
/// A position belongs to a picture that was taken at most so much earlier or later: tables round their times.
constexpr double kSameMomentS = 0.002;

void check(const OverlayRequest& request) {
  if (request.frames && !request.drr.mesh) throw UsageError("--frames moves a mesh: give --mesh too");
  if (request.drr.displacement) throw UsageError("--displacement is of one picture; a series has --frames");
  if (request.seen && !request.path) throw UsageError("--seen is compared with --path: give both");
  if (request.repeat && !request.frames && !request.path)
    throw UsageError("--repeat says that --frames or --path is one breath: give one of them");
  if (request.table) refuse_to_replace(*request.table, request.force);
}

std::optional<double> rate_of(const OverlayRequest& request) {
  if (!request.rate) return std::nullopt;
  const double rate = parse_number(*request.rate, "--rate");
  if (!(rate > 0 && rate <= kMostRate))
    throw UsageError("--rate is " + *request.rate + "; it must be above 0 and at most " +
                     number_text(kMostRate));
  return rate;
}

/// Read before the CT, so that their mistakes need not wait for it.
struct Tables {
  explicit Tables(const OverlayRequest& request) {
    if (request.path) path = sim::read_timed_path(*request.path);
    if (request.measured) measured = sim::read_timed_path(*request.measured);
    if (request.seen) seen = sim::parse_positions(sim::read_document(*request.seen), *request.seen, 1, 1);
  }
  std::optional<sim::TimedPath> path, measured;
  std::vector<sim::RadiographPosition> seen;
};

/// What is told of one picture.
struct Row {
  double time_s = 0, similarity = 0;
  std::optional<double> in_space_mm, across_ray_mm, seen_mm;
};

/// The cross at a place, of a length that is seen beside a tumour.
std::vector<sim::PixelLine> cross_at(double column, double row) {
  constexpr double kArm = 6;
  return {{{column - kArm, row}, {column + kArm, row}}, {{column, row - kArm}, {column, row + kArm}}};
}

std::vector<double> values_of(const std::vector<Row>& rows, std::optional<double> Row::*value) {
  std::vector<double> values;
  for (const Row& row : rows) {
    if (row.*value) values.push_back(*(row.*value));
  }
  return values;
}

std::string table_of(const std::vector<Row>& rows, const OverlayRequest& request) {
  std::string text = "picture,time_s,gradient_correlation";
  if (request.path && request.measured) text += ",in_space_mm,across_ray_mm";
  if (request.seen) text += ",as_seen_mm";
  text += "\n";
  const auto field = [&](const std::optional<double>& value) {
    text += ",";
    if (value) text += number_text(*value, 6);
  };
  for (std::size_t i = 0; i < rows.size(); ++i) {
    text += std::to_string(i + 1);
    field(rows[i].time_s);
    field(rows[i].similarity);
    if (request.path && request.measured) {
      field(rows[i].in_space_mm);
      field(rows[i].across_ray_mm);
    }
    if (request.seen) field(rows[i].seen_mm);
    text += "\n";
  }
  return text;
}

std::string plot_of(const std::vector<Row>& rows) {
  sim::LinePlot plot{"The tumour from where it was seen", "time, s", "mm", {}};
  const auto add = [&](const char* name, std::optional<double> Row::*value) {
    sim::PlotLine line{name, {}, {}};
    for (const Row& row : rows) {
      if (!(row.*value)) continue;
      line.x.push_back(row.time_s);
      line.y.push_back(*(row.*value));
    }
    if (!line.x.empty()) plot.lines.push_back(std::move(line));
  };
  add("in space", &Row::in_space_mm);
  add("across the ray", &Row::across_ray_mm);
  add("as it was seen", &Row::seen_mm);
  return sim::plot_svg(plot);
}

/// Carries a series out, picture by picture.
class SeriesOverlay {
 public:
  SeriesOverlay(const OverlayRequest& request, StepLine& line)
      : request_(request),
        opacity_(opacity_of(request)),
        start_s_(request.start ? parse_number(*request.start, "--start") : 0),
        rate_(rate_of(request)),
        tables_(request),
        seen_used_(tables_.seen.size(), false),
        radiographs_(open_radiographs(*request.series, request.polarity, rate_)),
        scene_(request.drr, line),
        region_(outlined_region(request, scene_.deformed_mesh())),
        geometry_(scene_.machine().geometry) {
    if (request.frames) {
      frames_ = std::make_unique<MovingFrames>(
          *request.frames, request.repeat, [this](const auto& vtu) { return scene_.displacement_of(vtu); });
    }
  }

  /// The whole film.
  void run() {
    Progress progress("laying over");
    std::optional<TimedRadiograph> radiograph = radiographs_->next();
    if (!radiograph) throw Error("'" + *request_.series + "' holds no picture");
    if (request_.align) align(*radiograph);
    const std::optional<sim::ProjectionImage> still = scene_.still(geometry_);
    for (; radiograph; radiograph = next_after(radiograph->time_s)) {
      add(*radiograph, still);
      progress.update(rows_.size(), radiographs_->count().value_or(0));
    }
    progress.clear();
    write_film();
    for (std::size_t i = 0; i < tables_.seen.size(); ++i) {
      if (!seen_used_[i]) ++seen_beside_;
    }
  }

  [[nodiscard]] const std::vector<Row>& rows() const { return rows_; }
  [[nodiscard]] const DrrScene& scene() const { return scene_; }
  [[nodiscard]] const std::optional<sim::Registration>& found() const { return found_; }
  [[nodiscard]] const sim::ProjectionGeometry& geometry() const { return geometry_; }
  /// Positions that no picture was taken at.
  [[nodiscard]] std::size_t seen_beside() const { return seen_beside_; }

 private:
  void move_to(double time_s) {
    if (frames_) scene_.move_to(frames_->displacement_m(start_s_ + time_s));
  }

  void align(const TimedRadiograph& first) {
    move_to(first.time_s);
    Progress progress("aligning the first picture");
    found_ = sim::register_rigidly(
        first.image, geometry_, scene_.middle_m(),
        [&](const sim::ProjectionGeometry& seen_by) { return scene_.project(seen_by); },
        [&](std::size_t done, std::size_t all) { progress.update(done, all); });
    geometry_ = geometry_.of_moved_patient(found_->motion);
  }

  std::optional<TimedRadiograph> next_after(double time_s) {
    std::optional<TimedRadiograph> next = radiographs_->next();
    if (next && !(next->time_s > time_s))
      throw Error(next->name + " was taken at " + number_text(next->time_s) + " s, not after the one before");
    return next;
  }

  [[nodiscard]] std::optional<sim::Vector3> tumour_at(double time_s) const {
    if (!tables_.path) return std::nullopt;
    return request_.repeat ? tables_.path->place_in_breath(start_s_ + time_s)
                           : tables_.path->place_at(start_s_ + time_s);
  }

  void add(const TimedRadiograph& radiograph, const std::optional<sim::ProjectionImage>& still) {
    move_to(radiograph.time_s);
    const sim::ProjectionImage drr = sum_of(still, scene_.moving(geometry_));
    if (radiograph.image.columns != drr.columns || radiograph.image.rows != drr.rows) {
      throw Error(radiograph.name + " has " + std::to_string(radiograph.image.columns) + " x " +
                  std::to_string(radiograph.image.rows) + " pixels, the geometry " +
                  std::to_string(drr.columns) + " x " + std::to_string(drr.rows));
    }
    if (!windows_) windows_ = sim::overlay_windows(radiograph.image, drr);
    sim::ColourPicture picture =
        sim::overlay_of(radiograph.image, drr, mode_of(request_), opacity_, windows_);
    Row row{radiograph.time_s, sim::gradient_correlation(radiograph.image, drr), {}, {}, {}};
    if (region_) {
      draw_on_both(picture, sim::outline_of(scene_.deformed_mesh(), *region_, geometry_), kOutlineColour,
                   drr.columns);
    }
    if (tables_.path)
      draw_on_both(picture, sim::path_of(tables_.path->points_m, geometry_), kPathColour, drr.columns);
    mark(picture, row, drr.columns);
    rows_.push_back(row);
    pictures_.push_back(std::move(picture));
    if (pictures_.size() == kHeld) write_film_so_far();
  }

  /// Where the tumour is, and where it was seen.
  void mark(sim::ColourPicture& picture, Row& row, std::size_t columns) {
    const auto mark_at = [&](double column, double line, const sim::Colour& colour) {
      draw_on_both(picture, cross_at(column, line), colour, columns);
    };
    const auto project = [&](const sim::Vector3& place_m, const sim::Colour& colour) {
      if (const auto pixel = geometry_.project(place_m)) mark_at(pixel->column, pixel->row, colour);
    };
    const std::optional<sim::Vector3> tumour = tumour_at(row.time_s);
    if (tumour) project(*tumour, kPathColour);
    if (const auto measured = tables_.measured ? tables_.measured->place_at(row.time_s) : std::nullopt) {
      project(*measured, kMeasuredColour);
      if (tumour) {
        const PlaceError error = place_error_mm(*tumour, *measured, geometry_.source_m());
        row.in_space_mm = error.in_space_mm;
        row.across_ray_mm = error.across_ray_mm;
      }
    }
    for (std::size_t i = 0; i < tables_.seen.size(); ++i) {
      if (std::abs(tables_.seen[i].time_s - row.time_s) > kSameMomentS) continue;
      seen_used_[i] = true;
      mark_at(tables_.seen[i].column, tables_.seen[i].row, kMeasuredColour);
      if (tumour) row.seen_mm = seen_error_mm(*tumour, tables_.seen[i], geometry_);
    }
  }

  void write_film_so_far() {
    if (!film_) {
      film_ = std::make_unique<media::FilmWriter>(request_.output, film_format(), request_.force);
    }
    for (const sim::ColourPicture& picture : pictures_) {
      film_->add({static_cast<int>(picture.columns),
                  static_cast<int>(picture.rows),
                  3,
                  {picture.pixels.front().data(), 3 * picture.pixels.size()}});
    }
    pictures_.clear();
  }
  void write_film() {
    write_film_so_far();
    film_->finish();
  }
  /// In step with the radiographs, by their mean rate so far.
  [[nodiscard]] media::FilmFormat film_format() const {
    constexpr double kUsualRate = 10, kParts = 1000;
    const double time_s = rows_.back().time_s - rows_.front().time_s;
    const double rate = time_s > 0 ? static_cast<double>(rows_.size() - 1) / time_s : kUsualRate;
    return {static_cast<int>(pictures_.front().columns), static_cast<int>(pictures_.front().rows), 3,
            static_cast<int>(std::lround(kParts * std::clamp(rate, 1 / kParts, kMostRate))),
            static_cast<int>(kParts)};
  }

  /// So many pictures are held before the film's rate is told.
  static constexpr std::size_t kHeld = 16;

  const OverlayRequest& request_;
  const double opacity_, start_s_;
  const std::optional<double> rate_;
  const Tables tables_;
  std::vector<bool> seen_used_;  // of tables_.seen
  const std::unique_ptr<RadiographSeries> radiographs_;
  std::size_t seen_beside_ = 0;
  DrrScene scene_;
  const std::optional<std::int32_t> region_;
  sim::ProjectionGeometry geometry_;
  std::unique_ptr<MovingFrames> frames_;
  std::optional<sim::Registration> found_;
  std::optional<sim::OverlayWindows> windows_;
  std::vector<Row> rows_;
  std::vector<sim::ColourPicture> pictures_;  // that are not in the film yet
  std::unique_ptr<media::FilmWriter> film_;
};

nlohmann::ordered_json json_of(const sim::Spread& spread) {
  return {{"pictures", spread.count},
          {"mean", spread.mean},
          {"standard_deviation", spread.deviation},
          {"percentile_95", spread.percentile_95},
          {"greatest", spread.greatest}};
}

void tell(const char* what, const sim::Spread& spread) {
  std::cout << "  " << what << ": " << number_text(spread.mean, 3) << " +- "
            << number_text(spread.deviation, 3) << " mm, 95 % within " << number_text(spread.percentile_95, 3)
            << " mm, at most " << number_text(spread.greatest, 3) << " mm, in " << spread.count
            << " pictures\n";
}

}  // namespace

int overlay_series(const OverlayRequest& request) {
  check(request);
  auto line = std::make_optional<StepLine>();
  SeriesOverlay series(request, *line);
  line.reset();
  series.run();
  const std::vector<Row>& rows = series.rows();
  if (request.table) write_text_file(*request.table, table_of(rows, request));
  if (request.plot) write_text_file(*request.plot, plot_of(rows));
  if (request.aligned) write_text_file(*request.aligned, sim::geometry_json(series.geometry()));
  std::vector<std::string> findings = series.scene().findings();
  if (auto warning =
          patient_warning(patients_of_ct(request.drr.volume.path, request.drr.volume.options().series),
                          "the radiographs", patients_of_radiographs(*request.series)))
    findings.push_back(std::move(*warning));
  if (series.seen_beside() > 0) {
    findings.push_back(std::to_string(series.seen_beside()) + " positions of " + *request.seen +
                       " count for nothing: no picture was taken at their times");
  }
  double sum = 0;
  for (const Row& row : rows) sum += row.similarity;
  const double mean = sum / static_cast<double>(rows.size());
  const auto worst = std::ranges::min_element(rows, {}, &Row::similarity);
  struct Kind {
    const char *key, *words;
    std::vector<double> values_mm;
  };
  const std::vector<Kind> errors{
      {"in_space_mm", "from the measured places", values_of(rows, &Row::in_space_mm)},
      {"across_ray_mm", "of it across the rays", values_of(rows, &Row::across_ray_mm)},
      {"as_seen_mm", "from where it was seen, at its depth", values_of(rows, &Row::seen_mm)}};
  if (request.drr.volume.json) {
    nlohmann::ordered_json object{{"file", request.output},
                                  {"pictures", rows.size()},
                                  {"duration_s", rows.back().time_s},
                                  {"gradient_correlation", {{"mean", mean}, {"least", worst->similarity}}}};
    if (series.found()) {
      object["alignment"] = {{"gradient_correlation_before", series.found()->similarity_before},
                             {"gradient_correlation_after", series.found()->similarity_after}};
    }
    for (const Kind& error : errors) {
      if (!error.values_mm.empty()) object[error.key] = json_of(sim::spread_of(error.values_mm));
    }
    object["findings"] = findings;
    print_json(object);
    return kDone;
  }
  for (const std::string& finding : findings) print_error("kiroku", "warning: " + finding);
  std::cout << printable(request.output) << ": " << rows.size() << " pictures over "
            << number_text(rows.back().time_s, 4) << " s, gradient correlation " << number_text(mean, 4)
            << ", least " << number_text(worst->similarity, 4) << " at " << number_text(worst->time_s, 4)
            << " s\n";
  for (const Kind& error : errors) {
    if (!error.values_mm.empty()) tell(error.words, sim::spread_of(error.values_mm));
  }
  return kDone;
}

}  // namespace kiroku::apps

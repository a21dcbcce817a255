// An organ found and followed in sequences whose truth is known: rendered by the project's own renderer, each
// of its own seed, through MPEG-2 at 4 Mbit/s (the program ffmpeg). Beside it, in the same run, points of
// tissue followed by the alignment, by Lucas and Kanade's flow and, where OpenCV's contributed modules are
// installed, by CSRT.
//
//   align_bench [--first SEED] [--sequences N] [--pictures N] [--clip FILE] [--records FILE] [--show FOLDER]
//   align_bench --lenses yes [--first SEED] [--sequences N] [--pictures N]
//   align_bench --tell FILE [--tell FILE]...
//
// Sequence after sequence is of another condition; after each six with truth one has nothing to be found. The
// organ is rendered of many small cells, the plan's mesh has fewer. Ten pictures a second, 640x480. --clip: a
// film of a real operation, whose pictures give organ and wall their texture in every second round of
// conditions. Those with truth are told together, but for the lens. Drawing the plan's silhouettes, once a
// sequence, is timed by itself.
// --lenses: sequences in which nothing hides the organ, each through several lenses, which the alignment
// knows or does not.
// --records keeps a line for each picture, from which --tell makes the tables of several runs together; time
// is that of a processor, so that other work on the machine does not count.
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <functional>
#include <iostream>
#include <memory>
#include <numbers>
#include <opencv2/imgproc.hpp>
#include <opencv2/video/tracking.hpp>
#include <optional>
#include <sstream>
#include <string>
#ifdef KIROKU_HAS_CSRT
#include <opencv2/tracking.hpp>
#endif

#include "base/error.h"
#include "sim/align/lens_pictures.h"
#include "sim/align/organ_track.h"
#include "sim/align/search_verdict.h"
#include "tests/bench/endoscope_film.h"
#include "tests/bench/render_bench.h"
#include "tests/support/barrel_lens.h"
#include "tests/support/endoscope_scene.h"

namespace {

using kiroku::bench::Chance, kiroku::bench::processor_seconds, kiroku::bench::through_mpeg2,
    kiroku::bench::write_png;
using kiroku::test::BarrelLens, kiroku::test::EndoscopeScene;
using namespace kiroku::sim;  // NOLINT(google-build-using-namespace): a program of one file

constexpr double kEveryS = 0.1;

/// A hand that holds the endoscope: around the organ, nearer and farther, never quite still.
struct Hand {
  explicit Hand(Chance& chance)
      : azimuth_deg(chance.between(-22, 30)),
        elevation_deg(chance.between(-32, -5)),
        distance_m(chance.between(0.14, 0.2)),
        roll_deg(chance.between(-20, 20)),
        aside(chance.between(-0.15, 0.15), chance.between(-0.12, 0.12)) {
    for (double& each : phase) each = chance.between(0, 2 * std::numbers::pi);
    for (double& each : rate) each = chance.between(0.5, 1.3);
  }
  [[nodiscard]] Camera camera(const EndoscopeScene& scene, double s, double away = 0) const {
    const auto sway = [&](std::size_t i) { return std::sin(rate[i] * s + phase[i]); };
    return scene.camera(azimuth_deg + 8 * sway(0), elevation_deg + 5 * sway(1), distance_m + 0.012 * sway(2),
                        roll_deg + 6 * sway(3),
                        aside + Eigen::Vector2d(0.09 * sway(4) + away, 0.07 * sway(5)));
  }
  double azimuth_deg, elevation_deg, distance_m, roll_deg;
  Eigen::Vector2d aside;
  std::array<double, 6> phase{}, rate{};
};

/// A shaft whose tip goes to and fro before the organ, in the picture from the first moment on.
struct Instrument {
  Instrument(Chance& chance, double organ_m) {
    constexpr std::array<Rgb, 3> kColours{{{150, 152, 158}, {26, 26, 28}, {60, 92, 150}}};
    colour = kColours[static_cast<std::size_t>(chance.one_of(3))];
    const double side = chance.one_of(2) == 0 ? -1 : 1;
    from = Vector3(side * chance.between(0.6, 1), chance.between(-0.6, 0.3), chance.between(0.2, 0.6));
    tip_m = Vector3(side * chance.between(-0.01, 0.03), chance.between(-0.035, 0.03),
                    -chance.between(0.6, 0.8) * organ_m);
    sway_m = chance.between(0.004, 0.02);
    rate = chance.between(1, 3);
    phase = chance.between(0, 6);
  }
  [[nodiscard]] MarkedSolid at(const Camera& camera, double s) const {
    const Vector3 sway(std::sin(rate * s + phase), 0.7 * std::cos(1.3 * rate * s), 0);
    return EndoscopeScene::tool(camera, tip_m + sway_m * sway, from, colour);
  }
  Rgb colour{};
  Vector3 from, tip_m;
  double sway_m = 0, rate = 0, phase = 0;
};

/// From 0 to 1 and back.
double bump(double share, double from, double to) {
  return share <= from || share >= to
             ? 0
             : std::pow(std::sin(std::numbers::pi * (share - from) / (to - from)), 0.7);
}

constexpr std::array<const char*, 7> kWithTruth{"clear",  "tools",      "smoke", "shine",
                                                "leaves", "everything", "barrel"};
constexpr std::array<const char*, 3> kWithout{"no organ", "mirrored", "another organ"};

constexpr const char *kBarrel = "barrel", *kOfFilm = "film";

/// Seven with truth, then one without.
std::string condition_of(std::uint32_t seed) {
  constexpr std::size_t kRound = kWithTruth.size() + 1;
  const std::size_t place = (seed - 1) % kRound, round = (seed - 1) / kRound;
  return place < kWithTruth.size() ? kWithTruth[place] : kWithout[round % kWithout.size()];
}
bool has_truth(const std::string& condition) {
  return std::ranges::none_of(kWithout, [&](const char* each) { return condition.starts_with(each); });
}

/// Some pictures of a film, as large as the rendered ones.
std::vector<Picture> pictures_of(const std::string& clip) {
  std::vector<Picture> pictures;
  if (clip.empty()) return pictures;
  const std::string size =
      std::to_string(EndoscopeScene::kWidth) + ":" + std::to_string(EndoscopeScene::kHeight);
  const std::string command =
      "ffmpeg -nostdin -v error -i '" + clip + "' -vf fps=1,scale=" + size + " -f rawvideo -pix_fmt rgb24 -";
  const std::unique_ptr<std::FILE, int (*)(std::FILE*)> pipe(popen(command.c_str(), "r"), pclose);
  for (;;) {
    Picture picture(EndoscopeScene::kWidth, EndoscopeScene::kHeight);
    if (!pipe || std::fread(picture.rgb.data(), 1, picture.rgb.size(), pipe.get()) != picture.rgb.size())
      break;
    pictures.push_back(std::move(picture));
  }
  if (pictures.empty()) throw kiroku::Error("ffmpeg read no picture of " + clip);
  return pictures;
}

struct Sequence {
  std::vector<Picture> pictures;
  std::vector<Camera> truth;
};

/// Through MPEG-2 if `coded`.
Sequence rendered(EndoscopeScene& scene, std::uint32_t seed, const std::string& condition, int count,
                  bool coded = true) {
  Chance chance(seed);
  const Hand hand(chance);
  const bool everything = condition == "everything";
  std::vector<Instrument> instruments;
  if (condition == "tools" || everything) {
    const int many = 1 + chance.one_of(3);
    for (int i = 0; i < many; ++i) instruments.emplace_back(chance, hand.distance_m);
  }
  const double thick = chance.between(0.5, 1.1), shines = chance.between(1.2, 1.9),
               leaves = chance.between(1.5, 2.6);
  Sequence made;
  for (int i = 0; i < count; ++i) {
    const double s = kEveryS * i, share = double(i) / count;
    EndoscopeScene::Look look;
    look.camera = hand.camera(scene, s, condition == "leaves" ? leaves * bump(share, 0.25, 0.75) : 0);
    look.seed = 1000 * seed + static_cast<std::uint32_t>(i);
    look.organ = condition != "no organ";
    for (const Instrument& each : instruments) look.tools.push_back(each.at(look.camera, s));
    if (condition == "smoke") look.smoke = std::min(1.0, thick * bump(share, 0.2, 0.8));
    if (everything) look.smoke = 0.2 * thick * (1 + std::sin(s));
    if (condition == "shine" || everything) look.shine = shines;
    made.truth.push_back(look.camera);
    Picture picture = scene.picture(look);
    if (condition == "mirrored") picture = mirrored(picture);
    if (condition == "barrel") picture = BarrelLens{}.through(picture);
    made.pictures.push_back(std::move(picture));
  }
  if (coded) made.pictures = through_mpeg2(made.pictures);
  return made;
}

/// A place of tissue, followed by everybody from the first picture in which the organ was held.
struct TissuePoint {
  Vector3 true_m;     // of the organ that was rendered
  Vector3 aligned_m;  // where the alignment has it on the plan's organ
  cv::Point2f begun;
};

struct PointErrors {
  std::vector<double> aligned_px, flow_px, csrt_px;
  std::size_t seen = 0;  // so often a point was in sight
};

cv::Mat as_image(const Picture& picture) {
  return {picture.height, picture.width, CV_8UC3, const_cast<std::uint8_t*>(picture.rgb.data())};
}

/// Points spread over the organ's visible side, in the picture in which it was first held.
std::vector<TissuePoint> tissue_points(const OrganSurface& rendered_surface, const OrganSurface& plan,
                                       const Camera& truth, const Camera& aligned, const Pinhole& pinhole) {
  const int width = EndoscopeScene::kWidth, height = EndoscopeScene::kHeight;
  const auto seen = silhouette_of(rendered_surface, truth, pinhole, width, height, 1),
             thought = silhouette_of(plan, aligned, pinhole, width, height, 1);
  std::vector<TissuePoint> points;
  if (!seen || !thought) return points;
  const auto on_organ = [&](const Silhouette& silhouette, const Camera& camera, int x, int y) -> Vector3 {
    return camera.eye_m +
           camera.to_view.transpose() * pinhole.place_m({double(x), double(y)}, silhouette.at(x, y));
  };
  constexpr int kApart = 96;
  for (int y = kApart / 2; y < height; y += kApart) {
    for (int x = kApart / 2; x < width; x += kApart) {
      if (!(seen->at(x, y) > 0) || !(thought->at(x, y) > 0)) continue;
      points.push_back({on_organ(*seen, truth, x, y),
                        on_organ(*thought, aligned, x, y),
                        {static_cast<float>(x), static_cast<float>(y)}});
    }
  }
  return points;
}

PointErrors follow_points(const OrganSurface& rendered_surface, const OrganSurface& plan,
                          const Sequence& sequence, const std::vector<AlignedMoment>& moments) {
  PointErrors errors;
  const auto first =
      static_cast<std::size_t>(std::ranges::find_if(moments, &AlignedMoment::held) - moments.begin());
  if (first == moments.size()) return errors;
  const int width = EndoscopeScene::kWidth, height = EndoscopeScene::kHeight;
  const Pinhole pinhole = pinhole_of(EndoscopeScene::kFieldDeg, width, height);
  const auto points =
      tissue_points(rendered_surface, plan, sequence.truth[first], moments[first].camera, pinhole);
  if (points.empty()) return errors;
  std::vector<cv::Point2f> flowed;
  for (const TissuePoint& point : points) flowed.push_back(point.begun);
  std::vector<bool> flows(points.size(), true);
#ifdef KIROKU_HAS_CSRT
  constexpr int kBox = 40;
  const cv::Rect whole(0, 0, width, height);
  std::vector<cv::Ptr<cv::tracking::TrackerCSRT>> trackers;
  for (const TissuePoint& point : points) {
    trackers.push_back(cv::tracking::TrackerCSRT::create());
    const cv::Rect box(static_cast<int>(point.begun.x) - kBox / 2, static_cast<int>(point.begun.y) - kBox / 2,
                       kBox, kBox);
    trackers.back()->init(as_image(sequence.pictures[first]), box & whole);
  }
#endif
  cv::Mat before;
  cv::cvtColor(as_image(sequence.pictures[first]), before, cv::COLOR_RGB2GRAY);
  for (std::size_t i = first + 1; i < moments.size(); ++i) {
    cv::Mat grey;
    cv::cvtColor(as_image(sequence.pictures[i]), grey, cv::COLOR_RGB2GRAY);
    std::vector<cv::Point2f> next;
    std::vector<unsigned char> found;
    cv::calcOpticalFlowPyrLK(before, grey, flowed, next, found, cv::noArray(), {21, 21}, 3);
    const auto depth = silhouette_of(rendered_surface, sequence.truth[i], pinhole, width, height, 1);
    for (std::size_t k = 0; k < points.size(); ++k) {
      flows[k] = flows[k] && found[k] != 0;
#ifdef KIROKU_HAS_CSRT
      cv::Rect box;
      const bool followed = trackers[k]->update(as_image(sequence.pictures[i]), box);
#endif
      const Vector3 view = sequence.truth[i].view_m(points[k].true_m);
      if (!depth || !(view.z() < 0)) continue;
      const Eigen::Vector2d at = pinhole.pixel(view);
      const int x = static_cast<int>(std::lround(at.x())), y = static_cast<int>(std::lround(at.y()));
      constexpr double kBehindM = 0.003;
      if (x < 0 || y < 0 || x >= width || y >= height || !(depth->at(x, y) > 0) ||
          -view.z() > depth->at(x, y) + kBehindM)
        continue;
      ++errors.seen;
      if (moments[i].held())
        errors.aligned_px.push_back(
            (pinhole.pixel(moments[i].camera.view_m(points[k].aligned_m)) - at).norm());
      if (flows[k]) errors.flow_px.push_back((Eigen::Vector2d(next[k].x, next[k].y) - at).norm());
#ifdef KIROKU_HAS_CSRT
      if (followed) {
        const Eigen::Vector2d middle(box.x + (box.width - 1) / 2.0, box.y + (box.height - 1) / 2.0);
        errors.csrt_px.push_back((middle - at).norm());
      }
#endif
    }
    flowed = next;
    before = grey;
  }
  return errors;
}

/// A line of --records: what it is of, the condition, and numbers.
struct Record {
  std::string of, condition;  // of: picture, bank, searched, seen, aligned, flow, csrt; a condition's spaces
                              // are underlines
  double held = 0, error = 0, stated = 0, seconds = 0;
};

double mean_of(const std::vector<double>& values) {
  double sum = 0;
  for (const double value : values) sum += value;
  return values.empty() ? 0 : sum / double(values.size());
}

double share_of(std::vector<double> values, double share) {
  if (values.empty()) return 0;
  std::ranges::sort(values);
  return values[std::min(values.size() - 1, static_cast<std::size_t>(share * double(values.size())))];
}

/// What is entered with docs/results/record.py: "tools_mean=0.41".
class Figures {
 public:
  void add(const std::string& id, double value) {
    std::array<char, 32> text{};
    std::snprintf(text.data(), text.size(), "%.3g", value);
    line_ += " " + id + "=" + text.data();
  }
  [[nodiscard]] const std::string& line() const { return line_; }

 private:
  std::string line_;
};

void tell_pictures(const std::string& name, const std::vector<Record>& records,
                   const std::function<bool(const Record&)>& counts, Figures* figures = nullptr) {
  std::vector<double> errors_mm, stated_mm;
  double pictures = 0, beyond = 0, seconds = 0;
  for (const Record& record : records) {
    if (record.of != "picture" || !counts(record)) continue;
    pictures += 1;
    seconds += record.seconds;
    if (record.held == 0) continue;
    errors_mm.push_back(1000 * record.error);
    stated_mm.push_back(1000 * record.stated);
    if (record.error > 3 * record.stated) beyond += 1;
  }
  if (pictures == 0) return;
  const double held = double(errors_mm.size()), lost_percent = 100 * (1 - held / pictures),
               beyond_percent = held > 0 ? 100 * beyond / held : 0;
  std::printf(
      "%-14s %5.0f pictures  lost %5.1f %%  error %5.2f mm mean %5.2f 95 %% %5.2f most  stated %5.2f  ",
      name.c_str(), pictures, lost_percent, mean_of(errors_mm), share_of(errors_mm, 0.95),
      share_of(errors_mm, 1), mean_of(stated_mm));
  std::printf("beyond 3 stated %5.2f %%  %5.1f pictures a second of a processor\n", beyond_percent,
              pictures / seconds);
  if (figures == nullptr) return;
  std::string id = name;
  std::ranges::replace(id, ' ', '_');
  figures->add(id + "_pictures", pictures);
  figures->add(id + "_lost", lost_percent);
  figures->add(id + "_speed", pictures / seconds);
  // Where nothing was held there is no error.
  if (held == 0) return;
  figures->add(id + "_mean", mean_of(errors_mm));
  figures->add(id + "_95", share_of(errors_mm, 0.95));
  figures->add(id + "_most", share_of(errors_mm, 1));
  figures->add(id + "_stated", mean_of(stated_mm));
  figures->add(id + "_beyond", beyond_percent);
}

void tell(const std::vector<Record>& records) {
  Figures figures, nothing, points;
  for (const char* const condition : kWithTruth)
    tell_pictures(
        condition, records, [&](const Record& record) { return record.condition == condition; }, &figures);
  tell_pictures(
      kOfFilm, records, [](const Record& record) { return record.condition == kOfFilm; }, &figures);
  // A lens that draws the corners in is one that the alignment does not know.
  tell_pictures(
      "all", records,
      [](const Record& record) {
        return has_truth(record.condition) && !record.condition.starts_with(kBarrel);
      },
      &figures);
  const std::string barrel_of_film = std::string(kBarrel) + " " + kOfFilm;
  tell_pictures(
      barrel_of_film, records, [&](const Record& record) { return record.condition == barrel_of_film; },
      &figures);
  std::vector<std::string> without;
  for (const char* const condition : kWithout) {
    without.emplace_back(condition);
    without.push_back(without.back() + " " + kOfFilm);
  }
  for (const std::string& condition : without) {
    double pictures = 0, placed = 0, seconds = 0, sequences = 0, searches = 0;
    for (const Record& record : records) {
      if (record.condition != condition) continue;
      if (record.of == "searched") {
        sequences += 1;
        searches += record.held;
      }
      if (record.of != "picture") continue;
      pictures += 1;
      placed += record.held;
      seconds += record.seconds;
    }
    if (pictures == 0) continue;
    std::printf("%-18s %3.0f sequences, %5.0f pictures, %.0f searches, %.0f placed all the same  ",
                condition.c_str(), sequences, pictures, searches, placed);
    std::printf("%5.1f pictures a second of a processor\n", pictures / seconds);
    std::string id = condition;
    std::ranges::replace(id, ' ', '_');
    nothing.add(id + "_sequences", sequences);
    nothing.add(id + "_pictures", pictures);
    nothing.add(id + "_searches", searches);
    nothing.add(id + "_placed", placed);
    nothing.add(id + "_speed", pictures / seconds);
  }
  double banks = 0, bank_seconds = 0, counted = 0, with_points = 0;
  for (const Record& record : records) {
    if (record.of == "bank") {
      banks += 1;
      bank_seconds += record.seconds;
    }
    if (record.of == "seen") {
      with_points += 1;
      counted += record.held > 0 ? 1 : 0;
    }
  }
  if (banks > 0)
    std::printf("silhouettes of a plan drawn in %.2f s of a processor, mean of %.0f\n", bank_seconds / banks,
                banks);
  // Where the organ was never held, there is no picture from which to follow points.
  std::printf("points of %.0f of %.0f sequences, in the others the organ was never held\n", counted,
              with_points);
  for (const char* const by : {"aligned", "flow", "csrt"}) {
    std::vector<double> px;
    double seen = 0;
    for (const Record& record : records) {
      if (record.of == by) px.push_back(record.error);
      if (record.of == "seen") seen += record.held;
    }
    if (px.empty()) continue;
    std::printf("points by %-8s %6zu of %6.0f places followed  error %6.2f px mean %6.2f px 95 %%\n", by,
                px.size(), seen, mean_of(px), share_of(px, 0.95));
    points.add(std::string(by) + "_followed", 100 * double(px.size()) / seen);
    points.add(std::string(by) + "_mean", mean_of(px));
    points.add(std::string(by) + "_95", share_of(px, 0.95));
  }
  std::printf("docs/results/record.py align --machine NAME%s\n", figures.line().c_str());
  std::printf("docs/results/record.py align-nothing --machine NAME%s\n", nothing.line().c_str());
  std::printf("docs/results/record.py align-points --machine NAME%s\n", points.line().c_str());
}

using Settings = kiroku::bench::SequenceSettings;

void run(const Settings& settings) {
  const TetMesh fine = kiroku::test::liver_like_mesh({44, 12, 30}),
                plan = kiroku::test::liver_like_mesh({20, 6, 14}),
                other = kiroku::test::kidney_like_mesh({8, 8, 14});
  const OrganSurface surface = organ_surface(plan), rendered_surface = organ_surface(fine);
  const std::vector<Picture> clip = pictures_of(settings.clip);
  std::vector<Record> records;
  std::ofstream file;
  if (!settings.records.empty()) file.open(settings.records, std::ios::app);
  const auto keep = [&](const Record& record) {
    records.push_back(record);
    std::string condition = record.condition;
    std::ranges::replace(condition, ' ', '_');
    if (file.is_open())
      file << record.of << ' ' << condition << ' ' << record.held << ' ' << record.error << ' '
           << record.stated << ' ' << record.seconds << '\n';
  };
  for (int n = 0; n < settings.sequences; ++n) {
    const std::uint32_t seed = settings.first + static_cast<std::uint32_t>(n);
    const std::string condition = condition_of(seed);
    // Each round of conditions has a texture of its own.
    const std::size_t round = (seed - 1) / (kWithTruth.size() + 1);
    std::optional<Picture> texture;
    if (!clip.empty() && round % 2 == 1) texture = clip[round / 2 % clip.size()];
    EndoscopeScene scene(fine, texture);
    std::string told_as = condition;
    if (texture) told_as = has_truth(condition) && condition != kBarrel ? kOfFilm : condition + " " + kOfFilm;
    const Sequence sequence = rendered(scene, seed, condition, settings.pictures);
    const double before = processor_seconds();
    OrganTrack track(condition == "another organ" ? other : plan, EndoscopeScene::kFieldDeg);
    keep({"bank", told_as, 1, 0, 0, processor_seconds() - before});
    std::vector<AlignedMoment> moments;
    std::vector<Record> of_this;
    for (std::size_t i = 0; i < sequence.pictures.size(); ++i) {
      const double begin = processor_seconds();
      moments.push_back(track.take(static_cast<std::int64_t>(1e9 * kEveryS) * static_cast<std::int64_t>(i),
                                   sequence.pictures[i]));
      const AlignedMoment& moment = moments.back();
      Record record{"picture",
                    told_as,
                    moment.held() ? 1.0 : 0.0,
                    0,
                    moment.standard_error_m,
                    processor_seconds() - begin};
      // Where there is no truth, each place is wrong by more than any stated error.
      if (moment.held())
        record.error = has_truth(condition) ? way_between_m(surface, moment.camera, sequence.truth[i]) : 1;
      if (!settings.show.empty()) {
        std::printf("%3zu %-16s error %6.2f stated %5.2f misfit %5.2f supported %4.2f rival %5.2f %5.0f ms\n",
                    i, name_of(moment.why), 1000 * record.error, 1000 * record.stated, moment.misfit_px,
                    moment.supported, moment.rival_px, 1000 * record.seconds);
        if (settings.show != "-" && i % 10 == 0)
          write_png(settings.show + "/" + std::to_string(seed) + "-" + std::to_string(i) + ".png",
                    sequence.pictures[i]);
      }
      keep(record);
      of_this.push_back(record);
    }
    if (!has_truth(condition)) {
      // Unless it is placed, nothing is followed in these: each picture that was looked at was searched.
      const auto looked = std::ranges::count_if(
          moments, [](const AlignedMoment& moment) { return moment.why != WhyLost::kNotLooked; });
      keep({"searched", told_as, double(looked)});
    }
    if (has_truth(condition) && condition != kBarrel) {
      const PointErrors errors = follow_points(rendered_surface, surface, sequence, moments);
      keep({"seen", told_as, double(errors.seen)});
      for (const double px : errors.aligned_px) keep({"aligned", told_as, 1, px});
      for (const double px : errors.flow_px) keep({"flow", told_as, 1, px});
      for (const double px : errors.csrt_px) keep({"csrt", told_as, 1, px});
    }
    file.flush();
    tell_pictures(std::to_string(seed) + " " + condition, of_this, [](const Record&) { return true; });
    std::fflush(stdout);
  }
  tell(records);
}

/// A lens before the same sequences, and whether the alignment knows it.
struct LensCase {
  const char* name;
  std::optional<BarrelLens> lens;
  bool told;
};

void run_lenses(const Settings& settings) {
  const TetMesh plan = kiroku::test::liver_like_mesh({20, 6, 14});
  const OrganSurface surface = organ_surface(plan);
  const BarrelLens five, fifteen = BarrelLens::of_corners(0.15);
  const std::array<LensCase, 5> cases{{{"no lens", {}, false},
                                       {"five unknown", five, false},
                                       {"five told", five, true},
                                       {"fifteen unknown", fifteen, false},
                                       {"fifteen told", fifteen, true}}};
  EndoscopeScene scene(kiroku::test::liver_like_mesh({44, 12, 30}));
  std::vector<Record> records;
  double straightened = 0, straight_seconds = 0;
  for (int n = 0; n < settings.sequences; ++n) {
    const std::uint32_t seed = settings.first + static_cast<std::uint32_t>(n);
    const Sequence sequence = rendered(scene, seed, "clear", settings.pictures, false);
    for (const LensCase& each : cases) {
      std::vector<Picture> pictures = sequence.pictures;
      if (each.lens) {
        for (Picture& picture : pictures) picture = each.lens->through(picture);
      }
      pictures = through_mpeg2(pictures);
      // Whoever does not know the lens says what the picture covers.
      double field_deg =
          each.lens ? each.lens->field_deg(EndoscopeScene::kFieldDeg) : EndoscopeScene::kFieldDeg;
      std::optional<StraightPictures> straight;
      if (each.told) {
        const Lens lens(each.lens->calibration(EndoscopeScene::kFieldDeg));
        field_deg = lens.field_deg();
        straight.emplace(lens);
      }
      OrganTrack track(plan, field_deg);
      for (std::size_t i = 0; i < pictures.size(); ++i) {
        const double begin = processor_seconds();
        if (straight) pictures[i] = straight->straight(pictures[i]);
        const double between = processor_seconds();
        const AlignedMoment moment =
            track.take(static_cast<std::int64_t>(1e9 * kEveryS) * static_cast<std::int64_t>(i), pictures[i]);
        records.push_back({"picture", each.name, moment.held() ? 1.0 : 0.0,
                           moment.held() ? way_between_m(surface, moment.camera, sequence.truth[i]) : 0,
                           moment.standard_error_m, processor_seconds() - begin});
        // The first picture's has the map's making.
        if (!straight || i == 0) continue;
        straightened += 1;
        straight_seconds += between - begin;
      }
    }
    std::printf("%u\n", seed);
    std::fflush(stdout);
  }
  Figures figures, cost;
  for (const LensCase& each : cases)
    tell_pictures(
        each.name, records, [&](const Record& record) { return record.condition == each.name; }, &figures);
  const double straight_ms = 1000 * straight_seconds / straightened;
  std::printf("a picture straightened in %.2f ms of a processor\n", straight_ms);
  cost.add("straighten", straight_ms);
  std::printf("docs/results/record.py align-lens --machine NAME%s\n", figures.line().c_str());
  std::printf("docs/results/record.py align-lens-cost --machine NAME%s\n", cost.line().c_str());
}

std::vector<Record> records_of(const std::vector<std::string>& files) {
  std::vector<Record> records;
  for (const std::string& name : files) {
    std::ifstream file(name);
    if (!file) throw kiroku::Error("cannot read " + name);
    Record record;
    while (file >> record.of >> record.condition >> record.held >> record.error >> record.stated >>
           record.seconds) {
      std::ranges::replace(record.condition, '_', ' ');
      records.push_back(record);
    }
  }
  return records;
}

}  // namespace

int main(int argc, char** argv) {
  try {
    Settings settings;
    settings.read(argc, argv);
    if (!settings.told.empty())
      tell(records_of(settings.told));
    else if (settings.lenses)
      run_lenses(settings);
    else
      run(settings);
  } catch (const std::exception& error) {
    std::cerr << error.what() << '\n';
    return 2;
  }
  return 0;
}

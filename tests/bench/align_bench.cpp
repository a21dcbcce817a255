// An organ found and followed in pictures whose truth is known: rendered by the project's own renderer,
// through MPEG-2 at 4 Mbit/s (the program ffmpeg), beside points picked without any error and followed by
// optical flow.
//
//   align_bench [--pictures N] [--only NAME] [--show FOLDER]
//
// The organ is rendered of many small cells, the plan's mesh has fewer. Ten pictures a second, 640x480.
#include <array>
#include <cstdio>
#include <filesystem>
#include <functional>
#include <iostream>
#include <memory>
#include <string>

#include "base/error.h"
#include "media/film_writer.h"
#include "sim/align/organ_track.h"
#include "tests/bench/render_bench.h"
#include "tests/support/endoscope_scene.h"
#include "tests/support/temporary_folder.h"
#include "viewer/compare/camera_track.h"

namespace {

using kiroku::bench::processor_seconds, kiroku::bench::seconds, kiroku::bench::write_png;
using kiroku::test::EndoscopeScene;
using namespace kiroku::sim;  // NOLINT(google-build-using-namespace): a program of one file

struct Scenario {
  std::string name;
  std::function<EndoscopeScene::Look(const EndoscopeScene&, double share)> look;
  bool mirrored = false, other_organ = false;
  [[nodiscard]] bool has_truth() const { return !mirrored && !other_organ && name != "no-organ"; }
};

/// A hand that holds the endoscope: around the organ, nearer and farther, never quite still.
EndoscopeScene::Look hand(const EndoscopeScene& scene, double share, const Eigen::Vector2d& aside = {0, 0}) {
  const double turn = 2 * std::numbers::pi * share;
  EndoscopeScene::Look look;
  look.camera =
      scene.camera(12 + 14 * std::sin(turn), -18 + 7 * std::sin(1.6 * turn),
                   0.16 + 0.02 * std::sin(1.3 * turn + 1), 8 * std::sin(0.8 * turn),
                   aside + Eigen::Vector2d(0.1 * std::sin(2.1 * turn), 0.08 * std::cos(1.7 * turn)));
  look.seed = static_cast<std::uint32_t>(1 + 1000 * share);
  return look;
}

/// From 0 to 1 and back around the middle of the film.
double bump(double share, double from, double to) {
  return share <= from || share >= to
             ? 0
             : std::pow(std::sin(std::numbers::pi * (share - from) / (to - from)), 0.7);
}

std::vector<Scenario> scenarios() {
  const auto plain = [](const EndoscopeScene& scene, double share) { return hand(scene, share); };
  return {
      {"clear", plain},
      {"tools",
       [](const EndoscopeScene& scene, double share) {
         EndoscopeScene::Look look = hand(scene, share);
         const double swing = std::sin(7 * share);
         look.tools.push_back(EndoscopeScene::tool(look.camera, {-0.02 + 0.03 * swing, 0.01, -0.11}));
         look.tools.push_back(
             EndoscopeScene::tool(look.camera, {0.01 - 0.03 * swing, -0.03 + 0.02 * swing, -0.12}));
         return look;
       }},
      {"smoke",
       [](const EndoscopeScene& scene, double share) {
         EndoscopeScene::Look look = hand(scene, share);
         look.smoke = std::min(1.0, 1.15 * bump(share, 0.3, 0.75));
         return look;
       }},
      {"leaves",
       [](const EndoscopeScene& scene, double share) {
         return hand(scene, share, {2.6 * bump(share, 0.35, 0.75), 0});
       }},
      {"no-organ",
       [](const EndoscopeScene& scene, double share) {
         EndoscopeScene::Look look = hand(scene, share);
         look.organ = false;
         look.tools.push_back(EndoscopeScene::tool(look.camera, {-0.02, 0.01, -0.11}));
         return look;
       }},
      {"mirrored", plain, true, false},
      {"other-organ", plain, false, true},
  };
}

Picture mirror_of(const Picture& picture) {
  Picture made(picture.width, picture.height);
  for (int y = 0; y < picture.height; ++y) {
    for (int x = 0; x < picture.width; ++x)
      std::copy_n(picture.pixel(picture.width - 1 - x, y), 3, made.pixel(x, y));
  }
  return made;
}

/// The pictures after MPEG-2 at 4 Mbit/s.
std::vector<Picture> through_mpeg2(const std::vector<Picture>& pictures) {
  const kiroku::test::TemporaryFolder folder;
  const std::filesystem::path lossless = folder / "lossless.mkv", coded = folder / "coded.mpg";
  kiroku::media::FilmWriter writer(lossless, {pictures[0].width, pictures[0].height, 3, 25, 1});
  for (const Picture& picture : pictures) writer.add({picture.width, picture.height, 3, picture.rgb});
  writer.finish();
  const std::string quiet = "ffmpeg -nostdin -v error -y -i ";
  const std::string encode = quiet + lossless.string() +
                             " -c:v mpeg2video -pix_fmt yuv420p -b:v 4M -maxrate 4M -bufsize 2M -g 12 " +
                             coded.string();
  if (std::system(encode.c_str()) != 0) throw kiroku::Error("ffmpeg did not encode: is it installed?");
  const std::string decode = quiet + coded.string() + " -f rawvideo -pix_fmt rgb24 -";
  const std::unique_ptr<std::FILE, int (*)(std::FILE*)> pipe(popen(decode.c_str(), "r"), pclose);
  std::vector<Picture> decoded;
  while (pipe && decoded.size() < pictures.size()) {
    Picture picture(pictures[0].width, pictures[0].height);
    if (std::fread(picture.rgb.data(), 1, picture.rgb.size(), pipe.get()) != picture.rgb.size()) break;
    decoded.push_back(std::move(picture));
  }
  if (decoded.size() != pictures.size()) throw kiroku::Error("ffmpeg gave other pictures back than it got");
  return decoded;
}

struct Outcome {
  std::size_t pictures = 0, held = 0, confident = 0;  // beyond three standard errors
  std::vector<double> errors_mm, stated_mm;
  double seconds = 0, processor_seconds = 0;

  void take(double error_m, double stated_m) {
    ++held;
    errors_mm.push_back(1000 * error_m);
    stated_mm.push_back(1000 * stated_m);
    if (error_m > 3 * stated_m) ++confident;
  }
  void add(const Outcome& other) {
    pictures += other.pictures;
    held += other.held;
    confident += other.confident;
    errors_mm.insert(errors_mm.end(), other.errors_mm.begin(), other.errors_mm.end());
    stated_mm.insert(stated_mm.end(), other.stated_mm.begin(), other.stated_mm.end());
    seconds += other.seconds;
    processor_seconds += other.processor_seconds;
  }
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

void print(const std::string& name, const Outcome& outcome) {
  const double held = double(std::max<std::size_t>(1, outcome.held));
  std::printf(
      "%-22s %4zu pictures  lost %5.1f %%  error %6.2f mm mean %6.2f mm 95 %%  stated %5.2f mm  beyond 3 "
      "errors %5.1f %%"
      "  %5.1f pictures/s, %5.1f a second of a processor\n",
      name.c_str(), outcome.pictures,
      100 * (1 - double(outcome.held) / double(std::max<std::size_t>(1, outcome.pictures))),
      mean_of(outcome.errors_mm), share_of(outcome.errors_mm, 0.95), mean_of(outcome.stated_mm),
      100 * double(outcome.confident) / held,
      outcome.seconds > 0 ? double(outcome.pictures) / outcome.seconds : 0,
      outcome.processor_seconds > 0 ? double(outcome.pictures) / outcome.processor_seconds : 0);
  std::fflush(stdout);
}

/// What was known so far: points picked on organ and picture, here without any error, followed by flow.
Outcome by_picked_points(const OrganSurface& surface, const std::vector<Picture>& pictures,
                         const std::vector<Camera>& truth) {
  Outcome outcome;
  outcome.pictures = pictures.size();
  const Pinhole pinhole =
      pinhole_of(EndoscopeScene::kFieldDeg, EndoscopeScene::kWidth, EndoscopeScene::kHeight);
  const auto silhouette =
      silhouette_of(surface, truth[0], pinhole, EndoscopeScene::kWidth, EndoscopeScene::kHeight, 1);
  kiroku::compare::PickedRegistration picked;
  picked.field_deg = EndoscopeScene::kFieldDeg;
  for (int y = 20; y < EndoscopeScene::kHeight - 20; y += 40) {
    for (int x = 20; x < EndoscopeScene::kWidth - 20; x += 40) {
      if (!(silhouette->at(x, y) > 0)) continue;
      const Vector3 view = pinhole.place_m({double(x), double(y)}, silhouette->at(x, y));
      picked.points.push_back({truth[0].eye_m + truth[0].to_view.transpose() * view, {double(x), double(y)}});
    }
  }
  kiroku::compare::CameraTrack track(picked, EndoscopeScene::kWidth, EndoscopeScene::kHeight);
  const double begin = seconds(), processor_begin = processor_seconds();
  for (std::size_t i = 0; i < pictures.size(); ++i)
    track.take(static_cast<std::int64_t>(i), {pictures[i].width, pictures[i].height, 3, pictures[i].rgb});
  track.finish();
  outcome.seconds = seconds() - begin;
  outcome.processor_seconds = processor_seconds() - processor_begin;
  for (std::size_t i = 0; i < pictures.size(); ++i) {
    const auto at = static_cast<std::int64_t>(i);
    if (track.held_at(at)) outcome.take(way_between_m(surface, track.camera_at(at), truth[i]), 1);
  }
  outcome.stated_mm.clear();
  return outcome;
}

void run(int count, const std::string& only, const std::string& show) {
  EndoscopeScene scene(kiroku::test::liver_like_mesh({44, 12, 30}));
  const TetMesh plan = kiroku::test::liver_like_mesh({20, 6, 14}),
                other = kiroku::test::kidney_like_mesh({8, 8, 14});
  const OrganSurface surface = organ_surface(plan);
  Outcome all, all_points, wrong;
  for (const Scenario& scenario : scenarios()) {
    if (!only.empty() && only != scenario.name) continue;
    std::vector<Picture> pictures;
    std::vector<Camera> truth;
    for (int i = 0; i < count; ++i) {
      const EndoscopeScene::Look look = scenario.look(scene, double(i) / count);
      truth.push_back(look.camera);
      pictures.push_back(scene.picture(look));
      if (scenario.mirrored) pictures.back() = mirror_of(pictures.back());
    }
    pictures = through_mpeg2(pictures);
    OrganTrack track(scenario.other_organ ? other : plan, EndoscopeScene::kFieldDeg);
    Outcome outcome;
    outcome.pictures = pictures.size();
    const double begin = seconds(), processor_begin = processor_seconds();
    std::vector<AlignedMoment> moments;
    for (std::size_t i = 0; i < pictures.size(); ++i)
      moments.push_back(track.take(static_cast<std::int64_t>(i) * 100'000'000, pictures[i]));
    outcome.seconds = seconds() - begin;
    outcome.processor_seconds = processor_seconds() - processor_begin;
    for (std::size_t i = 0; i < pictures.size(); ++i) {
      const double error_m =
          moments[i].held() && scenario.has_truth() ? way_between_m(surface, moments[i].camera, truth[i]) : 0;
      if (moments[i].held()) outcome.take(scenario.has_truth() ? error_m : 1, moments[i].standard_error_m);
      if (show.empty()) continue;
      std::printf("%3zu %-16s error %6.2f stated %5.2f misfit %5.2f supported %4.2f rival %5.2f\n", i,
                  name_of(moments[i].why), 1000 * error_m, 1000 * moments[i].standard_error_m,
                  moments[i].misfit_px, moments[i].supported, moments[i].rival_px);
      if (show != "-" && i % 10 == 0)
        write_png(show + "/" + scenario.name + std::to_string(i) + ".png", pictures[i]);
    }
    print(scenario.name, outcome);
    if (scenario.has_truth()) {
      all.add(outcome);
      const Outcome points = by_picked_points(surface, pictures, truth);
      print("  picked points, LK", points);
      all_points.add(points);
    } else {
      wrong.add(outcome);
    }
  }
  print("all with truth", all);
  print("  picked points, LK", all_points);
  std::printf("of points, no error is stated, so none can be beyond it\n");
  std::printf("nothing to be found    %4zu pictures, %zu of them placed all the same\n", wrong.pictures,
              wrong.held);
}

}  // namespace

int main(int argc, char** argv) {
  try {
    int count = 40;
    std::string only, show;
    for (int i = 1; i + 1 < argc; i += 2) {
      const std::string name = argv[i];
      if (name == "--pictures") count = std::stoi(argv[i + 1]);
      if (name == "--only") only = argv[i + 1];
      if (name == "--show") show = argv[i + 1];
    }
    run(count, only, show);
  } catch (const std::exception& error) {
    std::cerr << error.what() << '\n';
    return 2;
  }
  return 0;
}

// An organ that is pulled while an endoscope looks, deformed to fit its pictures, where the truth is known:
// rendered by the project's own renderer from a corotational body of smaller cells, with a lobe stiffer or
// softer than the plan has it, and held over another area; each sequence of its own seed, through MPEG-2 at 4
// Mbit/s (the program ffmpeg).
//
//   deform_bench [--first SEED] [--sequences N] [--pictures N] [--records FILE] [--show FOLDER]
//   deform_bench --tell FILE [--tell FILE]...
//
// Sequence after sequence is of another condition. In the first picture the organ is at rest, and its place
// is found by its outline from a place some millimetres off; from then on a force at one spot of it grows
// until a node of it has gone about 30 mm. Ten pictures a second, 640x480. --records keeps a line for each
// picture, from which --tell makes the tables of several runs together; time is that of a processor. Beside
// the fit by itself the pictures go through what `kiroku compare --align auto --organ deformed` does with
// them.
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <fstream>
#include <functional>
#include <iostream>
#include <numbers>
#include <string>
#include <vector>

#include <Eigen/Cholesky>

#include "base/error.h"
#include "sim/align/deformed_fit.h"
#include "sim/align/deformed_track.h"
#include "sim/align/organ_track.h"
#include "sim/align/surface_points.h"
#include "tests/bench/endoscope_film.h"
#include "tests/bench/render_bench.h"
#include "tests/support/barrel_lens.h"
#include "tests/support/pulled_organ.h"

namespace {

using kiroku::bench::Chance, kiroku::bench::processor_seconds, kiroku::bench::through_mpeg2,
    kiroku::bench::write_png;
using kiroku::test::EndoscopeScene, kiroku::test::OrganNature, kiroku::test::PulledOrgan;
using namespace kiroku::sim;  // NOLINT(google-build-using-namespace): a program of one file

constexpr std::array<const char*, 8> kWithTruth{"aside", "towards", "pushed", "camera",
                                                "tools", "outline", "barrel", "rest"};
constexpr std::array<const char*, 2> kWithout{"no organ", "another organ"};
constexpr double kFarthestM = 0.03;

std::string condition_of(std::uint32_t seed) {
  constexpr std::size_t kRound = kWithTruth.size() + 1;
  const std::size_t place = (seed - 1) % kRound, round = (seed - 1) / kRound;
  return place < kWithTruth.size() ? kWithTruth[place] : kWithout[round % kWithout.size()];
}
bool has_truth(const std::string& condition) {
  return std::ranges::none_of(kWithout, [&](const char* each) { return condition == each; });
}

struct Sequence {
  std::vector<Picture> pictures;
  std::vector<Camera> cameras;
  std::vector<std::vector<Vector3>> displacement_m;  // of the plan's surface nodes
};

Vector3 any_direction(Chance& chance) {
  Vector3 made;
  do {
    made = {chance.between(-1, 1), chance.between(-1, 1), chance.between(-1, 1)};
  } while (made.norm() > 1 || made.norm() < 0.1);
  return made.normalized();
}

/// From rest to about kFarthestM, of a spot that is not held, on the side that is seen.
std::vector<Eigen::VectorXd> pulled_displacements(const PulledOrgan& organ, const kiroku::test::Held& held,
                                                  const Vector3& eye_m, const std::string& condition,
                                                  int count, Chance& chance) {
  const OrganSurface& surface = organ.surface();
  constexpr int kMostSpots = 100;
  for (int i = 0; i < kMostSpots; ++i) {
    const auto& face =
        surface.faces[static_cast<std::size_t>(chance.one_of(static_cast<int>(surface.faces.size())))];
    const Vector3 &a = surface.nodes[face[0]], &b = surface.nodes[face[1]], &c = surface.nodes[face[2]];
    const Vector3 spot = (a + b + c) / 3, outward = (b - a).cross(c - a).normalized();
    constexpr double kFreeM = 0.06;
    if ((spot - held.middle_m).norm() < kFreeM || outward.dot(eye_m - spot) < 0) continue;
    const Vector3 to_eye = (eye_m - spot).normalized();
    Vector3 direction = any_direction(chance);
    if (condition == "towards")
      direction = to_eye + 0.4 * direction;
    else if (condition == "pushed")
      direction = -outward + 0.4 * direction;
    else
      direction = direction - direction.dot(to_eye) * to_eye + 0.3 * outward;
    try {
      const Eigen::VectorXd force = organ.force_n(spot, direction, kFarthestM);
      std::vector<Eigen::VectorXd> all{Eigen::VectorXd::Zero(force.size())};
      for (int k = 1; k < count; ++k)
        all.push_back(organ.displacement_m(double(k) / std::max(1, count - 1) * force));
      return all;
    } catch (const kiroku::Error&) {
      // It would buckle there before it has gone so far: another spot.
    }
  }
  throw kiroku::Error("no spot of the organ can be pulled so far");
}

Sequence rendered(std::uint32_t seed, const std::string& condition, int count, const OrganSurface& plan) {
  Chance chance(seed);
  OrganNature nature;
  nature.held.middle_m += chance.between(0, 0.006) * any_direction(chance);
  nature.held.radius_m = chance.between(0.029, 0.041);
  nature.stiffer = std::pow(2.0, chance.between(-1, 1));
  nature.lobe_m = chance.between(-0.01, 0.04);
  const PulledOrgan organ({30, 8, 20}, nature);
  EndoscopeScene scene(organ.mesh());
  const double azimuth_deg = chance.between(-22, 30), elevation_deg = chance.between(-32, -5),
               distance_m = chance.between(0.15, 0.2), roll_deg = chance.between(-20, 20);
  const Eigen::Vector2d aside(chance.between(-0.1, 0.1), chance.between(-0.1, 0.1));
  std::array<double, 4> phase{};
  for (double& each : phase) each = chance.between(0, 2 * std::numbers::pi);
  const Camera first = scene.camera(azimuth_deg, elevation_deg, distance_m, roll_deg, aside);
  const bool pulled = condition != "rest" && has_truth(condition);
  std::vector<Eigen::VectorXd> displacements(
      static_cast<std::size_t>(count), Eigen::VectorXd::Zero(3 * Eigen::Index(organ.mesh().nodes.size())));
  if (pulled) displacements = pulled_displacements(organ, nature.held, first.eye_m, condition, count, chance);
  Sequence made;
  for (int i = 0; i < count; ++i) {
    EndoscopeScene::Look look;
    const auto sway = [&](std::size_t k) {
      return condition == "camera" ? std::sin(0.25 * i + phase[k]) - std::sin(phase[k]) : 0;
    };
    look.camera = scene.camera(azimuth_deg + 5 * sway(0), elevation_deg + 3 * sway(1),
                               distance_m + 0.008 * sway(2), roll_deg + 4 * sway(3), aside);
    look.seed = 1000 * seed + static_cast<std::uint32_t>(i);
    look.organ = condition != "no organ";
    if (condition == "tools") {
      const double swing = 0.01 * std::sin(0.5 * i + phase[0]);
      look.tools = {EndoscopeScene::tool(look.camera, {-0.015 + swing, 0.01, -0.7 * distance_m}),
                    EndoscopeScene::tool(look.camera, {0.02, -0.02 + swing, -0.7 * distance_m},
                                         {-0.9, -0.4, 0.4}, {26, 26, 28})};
    }
    const Eigen::VectorXd& displacement = displacements[static_cast<std::size_t>(i)];
    look.displacement_m.assign(displacement.data(), displacement.data() + displacement.size());
    made.cameras.push_back(look.camera);
    made.displacement_m.push_back(organ.at_nodes_of(plan, displacement));
    Picture picture = scene.picture(look);
    if (condition == "barrel") picture = kiroku::test::BarrelLens{}.through(picture);
    made.pictures.push_back(std::move(picture));
  }
  made.pictures = through_mpeg2(made.pictures);
  return made;
}

/// A line of --records, of a picture after the first.
struct Record {
  std::string condition, why;
  double fitted = 0;
  double farthest_mm = 0, mean_mm = 0;  // how far the organ's nodes had gone: the largest, the mean
  // Errors of the displacements of the nodes that are seen, of all, and of those whose displacement is told.
  double seen_error_mm = 0, error_mm = 0, told_error_mm = 0;
  double error_95_mm = 0;  // 95 % of all nodes are below
  double told = 0;         // share of all nodes
  double stated_mm = 0;    // root of the mean squared standard error of all nodes
  double told_stated_mm = 0;
  double beyond = 0, told_beyond = 0;  // shares of the nodes, and of the told ones, off by over three stated
  double beyond_direction = 0;         // share off by over three standard deviations of its own direction
  double seconds = 0;
  // Beside it what `kiroku compare --align auto --organ deformed` makes of the same pictures.
  std::string command;           // why it lays the rigid organ, or "deformed"
  double held = 0, placed = 0;   // whether the rigid organ is held; whether any is laid
  double rigid_off_mm = 0;       // where the rigid organ is laid before the camera, mean over all nodes
  double off_mm = 0;             // the same of what is laid
  double command_error_mm = 0;   // of its displacements
  double apart_mm = 0;           // from those of the fit above, mean over all nodes
  double command_stated_mm = 0;  // root of the mean squared standard error of the told nodes
  double command_beyond = 0;     // share of the told nodes off by over three stated
  double rigid_seconds = 0, command_seconds = 0;  // of the rigid fit, and what the deformed one takes more
};

template <typename Record, typename Visit>
void visit(Record& record, const Visit& each) {
  each(record.fitted), each(record.farthest_mm), each(record.mean_mm), each(record.seen_error_mm),
      each(record.error_mm), each(record.told_error_mm), each(record.error_95_mm), each(record.told),
      each(record.stated_mm), each(record.told_stated_mm), each(record.beyond), each(record.told_beyond),
      each(record.beyond_direction), each(record.seconds), each(record.held), each(record.placed),
      each(record.rigid_off_mm), each(record.off_mm), each(record.command_error_mm), each(record.apart_mm),
      each(record.command_stated_mm), each(record.command_beyond), each(record.rigid_seconds),
      each(record.command_seconds);
}

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

void judge(const DeformedFit& fit, const std::vector<Vector3>& truth_m, Record& record) {
  std::vector<double> all, seen, told, gone;
  double square = 0, told_square = 0, beyond = 0, told_beyond = 0, beyond_direction = 0;
  for (std::size_t i = 0; i < truth_m.size(); ++i) {
    gone.push_back(1000 * truth_m[i].norm());
    if (!fit.fitted()) continue;
    const Vector3 off = fit.shape.displacement_m[i] - truth_m[i];
    const double stated_m = fit.standard_error_m(i);
    all.push_back(1000 * off.norm());
    if (fit.seen[i]) seen.push_back(1000 * off.norm());
    const bool far_beyond = off.norm() > 3 * stated_m;
    square += stated_m * stated_m;
    beyond += far_beyond ? 1 : 0;
    // 14.16: as rare for three components as three standard deviations for one. Held nodes have none.
    const double kLeastVariance = 1e-10;
    const Eigen::Matrix3d covariance = fit.covariance_m2[i] + kLeastVariance * Eigen::Matrix3d::Identity();
    if (off.dot(covariance.ldlt().solve(off)) > 14.16) beyond_direction += 1;
    if (!fit.told(i)) continue;
    told.push_back(1000 * off.norm());
    told_square += stated_m * stated_m;
    told_beyond += far_beyond ? 1 : 0;
  }
  record.farthest_mm = share_of(gone, 1);
  record.mean_mm = mean_of(gone);
  if (!fit.fitted()) return;
  const double count = double(all.size());
  record.error_mm = mean_of(all);
  record.error_95_mm = share_of(all, 0.95);
  record.seen_error_mm = mean_of(seen);
  record.told_error_mm = mean_of(told);
  record.told = double(told.size()) / count;
  record.stated_mm = 1000 * std::sqrt(square / count);
  record.told_stated_mm = 1000 * std::sqrt(told_square / std::max(1.0, double(told.size())));
  record.beyond = beyond / count;
  record.told_beyond = told_beyond / std::max(1.0, double(told.size()));
  record.beyond_direction = beyond_direction / count;
}

/// What is entered with docs/results/record.py: "aside_mean=0.41".
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

void tell_some(const std::string& name, const std::vector<Record>& records,
               const std::function<bool(const Record&)>& counts, Figures& figures) {
  std::vector<double> seen, all, told, far_95, share_told, stated, told_stated, beyond, told_beyond,
      direction, mean;
  double pictures = 0, seconds = 0, moments_beyond = 0;
  for (const Record& record : records) {
    if (!counts(record)) continue;
    pictures += 1;
    seconds += record.seconds;
    if (record.fitted == 0) continue;
    mean.push_back(record.mean_mm);
    seen.push_back(record.seen_error_mm);
    all.push_back(record.error_mm);
    told.push_back(record.told_error_mm);
    far_95.push_back(record.error_95_mm);
    share_told.push_back(100 * record.told);
    stated.push_back(record.stated_mm);
    told_stated.push_back(record.told_stated_mm);
    beyond.push_back(100 * record.beyond);
    told_beyond.push_back(100 * record.told_beyond);
    direction.push_back(100 * record.beyond_direction);
    if (record.error_mm > 3 * record.stated_mm) moments_beyond += 1;
  }
  if (pictures == 0) return;
  const double fitted = double(all.size());
  std::printf(
      "%-10s %4.0f pictures, %5.1f %% refused  rigid %5.2f  error seen %5.2f, all %5.2f, 95 %% %5.2f, ",
      name.c_str(), pictures, 100 * (1 - fitted / pictures), mean_of(mean), mean_of(seen), mean_of(all),
      share_of(all, 0.95));
  std::printf("nodes' 95 %% %5.2f, told %5.2f (95 %% %5.2f) of %3.0f %%  stated %5.2f, told %5.2f  ",
              mean_of(far_95), mean_of(told), share_of(told, 0.95), mean_of(share_told), mean_of(stated),
              mean_of(told_stated));
  std::printf("beyond %4.2f %%, told %4.2f %%, by direction %4.2f %%, moments %.0f  %4.2f s\n",
              mean_of(beyond), mean_of(told_beyond), mean_of(direction), moments_beyond, seconds / pictures);
  std::string id = name;
  std::ranges::replace(id, ' ', '_');
  figures.add(id + "_pictures", pictures);
  figures.add(id + "_refused", 100 * (1 - fitted / pictures));
  if (fitted == 0) return;
  figures.add(id + "_rigid", mean_of(mean));
  figures.add(id + "_mean", mean_of(all));
  figures.add(id + "_95", share_of(all, 0.95));
  figures.add(id + "_seen", mean_of(seen));
  figures.add(id + "_told", mean_of(share_told));
  figures.add(id + "_told_mean", mean_of(told));
  figures.add(id + "_stated", mean_of(stated));
  figures.add(id + "_beyond", mean_of(beyond));
  figures.add(id + "_told_beyond", mean_of(told_beyond));
  figures.add(id + "_direction", mean_of(direction));
}

/// Of what the command lays on the pictures, beside the rigid organ and the fit by itself in the same ones.
void tell_command(const std::string& name, const std::vector<Record>& records,
                  const std::function<bool(const Record&)>& counts, Figures& figures) {
  std::vector<double> off, rigid, error, library, apart, stated, beyond;
  double pictures = 0, deformed = 0, lost = 0;
  for (const Record& record : records) {
    if (!counts(record)) continue;
    pictures += 1;
    lost += record.placed == 0 ? 1 : 0;
    if (record.command != "deformed") continue;
    deformed += 1;
    error.push_back(record.command_error_mm);
    stated.push_back(record.command_stated_mm);
    beyond.push_back(100 * record.command_beyond);
    if (record.fitted != 0) {
      library.push_back(record.error_mm);
      apart.push_back(record.apart_mm);
    }
    if (record.held == 0) continue;
    off.push_back(record.off_mm);
    rigid.push_back(record.rigid_off_mm);
  }
  if (pictures == 0) return;
  std::printf(
      "%-10s command: %3.0f pictures, %5.1f %% deformed, %4.1f %% nothing laid  laid %5.2f where rigid is "
      "%5.2f  error %5.2f, library %5.2f, apart %5.2f  stated %5.2f  beyond %4.2f %%\n",
      name.c_str(), pictures, 100 * deformed / pictures, 100 * lost / pictures, mean_of(off), mean_of(rigid),
      mean_of(error), mean_of(library), mean_of(apart), mean_of(stated), mean_of(beyond));
  std::string id = name;
  std::ranges::replace(id, ' ', '_');
  figures.add(id + "_pictures", pictures);
  figures.add(id + "_deformed", 100 * deformed / pictures);
  figures.add(id + "_nothing", 100 * lost / pictures);
  if (deformed == 0) return;
  if (!off.empty()) {
    figures.add(id + "_rigid", mean_of(rigid));
    figures.add(id + "_laid", mean_of(off));
  }
  figures.add(id + "_error", mean_of(error));
  if (!library.empty()) {
    figures.add(id + "_library", mean_of(library));
    figures.add(id + "_apart", mean_of(apart));
  }
  figures.add(id + "_stated", mean_of(stated));
  figures.add(id + "_beyond", mean_of(beyond));
}

void tell_speed(const std::vector<Record>& records) {
  std::vector<double> rigid, fitted, kept;
  for (const Record& record : records) {
    const bool is_fitted = record.command == "deformed" || record.command == "unfitted" ||
                           record.command == "within-error" || record.command == "not-better";
    (is_fitted ? fitted : kept).push_back(record.command_seconds);
    // A picture in which the organ is sought all over is another matter.
    if (record.held != 0) rigid.push_back(record.rigid_seconds);
  }
  Figures figures;
  const double of_rigid = std::max(1e-6, share_of(rigid, 0.5));
  figures.add("fitted", (share_of(fitted, 0.5) + of_rigid) / of_rigid);
  figures.add("kept", (share_of(kept, 0.5) + of_rigid) / of_rigid);
  figures.add("rigid", 1000 * of_rigid);
  std::printf("docs/results/record.py deform-speed --machine NAME%s\n", figures.line().c_str());
}

void tell(const std::vector<Record>& records) {
  Figures figures, sizes, nothing, command;
  const auto is_fair = [](const Record& record) {
    return has_truth(record.condition) && record.condition != "barrel" && record.condition != "rest";
  };
  for (const char* const condition : kWithTruth)
    tell_some(
        condition, records, [&](const Record& record) { return record.condition == condition; }, figures);
  tell_some("all", records, is_fair, figures);
  for (const auto& [name, low, high] :
       {std::tuple{"to10", 0., 10.}, {"to20", 10., 20.}, {"to30", 20., 27.}, {"at30", 27., 40.}})
    tell_some(
        name, records,
        [&, low = low, high = high](const Record& record) {
          return is_fair(record) && record.farthest_mm > low && record.farthest_mm <= high;
        },
        sizes);
  for (const char* const condition : kWithout)
    tell_some(
        condition, records, [&](const Record& record) { return record.condition == condition; }, nothing);
  for (const char* const condition : kWithTruth)
    tell_command(
        condition, records, [&](const Record& record) { return record.condition == condition; }, command);
  tell_command("all", records, is_fair, command);
  for (const char* const condition : kWithout)
    tell_command(
        condition, records, [&](const Record& record) { return record.condition == condition; }, nothing);
  std::printf("docs/results/record.py deform-command --machine NAME%s\n", command.line().c_str());
  tell_speed(records);
  std::printf("docs/results/record.py deform --machine NAME%s\n", figures.line().c_str());
  std::printf("docs/results/record.py deform-sizes --machine NAME%s\n", sizes.line().c_str());
  std::printf("docs/results/record.py deform-nothing --machine NAME%s\n", nothing.line().c_str());
}

using Settings = kiroku::bench::SequenceSettings;

/// The organ at rest in the first picture, found from a place that is off; that place where it is not found,
/// as what is no such organ is laid on the picture by somebody.
Expected found_at_rest(const Picture& picture, const OrganSurface& surface, const Pinhole& pinhole,
                       const Camera& truth, Chance& chance) {
  Motion off;
  for (Eigen::Index i = 0; i < 6; ++i) off[i] = chance.between(-0.004, 0.004);
  Expected expected{after_motion(surface, truth, off), MotionCovariance::Identity()};
  constexpr double kKnownM = 0.01;
  expected.covariance_m2 *= kKnownM * kKnownM;
  const auto found =
      fit_outline(colour_cells(picture, cover_of(picture)), surface, pinhole, expected, nullptr, {32, 10, 6});
  return found ? Expected{found->camera, found->covariance_m2} : expected;
}

/// What the command does: the organ is found by itself, followed, and deformed where that says more.
class AsTheCommand {
 public:
  AsTheCommand(const TetMesh& mesh, const DeformableOrgan& organ)
      : organ_(organ), track_(mesh, EndoscopeScene::kFieldDeg), deformed_(organ) {}

  void take(const Picture& picture) {
    time_ns_ += 100'000'000;
    const double started = processor_seconds();
    rigid_ = track_.take(time_ns_, picture);
    const double between = processor_seconds();
    moment_ = deformed_.take(track_.taken(), rigid_);
    rigid_seconds_ = between - started;
    seconds_ = processor_seconds() - between;
  }

  /// `fit`: of the same picture by itself.
  void judge(const Camera& camera, const std::vector<Vector3>& truth_m, const DeformedFit& fit,
             Record& record) const {
    const std::vector<Vector3>& nodes = organ_.surface().nodes;
    record.command = name_of(moment_.why);
    record.held = rigid_.held() ? 1 : 0;
    record.placed = rigid_.held() || moment_.deformed() ? 1 : 0;
    record.rigid_seconds = rigid_seconds_;
    record.command_seconds = seconds_;
    const double count = double(nodes.size());
    double told = 0, square = 0;
    for (std::size_t i = 0; i < nodes.size(); ++i) {
      const Vector3 truth = camera.view_m(nodes[i] + truth_m[i]);
      const double rigid_mm = 1000 * (rigid_.camera.view_m(nodes[i]) - truth).norm();
      record.rigid_off_mm += rigid_.held() ? rigid_mm / count : 0;
      if (!moment_.deformed()) {
        record.off_mm += rigid_.held() ? rigid_mm / count : 0;
        continue;
      }
      const Vector3& displacement = moment_.displacement_m[i];
      const double error_mm = 1000 * (displacement - truth_m[i]).norm();
      record.off_mm += 1000 * (moment_.camera.view_m(nodes[i] + displacement) - truth).norm() / count;
      record.command_error_mm += error_mm / count;
      if (fit.fitted()) record.apart_mm += 1000 * (displacement - fit.shape.displacement_m[i]).norm() / count;
      if (!moment_.told[i]) continue;
      told += 1;
      square += std::pow(1000 * double(moment_.error_m[i]), 2);
      record.command_beyond += error_mm > 3000 * double(moment_.error_m[i]) ? 1 : 0;
    }
    record.command_beyond /= std::max(1.0, told);
    record.command_stated_mm = std::sqrt(square / std::max(1.0, told));
  }

  void show() const {
    std::printf(
        "   command %-20s %-18s rigid %-13s %4.2f px %4.2f  fit %4.2f px %4.2f  agree %4.2f rigid %4.2f  "
        "beyond "
        "%4.2f largest %5.2f stated %5.2f  ",
        name_of(moment_.why), name_of(moment_.unfitted), name_of(rigid_.why), rigid_.misfit_px,
        rigid_.supported, moment_.misfit_px, moment_.supported, moment_.points_agree,
        moment_.rigid_points_agree, moment_.beyond, 1000 * moment_.largest_m,
        1000 * moment_.standard_error_m);
  }

 private:
  const DeformableOrgan& organ_;
  OrganTrack track_;
  DeformedTrack deformed_;
  std::int64_t time_ns_ = 0;
  AlignedMoment rigid_;
  DeformedMoment moment_;
  double rigid_seconds_ = 0, seconds_ = 0;
};

void fit_sequence(const DeformableOrgan& organ, const TetMesh& mesh, const Sequence& sequence,
                  const std::string& condition, std::uint32_t seed, const Settings& settings,
                  const std::function<void(const Record&)>& keep) {
  const Pinhole pinhole =
      pinhole_of(EndoscopeScene::kFieldDeg, EndoscopeScene::kWidth, EndoscopeScene::kHeight);
  const OrganSurface& surface = organ.surface();
  Chance chance(seed + 500);
  const Expected pose = found_at_rest(sequence.pictures[0], surface, pinhole, sequence.cameras[0], chance);
  const Picture& first = sequence.pictures[0];
  ColourModel colours;
  if (const auto silhouette = silhouette_of(surface, pose.camera, pinhole, first.width, first.height, 2))
    colours =
        colours_of(colour_cells(first, cover_of(first)), *silhouette,
                   0.5 * pinhole.focal_px * surface.radius_m / -pose.camera.view_m(surface.middle_m).z());
  SurfacePoints points;
  points.follow(first, cover_of(first));
  points.fix(surface, pinhole, pose);
  AsTheCommand command(mesh, organ);
  command.take(first);
  // What a camera may do between two pictures; one that is held by an arm does nothing.
  constexpr double kSwayM = 0.004;
  Eigen::VectorXd begin;
  for (std::size_t i = 1; i < sequence.pictures.size(); ++i) {
    const Picture& picture = sequence.pictures[i];
    const double started = processor_seconds();
    const Cover cover = cover_of(picture);
    points.follow(picture, cover);
    std::vector<TrackedTissue> tissue;
    if (condition != "outline") {
      for (const auto& [organ_m, pixel] : points.followed())
        tissue.push_back({nearest_place(surface, organ_m), pixel});
    }
    Expected expected = pose;
    if (condition == "camera")
      expected.covariance_m2 += kSwayM * kSwayM * double(i) * MotionCovariance::Identity();
    const DeformedFit fit =
        fit_deformed(colour_cells(picture, cover), organ, pinhole, expected, begin, tissue, &colours);
    if (fit.fitted()) begin = fit.coefficients;
    Record record;
    record.condition = condition;
    record.why = name_of(fit.why);
    record.fitted = fit.fitted() ? 1 : 0;
    record.seconds = processor_seconds() - started;
    judge(fit, sequence.displacement_m[i], record);
    command.take(picture);
    command.judge(sequence.cameras[i], sequence.displacement_m[i], fit, record);
    keep(record);
    if (settings.show.empty()) continue;
    std::printf("%2zu %-20s far %5.1f mean %5.2f  error %5.2f seen %5.2f told %5.2f of %4.2f  stated %5.2f  ",
                i, record.why.c_str(), record.farthest_mm, record.mean_mm, record.error_mm,
                record.seen_error_mm, record.told_error_mm, record.told, record.stated_mm);
    std::printf(
        "beyond %4.2f told %4.2f dir %4.2f  outline %4.2f %4.2f px of %zu  points %zu %4.2f %4.2f px  ",
        record.beyond, record.told_beyond, record.beyond_direction, fit.supported, fit.border_px, fit.lines,
        fit.points, fit.points_agree, fit.points_misfit_px);
    std::printf("a %4.2f of %4.1f pose off %4.2f mm %4.2f s\n",
                fit.expected.size() > 0 ? fit.expected.maxCoeff() : 0, fit.determined,
                1000 * way_between_m(surface, fit.camera, sequence.cameras[i]), record.seconds);
    command.show();
    std::printf("off %5.2f rigid %5.2f  apart %5.2f  %4.2f s, rigid %4.2f s\n", record.off_mm,
                record.rigid_off_mm, record.apart_mm, record.command_seconds, record.rigid_seconds);
    if (settings.show != "-")
      write_png(settings.show + "/" + std::to_string(seed) + "-" + std::to_string(i) + ".png", picture);
  }
}

/// Without the tetrahedra at its poles that its shape turns inside out.
TetMesh sound_kidney() {
  const TetMesh whole = kiroku::test::kidney_like_mesh({8, 8, 14});
  TetMesh sound{whole.nodes, {}, {}};
  for (std::size_t t = 0; t < whole.tetrahedra.size(); ++t) {
    constexpr double kLeastM3 = 1e-11;
    if (signed_volume_m3(whole, t) < kLeastM3) continue;
    sound.tetrahedra.push_back(whole.tetrahedra[t]);
    sound.regions.push_back(whole.regions[t]);
  }
  return sound;
}

void run(const Settings& settings) {
  const TetMesh plan = kiroku::test::liver_like_mesh({20, 6, 14}), other = sound_kidney();
  const double before = processor_seconds();
  const DeformableOrgan organ(kiroku::test::plan_body(plan));
  std::printf("responses to %td forces at %zu nodes in %.2f s\n", organ.unknowns(), plan.nodes.size(),
              processor_seconds() - before);
  const DeformableOrgan kidney(kiroku::test::plan_body(other, {{0, 0, -0.05}, 0.025}));
  std::vector<Record> records;
  std::ofstream file;
  if (!settings.records.empty()) file.open(settings.records, std::ios::app);
  for (int n = 0; n < settings.sequences; ++n) {
    const std::uint32_t seed = settings.first + static_cast<std::uint32_t>(n);
    const std::string condition = condition_of(seed);
    const bool is_other = condition == "another organ";
    const DeformableOrgan& sought = is_other ? kidney : organ;
    const Sequence sequence = rendered(seed, condition, settings.pictures, sought.surface());
    std::vector<Record> of_this;
    fit_sequence(sought, is_other ? other : plan, sequence, condition, seed, settings,
                 [&](const Record& record) {
                   of_this.push_back(record);
                   records.push_back(record);
                   std::string written = condition;
                   std::ranges::replace(written, ' ', '_');
                   if (!file.is_open()) return;
                   file << written << ' ' << record.why << ' ' << record.command;
                   visit(record, [&](double value) { file << ' ' << value; });
                   file << '\n';
                 });
    file.flush();
    Figures unused;
    std::printf("%u ", seed);
    tell_some(
        condition, of_this, [](const Record&) { return true; }, unused);
    std::fflush(stdout);
  }
  tell(records);
}

std::vector<Record> records_of(const std::vector<std::string>& files) {
  std::vector<Record> records;
  for (const std::string& name : files) {
    std::ifstream file(name);
    if (!file) throw kiroku::Error("cannot read " + name);
    Record record;
    while (file >> record.condition >> record.why >> record.command) {
      visit(record, [&](double& value) { file >> value; });
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
    settings.sequences = 9;
    settings.pictures = 12;
    settings.read(argc, argv);
    if (settings.told.empty())
      run(settings);
    else
      tell(records_of(settings.told));
  } catch (const std::exception& error) {
    std::cerr << error.what() << '\n';
    return 2;
  }
  return 0;
}

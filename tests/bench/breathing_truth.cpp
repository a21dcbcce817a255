// Makes the radiographs of a lung that breathes as no model of Kiroku's fit does, for
// tests/bench/series_fit.py.
//
//   breathing_truth CT MODEL.json OUT MOMENTS RATE SEED
//
// MODEL is read for its mesh, tumour and boundary groups alone. What differs from the model that is fitted:
//  - the lung slides along rib cage, back and diaphragm (only the normal part of a wall's motion is given,
//  the
//    diaphragm's is straight down and greater at the back);
//  - breaths are cos^4 (Lujan et al., Medical Physics 26(5), 1999), each 20 % longer or shorter and deeper or
//    flatter at random, with a drift of 1.5 mm a minute; the rib cage leads by 0.3 s, and the lung follows
//    its diaphragm later the higher it lies, by up to 0.3 s (hysteresis);
//  - tissue keeps its mass; rays have four energies; scatter is 0.3 of the primary, smoothed; the detector
//  blurs
//    by 0.7 pixels; quanta are counted; a couch's rail and a tube lie in the picture;
//  - the patient lies up to 15 mm (each axis) and 10 degrees (one axis) from where the geometry has them.
// SEED chooses breaths, pose and quanta. Written: OUT/front.json, OUT/side.json, OUT/truth.csv (the tumour's
// centre in the room), OUT/trace.csv (a belt's: breaths without drift, late by 0.1 s, with noise),
// OUT/pose.txt and OUT/level1 to level5 with the folders front and side of PNG files; levels are quanta a
// pixel without a patient: 1,000,000, 100,000, 30,000, 10,000, 3,000.
#include <cmath>
#include <filesystem>
#include <fstream>
#include <iostream>
#include <numbers>
#include <random>

#include <Eigen/Geometry>

#include "base/error.h"
#include "base/number_text.h"
#include "sim/drr/mesh_projector.h"
#include "sim/drr/picture.h"
#include "sim/drr/registration.h"
#include "sim/fem/elastic_body.h"
#include "sim/mesh/degrees_of_freedom.h"
#include "sim/respiration/breathing_model.h"
#include "sim/respiration/breathing_pictures.h"
#include "sim/volume/volume_reader.h"

namespace kiroku::sim {
namespace {

namespace fs = std::filesystem;

constexpr std::array<double, 5> kQuanta{1e6, 1e5, 3e4, 1e4, 3e3};
constexpr std::array<double, 4> kEnergiesKev{45, 60, 80, 100}, kSpectrum{0.2, 0.35, 0.3, 0.15};
constexpr double kScatter = 0.3, kBlurPixels = 0.7, kElectronic = 3;

/// The same on every machine, unlike std::normal_distribution.
class Chance {
 public:
  explicit Chance(unsigned seed) : engine_(seed) {}
  double even() { return (double(engine_()) + 0.5) / 4294967296.0; }
  double normal() { return std::sqrt(-2 * std::log(even())) * std::cos(2 * std::numbers::pi * even()); }
  double poisson(double mean) {
    constexpr double kMany = 60;
    if (mean > kMany) return std::max(std::round(mean + std::sqrt(mean) * normal()), 0.0);
    double product = even(), count = 0;
    for (const double least = std::exp(-mean); product > least; ++count) product *= even();
    return count;
  }

 private:
  std::mt19937 engine_;
};

/// 0 at rest in the CT, about 1 deepest; cos^4 breaths that differ.
class Breaths {
 public:
  Breaths(double until_s, Chance& chance) {
    for (double begin_s = -10; begin_s < until_s + 10;) {
      const double length_s = 3.6 * std::clamp(1 + 0.2 * chance.normal(), 0.6, 1.5);
      breaths_.push_back({begin_s, length_s, std::clamp(1 + 0.2 * chance.normal(), 0.5, 1.5)});
      begin_s += length_s;
    }
  }
  [[nodiscard]] double at(double time_s) const {
    const Breath* at = &breaths_.front();
    for (const Breath& breath : breaths_) {
      if (breath.begin_s <= time_s) at = &breath;
    }
    return at->depth * (1 - std::pow(std::cos(std::numbers::pi * (time_s - at->begin_s) / at->length_s), 4));
  }

 private:
  struct Breath {
    double begin_s, length_s, depth;
  };
  std::vector<Breath> breaths_;
};

struct WallMotion {
  double rib_cage_m, diaphragm_m;
};

/// Third column: the normal.
Eigen::Matrix3d axes_of(const Vector3& normal) {
  Eigen::Matrix3d axes;
  axes.col(0) = normal.unitOrthogonal();
  axes.col(1) = normal.cross(axes.col(0));
  axes.col(2) = normal;
  return axes;
}

/// Where the walls take the lung while it slides along them.
std::vector<Vector3> deformed(const BreathingModel& model, const LungSurface& surface,
                              const WallMotion& motion) {
  const Extent extent = extent_of(model.mesh);
  Constraints sliding(model.mesh.nodes.size());
  for (std::size_t node = 0; node < model.groups.size(); ++node) {
    const BoundaryGroup group = model.groups[node];
    if (group == BoundaryGroup::kTrachea) sliding.prescribe(node, Vector3::Zero(), "hilum");
    if (group != BoundaryGroup::kRibCage && group != BoundaryGroup::kDiaphragm &&
        group != BoundaryGroup::kBack)
      continue;
    const Vector3 normal = surface.normals[static_cast<std::size_t>(surface.row_of[node])];
    const double back =
        (model.mesh.nodes[node].y() - extent.least.y()) / (extent.greatest.y() - extent.least.y());
    double along_m = 0;
    if (group == BoundaryGroup::kRibCage) along_m = motion.rib_cage_m;
    if (group == BoundaryGroup::kDiaphragm) along_m = motion.diaphragm_m * (0.7 + 0.6 * back) * -normal.z();
    sliding.turn(node, axes_of(normal));
    sliding.prescribe(node, 2, along_m, "wall");
  }
  const ElasticBody slid(model.mesh, model.materials, sliding);
  const Eigen::VectorXd all =
      slid.solve(Eigen::VectorXd::Zero(first_row(model.mesh.nodes.size()))).displacement_m;
  std::vector<Vector3> displacement_m;
  for (Eigen::Index at = 0; at < all.size(); at += 3) displacement_m.emplace_back(all.segment<3>(at));
  return displacement_m;
}

/// The true lung at any moment, by a table of its states.
class TrueLung {
 public:
  TrueLung(const BreathingModel& model, Breaths breaths) : breaths_(std::move(breaths)) {
    const LungSurface surface = surface_of(model.mesh);
    const Extent extent = extent_of(model.mesh);
    for (const Vector3& node : model.mesh.nodes)
      height_.push_back((node.z() - extent.least.z()) / (extent.greatest.z() - extent.least.z()));
    rib_cage_ = StateAxis::covering(-0.002, 0.002, 0.002);
    diaphragm_ = StateAxis::covering(-0.01, 0.008, 0.006);
    for (std::size_t i = 0; i < rib_cage_.count; ++i) {
      for (std::size_t j = 0; j < diaphragm_.count; ++j)
        states_.push_back(deformed(model, surface, {rib_cage_.node(i), diaphragm_.node(j)}));
    }
  }
  [[nodiscard]] double breath(double time_s) const { return breaths_.at(time_s); }
  [[nodiscard]] std::vector<Vector3> displacement_m(double time_s) const {
    constexpr double kLeadS = 0.3, kLagS = 0.3, kDriftMPerS = 0.0015 / 60;
    const StateAxis::Blend r = rib_cage_.at(-0.0015 + 0.0025 * breaths_.at(time_s + kLeadS));
    std::vector<Vector3> displacement_m(height_.size(), Vector3::Zero());
    for (std::size_t node = 0; node < height_.size(); ++node) {
      const StateAxis::Blend d =
          diaphragm_.at(-0.009 + 0.012 * breaths_.at(time_s - kLagS * height_[node]) + kDriftMPerS * time_s);
      for (std::size_t i = 0; i < 4; ++i) {
        for (std::size_t j = 0; j < 4; ++j) {
          displacement_m[node] +=
              r.weight[i] * d.weight[j] * states_[(r.first + i) * diaphragm_.count + d.first + j][node];
        }
      }
    }
    return displacement_m;
  }

 private:
  Breaths breaths_;
  std::vector<double> height_;
  StateAxis rib_cage_, diaphragm_;
  std::vector<std::vector<Vector3>> states_;
};

/// Means over a square, along rows and down columns in turn.
void smooth(std::vector<float>& image, std::size_t columns, std::size_t rows, std::size_t radius) {
  std::vector<float> line, sums;
  const auto pass = [&](std::size_t first, std::size_t stride, std::size_t count) {
    line.resize(count);
    double sum = 0, in = 0;
    const auto at = [&](std::size_t i) -> float& { return image[first + i * stride]; };
    for (std::size_t i = 0; i < count + radius; ++i) {
      if (i < count) {
        sum += double(at(i));
        ++in;
      }
      if (i > 2 * radius) {
        sum -= double(at(i - 2 * radius - 1));
        --in;
      }
      if (i >= radius) line[i - radius] = static_cast<float>(sum / in);
    }
    for (std::size_t i = 0; i < count; ++i) at(i) = line[i];
  };
  for (std::size_t row = 0; row < rows; ++row) pass(row * columns, 1, columns);
  for (std::size_t column = 0; column < columns; ++column) pass(column, columns, rows);
}

void blur(std::vector<float>& image, std::size_t columns, std::size_t rows) {
  const std::array<double, 3> part{1, std::exp(-0.5 / (kBlurPixels * kBlurPixels)),
                                   std::exp(-2 / (kBlurPixels * kBlurPixels))};
  const double all = part[0] + 2 * part[1] + 2 * part[2];
  for (const bool down : {false, true}) {
    const std::vector<float> from = image;
    const std::ptrdiff_t count = std::ptrdiff_t(down ? rows : columns);
    for (std::size_t at = 0; at < image.size(); ++at) {
      const std::ptrdiff_t place = std::ptrdiff_t(down ? at / columns : at % columns);
      double sum = 0;
      for (std::ptrdiff_t i = -2; i <= 2; ++i) {
        const std::ptrdiff_t other = std::clamp<std::ptrdiff_t>(place + i, 0, count - 1) - place;
        sum += part[std::size_t(std::abs(i))] *
               double(from[std::size_t(std::ptrdiff_t(at) + other * (down ? std::ptrdiff_t(columns) : 1))]);
      }
      image[at] = static_cast<float>(sum / all);
    }
  }
}

/// A couch's rail along the picture and a tube across it: parts of the rays that they let through.
double let_through(std::size_t column, std::size_t row, std::size_t columns, std::size_t rows) {
  const double u = double(column) / double(columns), v = double(row) / double(rows);
  double attenuated = 0;
  if (u > 0.86 && u < 0.885) attenuated += 0.6;
  const double tube = std::abs(v - 0.3 - 0.15 * std::sin(5 * u));
  if (tube < 0.008 && u > 0.3 && u < 0.7) attenuated += 0.35;
  return std::exp(-attenuated);
}

void write_text(const fs::path& file, const std::string& text) {
  std::ofstream(file, std::ios::binary) << text;
}

int run(const std::vector<std::string>& given) {
  const fs::path out = given[2];
  const std::size_t moments = std::stoul(given[3]);
  const double rate = std::stod(given[4]);
  Chance chance(static_cast<unsigned>(std::stoul(given[5])));
  const BreathingModel model = read_breathing_model(given[1]);
  const VolumeFile file = read_volume(given[0], {});
  const TrueLung lung(model, Breaths(double(moments) / rate, chance));
  std::cerr << "states solved\n";
  const Extent extent = extent_of(model.mesh);
  const Vector3 middle = (extent.least + extent.greatest) / 2;
  const Vector3 shift_m(0.015 * (2 * chance.even() - 1), 0.015 * (2 * chance.even() - 1),
                        0.015 * (2 * chance.even() - 1));
  const Vector3 axis = Vector3(chance.normal(), chance.normal(), chance.normal()).normalized();
  const double degrees = 10 * (2 * chance.even() - 1);
  const Eigen::Isometry3d pose = rigid_motion(shift_m, degrees * std::numbers::pi / 180 * axis, middle);
  write_text(fs::path(out) / "pose.txt",
             number_text(1000 * shift_m.x(), 4) + " " + number_text(1000 * shift_m.y(), 4) + " " +
                 number_text(1000 * shift_m.z(), 4) + " mm, " + number_text(degrees, 4) + " degrees about " +
                 number_text(axis.x(), 3) + " " + number_text(axis.y(), 3) + " " + number_text(axis.z(), 3) +
                 "\n");
  const MeshPoint centre = centre_of(model.mesh, model.needed_tumour());
  std::string truth = "time_s,x_mm,y_mm,z_mm\n", trace = "time_s,amplitude\n";
  std::vector<std::vector<Vector3>> displacements;
  for (std::size_t i = 0; i < moments; ++i) {
    const double time_s = double(i) / rate;
    displacements.push_back(lung.displacement_m(time_s));
    const Vector3 place = 1000 * (pose * (centre.mean(model.mesh.nodes) + centre.mean(displacements.back())));
    truth += number_text(time_s, 8) + "," + number_text(place.x(), 8) + "," + number_text(place.y(), 8) +
             "," + number_text(place.z(), 8) + "\n";
  }
  for (double time_s = 0; time_s < double(moments) / rate + 1; time_s += 0.04)
    trace += number_text(time_s, 8) + "," +
             number_text(lung.breath(time_s - 0.1) + 0.03 * chance.normal(), 6) + "\n";
  write_text(out / "truth.csv", truth);
  write_text(out / "trace.csv", trace);
  for (const std::string view : {"front", "side"}) {
    GantrySetup setup{1,          1.5,       Vector3(0.014, 0.008, -0.175), view == "front" ? 0.0 : 90.0,
                      {512, 512}, {0.6, 0.6}};
    setup.isocenter_m = middle;
    write_text(out / (view + ".json"),
               R"({"sad_mm": 1000, "sid_mm": 1500, "isocenter_mm": [)" + number_text(1000 * middle.x(), 17) +
                   ", " + number_text(1000 * middle.y(), 17) + ", " + number_text(1000 * middle.z(), 17) +
                   R"(], "gantry_deg": )" + number_text(setup.gantry_deg) +
                   R"(, "detector_px": [512, 512], "detector_mm": [600, 600]})" + "\n");
    const ProjectionGeometry geometry = ProjectionGeometry(setup).of_moved_patient(pose);
    std::vector<std::vector<float>> arrived(moments, std::vector<float>(512 * 512, 0.0F));
    for (std::size_t energy = 0; energy < kEnergiesKev.size(); ++energy) {
      const CtProjector ct(file.volume, Attenuation(kEnergiesKev[energy]));
      const MeshProjector mesh(ct, model.mesh);
      const ProjectionImage still = mesh.outside(geometry);
      for (std::size_t i = 0; i < moments; ++i) {
        ProjectionImage image = mesh.inside(geometry, displacements[i], DensityRule::kKeepMass);
        add_to(image, still);
        for (std::size_t at = 0; at < image.values.size(); ++at)
          arrived[i][at] += static_cast<float>(kSpectrum[energy] * std::exp(-double(image.values[at])));
      }
    }
    std::cerr << view << " projected\n";
    for (std::size_t i = 0; i < moments; ++i) {
      std::vector<float>& image = arrived[i];
      for (std::size_t at = 0; at < image.size(); ++at)
        image[at] *= static_cast<float>(let_through(at % 512, at / 512, 512, 512));
      std::vector<float> scatter = image;
      for (int pass = 0; pass < 3; ++pass) smooth(scatter, 512, 512, 40);
      for (std::size_t at = 0; at < image.size(); ++at)
        image[at] += static_cast<float>(kScatter) * scatter[at];
      blur(image, 512, 512);
      for (std::size_t level = 0; level < kQuanta.size(); ++level) {
        ProjectionImage film{512, 512, {}};
        for (const float value : image) {
          const double counted =
              chance.poisson(kQuanta[level] * double(value)) + kElectronic * chance.normal();
          film.values.push_back(static_cast<float>(-std::log(std::max(counted, 1.0) / kQuanta[level])));
        }
        const fs::path folder = out / ("level" + std::to_string(level + 1)) / view;
        fs::create_directories(folder);
        std::string name = std::to_string(i);
        name.insert(0, 4 - name.size(), '0');
        const Bytes png = png_of(picture_of(film, Response::kFilm, Window{0, 12}, Polarity::kBoneWhite));
        std::ofstream(folder / (name + ".png"), std::ios::binary)
            .write(reinterpret_cast<const char*>(png.data()), static_cast<std::streamsize>(png.size()));
      }
    }
    std::cerr << view << " written\n";
  }
  return 0;
}

}  // namespace
}  // namespace kiroku::sim

int main(int count, char** words) {
  const std::vector<std::string> given(words + 1, words + count);
  if (given.size() != 6) {
    std::cerr << "usage: breathing_truth CT MODEL.json OUT MOMENTS RATE SEED\n";
    return 2;
  }
  try {
    std::filesystem::create_directories(given[2]);
    return kiroku::sim::run(given);
  } catch (const std::exception& error) {
    std::cerr << "breathing_truth: " << error.what() << "\n";
    return 1;
  }
}

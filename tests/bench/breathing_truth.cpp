// Makes the radiographs of a lung that breathes as no model of Kiroku's fit does, for
// tests/bench/breathing_proof.py.
//
//   breathing_truth CT MODEL.json OUT MOMENTS RATE SEED
//
// MODEL is read for its mesh, tumour and boundary groups alone. How the lung moves instead stands in
// tests/support/other_lung.h, how its pictures come about in tests/support/fluoroscope.h. The patient lies up
// to 15 mm (each axis) and 10 degrees (one axis) from where the geometry has them; one moment in twenty is
// not exposed. SEED chooses breaths, pose and quanta.
//
// Written: OUT/front.json, OUT/side.json, OUT/truth.csv (the tumour's centre in the room, and whether there
// were rays), OUT/trace.csv (a belt's: breaths without drift, late by 0.1 s, with noise), OUT/pose.txt and
// OUT/level1 to level5 with the folders front and side of PNG files; levels are quanta a pixel without a
// patient: 1,000,000, 100,000, 30,000, 10,000, 3,000.
#include <array>
#include <filesystem>
#include <fstream>
#include <iostream>
#include <numbers>

#include <Eigen/Geometry>

#include "base/error.h"
#include "base/number_text.h"
#include "sim/drr/picture.h"
#include "sim/drr/registration.h"
#include "sim/volume/volume_reader.h"
#include "tests/support/fluoroscope.h"
#include "tests/support/other_lung.h"

namespace kiroku::test {
namespace {

namespace fs = std::filesystem;
using sim::Vector3;

constexpr std::array<double, 5> kQuanta{1e6, 1e5, 3e4, 1e4, 3e3};
constexpr std::size_t kSide = 512, kOneNotExposedOf = 20, kWhichOfThese = 13;
constexpr double kBreathS = 3.6, kBeltLateS = 0.1, kBeltNoise = 0.03, kBeltStepS = 0.04;

bool exposed(std::size_t moment) { return moment % kOneNotExposedOf != kWhichOfThese; }

void write_text(const fs::path& file, const std::string& text) {
  if (!(std::ofstream(file, std::ios::binary) << text)) throw Error("cannot write " + file.string());
}

struct Lying {
  Eigen::Isometry3d pose;
  std::string words;
};

Lying lying(const Vector3& middle_m, Chance& chance) {
  const auto within = [&](double most) { return most * (2 * chance.even() - 1); };
  const double x = within(0.015), y = within(0.015), z = within(0.015);
  const double u = chance.normal(), v = chance.normal(), w = chance.normal(), degrees = within(10);
  const Vector3 axis = Vector3(u, v, w).normalized();
  const auto text = [](double value) { return number_text(value, 3); };
  return {sim::rigid_motion({x, y, z}, degrees * std::numbers::pi / 180 * axis, middle_m),
          text(1000 * x) + ", " + text(1000 * y) + ", " + text(1000 * z) + " mm, " + text(degrees) +
              " degrees about " + text(axis.x()) + ", " + text(axis.y()) + ", " + text(axis.z()) + "\n"};
}

std::string geometry_text(const Vector3& isocenter_m, double gantry_deg) {
  return R"({"sad_mm": 1000, "sid_mm": 1500, "isocenter_mm": [)" + number_text(1000 * isocenter_m.x(), 17) +
         ", " + number_text(1000 * isocenter_m.y(), 17) + ", " + number_text(1000 * isocenter_m.z(), 17) +
         R"(], "gantry_deg": )" + number_text(gantry_deg) +
         R"(, "detector_px": [512, 512], "detector_mm": [600, 600]})" + "\n";
}

/// Those of one view, all levels.
void write_pictures(const fs::path& out, const std::string& view, const std::vector<ArrivedRays>& arrived,
                    Chance& chance) {
  for (std::size_t level = 0; level < kQuanta.size(); ++level) {
    const fs::path folder = out / ("level" + std::to_string(level + 1)) / view;
    fs::create_directories(folder);
    for (std::size_t i = 0; i < arrived.size(); ++i) {
      const sim::ProjectionImage film = counted(arrived[i], kQuanta[level], exposed(i), chance);
      std::string name = std::to_string(i);
      name.insert(0, 4 - name.size(), '0');
      const Bytes png = sim::png_of(
          sim::picture_of(film, sim::Response::kFilm, sim::Window{0, 12}, sim::Polarity::kBoneWhite));
      write_text(folder / (name + ".png"),
                 std::string(reinterpret_cast<const char*>(png.data()), png.size()));
    }
  }
}

int run(const std::vector<std::string>& given) {
  const fs::path out = given[2];
  const std::size_t moments = std::stoul(given[3]);
  const double rate = std::stod(given[4]), lasts_s = double(moments) / rate;
  Chance chance(static_cast<unsigned>(std::stoul(given[5])));
  fs::create_directories(out);
  const sim::BreathingModel model = sim::read_breathing_model(given[1]);
  const sim::VolumeFile file = sim::read_volume(given[0], {});
  const OtherLung lung(model, IrregularBreaths(lasts_s, kBreathS, chance), {});
  std::cerr << "states solved\n";
  const sim::Extent extent = sim::extent_of(model.mesh);
  const Vector3 middle_m = (extent.least + extent.greatest) / 2;
  const Lying patient = lying(middle_m, chance);
  write_text(out / "pose.txt", patient.words);

  const sim::MeshPoint centre = sim::centre_of(model.mesh, model.needed_tumour());
  const Vector3 rest_m = centre.mean(model.mesh.nodes);
  std::string truth = "time_s,x_mm,y_mm,z_mm,exposed\n", trace = "time_s,amplitude\n";
  std::vector<std::vector<Vector3>> displacement_m;
  for (std::size_t i = 0; i < moments; ++i) {
    const double time_s = double(i) / rate;
    displacement_m.push_back(lung.displacement_m(time_s));
    const Vector3 place_mm = 1000 * (patient.pose * (rest_m + centre.mean(displacement_m.back())));
    truth += number_text(time_s, 8) + "," + number_text(place_mm.x(), 8) + "," +
             number_text(place_mm.y(), 8) + "," + number_text(place_mm.z(), 8) +
             (exposed(i) ? ",yes\n" : ",no\n");
  }
  for (double time_s = 0; time_s < lasts_s + 1; time_s += kBeltStepS) {
    trace += number_text(time_s, 8) + "," +
             number_text(lung.breath(time_s - kBeltLateS) + kBeltNoise * chance.normal(), 6) + "\n";
  }
  write_text(out / "truth.csv", truth);
  write_text(out / "trace.csv", trace);

  for (const std::string view : {"front", "side"}) {
    sim::GantrySetup setup;
    setup.source_axis_m = 1;
    setup.source_imager_m = 1.5;
    setup.isocenter_m = middle_m;
    setup.gantry_deg = view == "front" ? 0 : 90;
    setup.pixels = {kSide, kSide};
    setup.size_m = {0.6, 0.6};
    write_text(out / (view + ".json"), geometry_text(middle_m, setup.gantry_deg));
    const sim::ProjectionGeometry geometry = sim::ProjectionGeometry(setup).of_moved_patient(patient.pose);
    write_pictures(out, view, fluoroscopy(file.volume, model.mesh, geometry, displacement_m), chance);
    std::cerr << view << " written\n";
  }
  return 0;
}

}  // namespace
}  // namespace kiroku::test

int main(int count, char** words) {
  const std::vector<std::string> given(words + 1, words + count);
  if (given.size() != 6) {
    std::cerr << "usage: breathing_truth CT MODEL.json OUT MOMENTS RATE SEED\n";
    return 2;
  }
  try {
    return kiroku::test::run(given);
  } catch (const std::exception& error) {
    std::cerr << "breathing_truth: " << error.what() << "\n";
    return 1;
  }
}

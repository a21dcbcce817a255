#include "tests/support/fluoroscope.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "sim/drr/registration.h"

namespace kiroku::test {
namespace {

constexpr std::array<double, 4> kEnergiesKev{45, 60, 80, 100}, kSpectrum{0.2, 0.35, 0.3, 0.15};
/// Scatter is so much of the mean primary around; its square is so much of the picture's side.
constexpr double kScatter = 0.3, kScatterSide = 0.08;
constexpr double kBlurPixels = 0.7, kElectronic = 3;

/// Means over a square, along rows and down columns in turn.
void smooth(ArrivedRays& image, std::size_t radius) {
  std::vector<float> line;
  const auto pass = [&](std::size_t first, std::size_t stride, std::size_t count) {
    line.resize(count);
    double sum = 0, in = 0;
    const auto at = [&](std::size_t i) -> float& { return image.parts[first + i * stride]; };
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
  for (std::size_t row = 0; row < image.rows; ++row) pass(row * image.columns, 1, image.columns);
  for (std::size_t column = 0; column < image.columns; ++column) pass(column, image.columns, image.rows);
}

void blur(ArrivedRays& image) {
  const std::array<double, 3> part{1, std::exp(-0.5 / (kBlurPixels * kBlurPixels)),
                                   std::exp(-2 / (kBlurPixels * kBlurPixels))};
  const double all = part[0] + 2 * part[1] + 2 * part[2];
  for (const bool down : {false, true}) {
    const std::vector<float> from = image.parts;
    const auto count = static_cast<std::ptrdiff_t>(down ? image.rows : image.columns);
    const auto stride = static_cast<std::ptrdiff_t>(down ? image.columns : 1);
    for (std::size_t at = 0; at < from.size(); ++at) {
      const auto place = static_cast<std::ptrdiff_t>(down ? at / image.columns : at % image.columns);
      double sum = 0;
      for (std::ptrdiff_t i = -2; i <= 2; ++i) {
        const std::ptrdiff_t beside = std::clamp<std::ptrdiff_t>(place + i, 0, count - 1) - place;
        sum +=
            part[std::size_t(std::abs(i))] * double(from[std::size_t(std::ptrdiff_t(at) + beside * stride)]);
      }
      image.parts[at] = static_cast<float>(sum / all);
    }
  }
}

/// Parts of the rays that a couch's rail along the picture and a tube across it let through.
double let_through(double u, double v) {
  double attenuated = 0;
  if (u > 0.86 && u < 0.885) attenuated += 0.6;
  if (std::abs(v - 0.3 - 0.15 * std::sin(5 * u)) < 0.008 && u > 0.3 && u < 0.7) attenuated += 0.35;
  return std::exp(-attenuated);
}

}  // namespace

std::vector<ArrivedRays> fluoroscopy(const sim::Volume& ct, const sim::TetMesh& mesh,
                                     const sim::ProjectionGeometry& geometry,
                                     const std::vector<std::vector<sim::Vector3>>& displacement_m) {
  const std::size_t columns = geometry.columns(), rows = geometry.rows();
  std::vector<ArrivedRays> arrived(displacement_m.size(),
                                   {columns, rows, std::vector<float>(columns * rows, 0.0F)});
  for (std::size_t energy = 0; energy < kEnergiesKev.size(); ++energy) {
    const sim::CtProjector projector(ct, sim::Attenuation(kEnergiesKev[energy]));
    const sim::MeshProjector lung(projector, mesh);
    const sim::ProjectionImage still = lung.outside(geometry);
    for (std::size_t i = 0; i < arrived.size(); ++i) {
      sim::ProjectionImage image = lung.inside(geometry, displacement_m[i], sim::DensityRule::kKeepMass);
      sim::add_to(image, still);
      for (std::size_t at = 0; at < image.values.size(); ++at)
        arrived[i].parts[at] += static_cast<float>(kSpectrum[energy] * std::exp(-double(image.values[at])));
    }
  }
  for (ArrivedRays& image : arrived) {
    for (std::size_t at = 0; at < image.parts.size(); ++at) {
      image.parts[at] *= static_cast<float>(
          let_through(double(at % columns) / double(columns), double(at / columns) / double(rows)));
    }
    ArrivedRays scatter = image;
    for (int pass = 0; pass < 3; ++pass)
      smooth(scatter, static_cast<std::size_t>(kScatterSide * double(columns)));
    for (std::size_t at = 0; at < image.parts.size(); ++at)
      image.parts[at] += static_cast<float>(kScatter) * scatter.parts[at];
    blur(image);
  }
  return arrived;
}

sim::ProjectionImage counted(const ArrivedRays& arrived, double quanta, bool exposed, Chance& chance) {
  sim::ProjectionImage film{arrived.columns, arrived.rows, {}};
  for (const float part : arrived.parts) {
    const double counts =
        (exposed ? chance.poisson(quanta * double(part)) : 0) + kElectronic * chance.normal();
    film.values.push_back(static_cast<float>(-std::log(std::max(counts, 1.0) / quanta)));
  }
  return film;
}

}  // namespace kiroku::test

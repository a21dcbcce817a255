#include "media/quality/colour_difference.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "base/error.h"

namespace kiroku::media {
namespace {

constexpr double kDegrees = 180 / std::numbers::pi;

double linear(double sample) {
  return sample <= 0.04045 ? sample / 12.92 : std::pow((sample + 0.055) / 1.055, 2.4);
}

/// By 8-bit sample.
const std::array<double, 256>& linear_samples() {
  static const std::array<double, 256> table = [] {
    std::array<double, 256> made{};
    for (std::size_t i = 0; i < made.size(); ++i) made[i] = linear(static_cast<double>(i) / 255);
    return made;
  }();
  return table;
}

double lab_root(double share) {
  constexpr double kEdge = 6.0 / 29;
  return share > kEdge * kEdge * kEdge ? std::cbrt(share) : share / (3 * kEdge * kEdge) + 4.0 / 29;
}

double seventh(double x) {
  const double cube = x * x * x;
  return cube * cube * x;
}
const double k25To7 = 6'103'515'625.0;

/// In degrees from 0 to 360; 0 for grey.
double hue(double a, double b) {
  if (a == 0 && b == 0) return 0;
  const double angle = std::atan2(b, a) * kDegrees;
  return angle < 0 ? angle + 360 : angle;
}

double cosine(double degrees) { return std::cos(degrees / kDegrees); }
double sine(double degrees) { return std::sin(degrees / kDegrees); }

}  // namespace

Lab lab_of(std::uint8_t red, std::uint8_t green, std::uint8_t blue) {
  const auto& table = linear_samples();
  const double r = table[red], g = table[green], b = table[blue];
  // IEC 61966-2-1; the white is what these rows add up to.
  const double x = (0.4124 * r + 0.3576 * g + 0.1805 * b) / 0.9505;
  const double y = 0.2126 * r + 0.7152 * g + 0.0722 * b;
  const double z = (0.0193 * r + 0.1192 * g + 0.9505 * b) / 1.0890;
  const double fx = lab_root(x), fy = lab_root(y), fz = lab_root(z);
  return {116 * fy - 16, 500 * (fx - fy), 200 * (fy - fz)};
}

double ciede2000(const Lab& one, const Lab& other) {
  const double mean_chroma = (std::hypot(one.a, one.b) + std::hypot(other.a, other.b)) / 2;
  const double g = 0.5 * (1 - std::sqrt(seventh(mean_chroma) / (seventh(mean_chroma) + k25To7)));
  const double a1 = (1 + g) * one.a, a2 = (1 + g) * other.a;
  const double c1 = std::hypot(a1, one.b), c2 = std::hypot(a2, other.b);
  const double h1 = hue(a1, one.b), h2 = hue(a2, other.b);

  const bool grey = c1 * c2 == 0;
  double turn = grey ? 0 : h2 - h1;
  if (turn > 180) turn -= 360;
  if (turn < -180) turn += 360;
  const double dl = other.lightness - one.lightness, dc = c2 - c1;
  const double dh = 2 * std::sqrt(c1 * c2) * sine(turn / 2);

  const double l = (one.lightness + other.lightness) / 2, c = (c1 + c2) / 2;
  double h = h1 + h2;
  if (!grey) {
    if (std::abs(h1 - h2) > 180) h += h < 360 ? 360 : -360;
    h /= 2;
  }
  const double t =
      1 - 0.17 * cosine(h - 30) + 0.24 * cosine(2 * h) + 0.32 * cosine(3 * h + 6) - 0.20 * cosine(4 * h - 63);
  const double turning = 30 * std::exp(-((h - 275) / 25) * ((h - 275) / 25));
  const double rc = 2 * std::sqrt(seventh(c) / (seventh(c) + k25To7));
  const double from_middle = (l - 50) * (l - 50);
  const double sl = 1 + 0.015 * from_middle / std::sqrt(20 + from_middle);
  const double sc = 1 + 0.045 * c, sh = 1 + 0.015 * c * t;
  const double rt = -sine(2 * turning) * rc;
  const double el = dl / sl, ec = dc / sc, eh = dh / sh;
  return std::sqrt(std::max(0.0, el * el + ec * ec + eh * eh + rt * ec * eh));
}

void ColourError::add(const PictureView& one, const PictureView& other) {
  require_valid(one);
  require_valid(other);
  if (one.channels != 3 || other.channels != 3 || one.width != other.width || one.height != other.height)
    throw Error("the colours of two pictures of other sizes or without colours cannot be compared");
  for (std::size_t i = 0; i < one.samples.size(); i += 3) {
    const std::uint8_t* const p = one.samples.data() + i;
    const std::uint8_t* const q = other.samples.data() + i;
    const double apart =
        std::equal(p, p + 3, q) ? 0 : ciede2000(lab_of(p[0], p[1], p[2]), lab_of(q[0], q[1], q[2]));
    sum_ += apart;
    ++counts_[std::min(kSteps - 1, static_cast<std::size_t>(std::ceil(apart * 100)))];
  }
  pixels_ += one.samples.size() / 3;
}

double ColourError::mean() const { return pixels_ == 0 ? 0 : sum_ / static_cast<double>(pixels_); }

double ColourError::quantile(double share) const {
  const double wanted = share * static_cast<double>(pixels_);
  std::uint64_t passed = 0;
  for (std::size_t i = 0; i < counts_.size(); ++i) {
    passed += counts_[i];
    if (static_cast<double>(passed) >= wanted) return static_cast<double>(i) / 100;
  }
  return static_cast<double>(kSteps - 1) / 100;
}

}  // namespace kiroku::media

#include "trainer/psychophysics/vibration_sense.h"

#include <algorithm>
#include <cmath>
#include <complex>
#include <limits>
#include <unsupported/Eigen/FFT>
#include <vector>

#include "base/error.h"

namespace kiroku::trainer {
namespace {

/// P: where it feels best, and what it loses for each octave below and above.
constexpr double kBestHz = 220, kBelowDb = 12, kAboveDb = 9;
/// Where P and NP I have the same threshold.
constexpr double kMeetHz = 40;

double metres(double db_re_micrometre) { return 1e-6 * std::pow(10, db_re_micrometre / 20); }

/// The largest mean square of a second of it, with rest before and after.
double strongest_second(std::span<const double> values, double period_s) {
  const auto window = std::max<std::size_t>(static_cast<std::size_t>(std::lround(1 / period_s)), 1);
  double sum = 0, largest = 0;
  for (std::size_t i = 0; i < values.size(); ++i) {
    sum += values[i] * values[i];
    if (i >= window) sum -= values[i - window] * values[i - window];
    largest = std::max(largest, sum);
  }
  return largest / static_cast<double>(window);
}

}  // namespace

double felt_amplitude_m(const TouchCurves& curves, TouchChannel channel, double hz) {
  if (!std::isfinite(curves.pacinian_best_db) || !(curves.np1_slope_db >= 0) ||
      !std::isfinite(curves.np1_slope_db) || !(curves.np3_to_hz > 0 && curves.np3_to_hz < kMeetHz))
    throw UsageError("curves of touch need a level, a slope that is not negative, and NP III below 40 Hz");
  const auto pacinian_db = [&](double at_hz) {
    const double octaves = std::log2(at_hz / kBestHz);
    return curves.pacinian_best_db + (octaves < 0 ? -kBelowDb : kAboveDb) * octaves;
  };
  const auto np1_db = [&](double at_hz) {
    return pacinian_db(kMeetHz) + curves.np1_slope_db * std::max(0.0, std::log2(kMeetHz / at_hz));
  };
  if (channel == TouchChannel::kNp3) return metres(np1_db(curves.np3_to_hz));
  if (!(hz > 0)) return std::numeric_limits<double>::infinity();
  return metres(channel == TouchChannel::kNp1 ? np1_db(hz) : pacinian_db(hz));
}

std::array<double, kTouchChannels.size()> felt_by_channels(const TouchCurves& curves,
                                                           std::span<const double> skin_m, double period_s) {
  std::array<double, kTouchChannels.size()> felt{};
  if (skin_m.empty()) return felt;
  // Twice as long, so that the end of a filter does not meet its beginning.
  std::size_t length = 2;
  while (length < 2 * skin_m.size()) length *= 2;
  std::vector<double> padded(length);
  std::ranges::copy(skin_m, padded.begin());
  Eigen::FFT<double> transform;
  std::vector<std::complex<double>> spectrum, weighted;
  transform.fwd(spectrum, padded);
  std::vector<double> answer;
  for (std::size_t c = 0; c < kTouchChannels.size(); ++c) {
    weighted = spectrum;
    for (std::size_t i = 0; i < length; ++i) {
      const double hz =
          static_cast<double>(std::min(i, length - i)) / (static_cast<double>(length) * period_s);
      weighted[i] /= felt_amplitude_m(curves, kTouchChannels[c], hz);
    }
    transform.inv(answer, weighted);
    const std::span<const double> then = std::span(answer).first(skin_m.size());
    if (kTouchChannels[c] == TouchChannel::kPacinian) {
      felt[c] = std::sqrt(2 * strongest_second(then, period_s));
    } else {
      for (const double value : then) felt[c] = std::max(felt[c], std::abs(value));
    }
  }
  return felt;
}

double felt_level_db(const TouchCurves& curves, std::span<const double> skin_m, double period_s) {
  return 20 * std::log10(std::ranges::max(felt_by_channels(curves, skin_m, period_s)));
}

double fingerpad_stiffness_n_m(double force_n) {
  constexpr double kOffsetNewtonsMetre = 190, kGrowthPerMetre = 2100;
  return kOffsetNewtonsMetre + kGrowthPerMetre * std::abs(force_n);
}

}  // namespace kiroku::trainer

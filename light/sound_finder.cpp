#include "light/sound_finder.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <complex>
#include <cstdlib>
#include <numbers>
#include <unsupported/Eigen/FFT>

#include <Eigen/Core>

namespace kiroku::light {
namespace {

using Complex = std::complex<float>;
using Matrix = Eigen::MatrixXcf;
using Vector = Eigen::VectorXcf;
using Fft = Eigen::FFT<float>;  // kissfft

constexpr int kSlot = SoundFinder::kSlotSamples;
// Codes are looked for at each of these steps; between two of them the delays below have room for the code.
constexpr int kStep = SoundFinder::kRate / 1'000 * 12;
constexpr int kStepsOfSlot = kSlot / kStep;
static_assert(kSlot % kStep == 0);
// Delays of 0.25 ms, the carriers' breadth of 4 kHz: a step, 2 ms before it for what lies between two delays,
// and 4 ms behind it for the first echoes. Later ones would bring more noise than sound.
constexpr int kFirstDelay = -8, kDelays = 8 + 48 + 16;
// Short stretches that are made even: as long as a syllable's beginning, half of one over half of the next.
constexpr int kShort = 512, kHalf = kShort / 2;
constexpr int kHzOfFirst = 3'000 - 50, kHzOfLast = 7'000 + 50;  // with what the fading of slots adds
// Slots so near to each other are compared in the first look, in which a loudspeaker's crystal may be off.
constexpr int kNear = 12;
// Two sound cards differ by up to 100 ppm. Over a code, a ninth part of this step turns the highest carrier
// by a seventh of a turn at most.
constexpr int kDrifts = 15;
constexpr double kDriftStep = 18e-6;
constexpr int kMostStarts = SoundFinder::kPeriodSamples * 2 / kStep;  // looked at in one stretch

enum class Half { kBoth, kLower, kUpper };

}  // namespace

struct SoundFinder::Tables {
  Fft fft;
  std::array<float, kShort> window{};                         // a sine: its square over halves adds up to 1
  std::vector<std::array<Complex, kCarriers>> turned_back;    // by slot
  std::array<std::array<Complex, kCarriers>, kDrifts> drift;  // of one slot to the next, by crystal

  Tables() {
    fft.SetFlag(Fft::HalfSpectrum);
    for (int i = 0; i < kShort; ++i)
      window[static_cast<std::size_t>(i)] =
          static_cast<float>(std::sin(std::numbers::pi * (i + 0.5) / kShort));
    for (int slot = 0; slot < kSlots; ++slot) {
      auto& back = turned_back.emplace_back();
      const auto turns = carrier_turns(slot);
      for (std::size_t i = 0; i < kCarriers; ++i)
        back[i] = std::polar(1.0F, static_cast<float>(-std::numbers::pi / 2 * turns[i]));
    }
    for (int number = 0; number < kDrifts; ++number) {
      // A loudspeaker that is fast by this share plays each slot so much earlier.
      const double early_turns = (number - kDrifts / 2) * kDriftStep;
      for (int i = 0; i < kCarriers; ++i) {
        drift[static_cast<std::size_t>(number)][static_cast<std::size_t>(i)] =
            std::polar(1.0F, static_cast<float>(-2 * std::numbers::pi * (kFirstCarrier + i) * early_turns));
      }
    }
  }
};

/// The carriers of a stretch at every step, and what is made of them.
struct SoundFinder::Spectra {
  Tables& tables;
  std::vector<std::array<Complex, kCarriers>> at;

  Spectra(Tables& tables_of_all, std::span<const std::int16_t> samples) : tables(tables_of_all) {
    const std::vector<float> even = made_even(samples);
    std::vector<float> slot(kSlot);
    std::vector<Complex> bins;
    for (std::size_t from = 0; from + kSlot <= even.size(); from += kStep) {
      std::copy_n(even.begin() + static_cast<std::ptrdiff_t>(from), kSlot, slot.begin());
      tables.fft.fwd(bins, slot);
      std::copy_n(bins.begin() + kFirstCarrier, kCarriers, at.emplace_back().begin());
    }
  }

  [[nodiscard]] int starts() const {
    return std::max(0, static_cast<int>(at.size()) - (kSlots - 1) * kStepsOfSlot);
  }

  /// Of a code that begins at this step: slots x delays.
  [[nodiscard]] Matrix delays(int start, Half half, int drift) const {
    Matrix all(kSlots, kDelays);
    std::vector<Complex> carriers(kCarriers), sounded;
    const int from = half == Half::kUpper ? kCarriers / 2 : 0,
              to = half == Half::kLower ? kCarriers / 2 : kCarriers;
    const auto& turn = tables.drift[static_cast<std::size_t>(drift)];
    std::array<Complex, kCarriers> turned;
    turned.fill(Complex(1, 0));
    for (int slot = 0; slot < kSlots; ++slot) {
      const auto& heard = at[static_cast<std::size_t>(start + slot * kStepsOfSlot)];
      const auto& back = tables.turned_back[static_cast<std::size_t>(slot)];
      std::fill(carriers.begin(), carriers.end(), Complex(0, 0));
      for (int i = from; i < to; ++i) {
        const auto carrier = static_cast<std::size_t>(i);
        carriers[carrier] = heard[carrier] * back[carrier] * turned[carrier];
        turned[carrier] *= turn[carrier];
      }
      tables.fft.inv(sounded, carriers);
      for (int delay = 0; delay < kDelays; ++delay) {
        all(slot, delay) = sounded[static_cast<std::size_t>((kFirstDelay + delay + kCarriers) % kCarriers)];
      }
    }
    return all;
  }

 private:
  std::vector<float> made_even(std::span<const std::int16_t> samples) {
    constexpr float kLeast = 1e-3F;  // of one step of 16 bits: silence stays silent
    constexpr int kFirstBin = kHzOfFirst * kShort / kRate, kLastBin = kHzOfLast * kShort / kRate;
    std::vector<float> even(samples.size(), 0.0F);
    std::vector<float> stretch(kShort);
    std::vector<Complex> bins;
    for (std::size_t from = 0; from + kShort <= samples.size(); from += kHalf) {
      for (std::size_t i = 0; i < kShort; ++i)
        stretch[i] = static_cast<float>(samples[from + i]) * tables.window[i];
      tables.fft.fwd(bins, stretch);
      for (std::size_t i = 0; i < bins.size(); ++i) {
        const float size = std::abs(bins[i]);
        const bool is_carrier = i >= kFirstBin && i <= kLastBin + 1 && size > kLeast;
        bins[i] = is_carrier ? bins[i] / size : Complex(0, 0);
      }
      tables.fft.inv(stretch, bins);
      for (std::size_t i = 0; i < kShort; ++i) even[from + i] += stretch[i] * tables.window[i];
    }
    return even;
  }
};

namespace {

/// How much slots that are near to each other are alike, whatever their signs: more than noise is. Each pair
/// for itself, so that a crystal's drift does not matter.
double likeness(const Matrix& delays) {
  const Matrix alike = delays * delays.adjoint();
  double near = 0, own = 0;
  for (int slot = 0; slot < kSlots; ++slot) {
    own += static_cast<double>(alike(slot, slot).real());
    for (int other = std::max(0, slot - kNear); other < slot; ++other)
      near += static_cast<double>(std::norm(alike(slot, other)));
  }
  return own > 0 ? near / (own * own) : 0;
}

/// The left singular vector of the largest singular value, by power iteration; its share of all.
struct Leading {
  Vector vector;
  double share = 0;
};
Leading leading_of(const Matrix& delays) {
  constexpr int kIterations = 24;
  const Matrix alike = delays * delays.adjoint();
  const double all = static_cast<double>(alike.trace().real());
  Leading leading;
  if (!(all > 0)) return leading;
  // The slot that is most like the others is a beginning that is not at a right angle to what is looked for.
  Eigen::Index most = 0;
  alike.cwiseAbs2().rowwise().sum().maxCoeff(&most);
  leading.vector = alike.col(most).normalized();
  for (int i = 0; i < kIterations; ++i) leading.vector = (alike * leading.vector).normalized();
  leading.share = static_cast<double>((leading.vector.adjoint() * alike * leading.vector)(0, 0).real()) / all;
  return leading;
}

struct Reading {
  std::uint64_t word = 0;
  double clarity = 0;
};
Reading reading_of(const Vector& vector) {
  Complex squares(0, 0);
  for (int slot = 0; slot < kSlots; ++slot) squares += vector(slot) * vector(slot);
  const Complex back = std::polar(1.0F, -std::arg(squares) / 2);
  Reading reading;
  std::array<float, kSlots> sizes{};
  for (int slot = 0; slot < kSlots; ++slot) {
    const float bit = (vector(slot) * back).real();
    reading.word = reading.word << 1 | (bit > 0 ? 1U : 0U);
    sizes[static_cast<std::size_t>(slot)] = std::abs(bit);
  }
  std::sort(sizes.begin(), sizes.end());
  double weakest = 0, all = 0;
  constexpr int kWeakest = kSlots / 8;
  for (int i = 0; i < kSlots; ++i) {
    all += static_cast<double>(sizes[static_cast<std::size_t>(i)]) / kSlots;
    if (i < kWeakest) weakest += static_cast<double>(sizes[static_cast<std::size_t>(i)]) / kWeakest;
  }
  reading.clarity = all > 0 ? weakest / all : 0;
  return reading;
}

}  // namespace

SoundFinder::SoundFinder(std::span<const int> phases) : tables_(std::make_unique<Tables>()) {
  for (const int phase : phases.first(std::min(phases.size(), kMostPhases)))
    phases_.push_back(std::clamp(phase, 0, kPeriodSamples - 1));
}
SoundFinder::~SoundFinder() = default;

void SoundFinder::remember(int phase) {
  std::erase_if(phases_, [&](int known) {
    const int apart = std::abs(known - phase);
    return std::min(apart, kPeriodSamples - apart) <= 2 * kStep;
  });
  phases_.insert(phases_.begin(), phase);
  if (phases_.size() > kMostPhases) phases_.pop_back();
}

std::vector<HeardCode> SoundFinder::read(const SoundStretch& stretch, int starts) {
  const Spectra spectra(*tables_, stretch.samples);
  const int steps = std::min({spectra.starts(), (starts + kStep - 1) / kStep, kMostStarts});
  if (steps <= 0) return {};
  struct Start {
    int step = 0, drift = 0;
    double share = 0;
  };
  // Where a code may begin: by a first look, and where codes began before.
  std::vector<double> alike;
  for (int step = 0; step < steps; ++step)
    alike.push_back(likeness(spectra.delays(step, Half::kBoth, kDrifts / 2)));
  std::vector<int> looked_at;
  const auto look_at = [&](int step) {
    const bool is_new = std::none_of(looked_at.begin(), looked_at.end(),
                                     [&](int known) { return std::abs(known - step) < kStepsOfSlot; });
    if (is_new && step >= 0 && step < steps && alike[static_cast<std::size_t>(step)] > 0)
      looked_at.push_back(step);
  };
  for (const int phase : phases_) {
    const auto since =
        static_cast<int>(((phase - stretch.first) % kPeriodSamples + kPeriodSamples) % kPeriodSamples);
    look_at(since / kStep);
  }
  std::vector<int> by_likeness(alike.size());
  for (std::size_t i = 0; i < alike.size(); ++i) by_likeness[i] = static_cast<int>(i);
  std::stable_sort(by_likeness.begin(), by_likeness.end(), [&](int a, int b) {
    return alike[static_cast<std::size_t>(a)] > alike[static_cast<std::size_t>(b)];
  });
  const std::size_t most = looked_at.size() + kMostHeard;
  for (const int step : by_likeness) {
    if (looked_at.size() >= most) break;
    look_at(step);
  }
  // With every crystal, and a step to either side.
  std::vector<Start> found;
  for (const int middle : looked_at) {
    Start best;
    for (int step = std::max(0, middle - 1); step <= std::min(steps - 1, middle + 1); ++step) {
      for (int drift = 0; drift < kDrifts; ++drift) {
        const double share = leading_of(spectra.delays(step, Half::kBoth, drift)).share;
        if (share > best.share) best = {step, drift, share};
      }
    }
    if (best.share > 0) found.push_back(best);
  }
  std::stable_sort(found.begin(), found.end(),
                   [](const Start& a, const Start& b) { return a.share > b.share; });
  if (found.size() > kMostHeard) found.resize(kMostHeard);
  std::vector<HeardCode> heard;
  for (const Start& start : found) {
    const auto read_half = [&](Half half) {
      const Leading leading = leading_of(spectra.delays(start.step, half, start.drift));
      return leading.share > 0 ? reading_of(leading.vector) : Reading{};
    };
    const Reading both = read_half(Half::kBoth), lower = read_half(Half::kLower),
                  upper = read_half(Half::kUpper);
    HeardCode code;
    code.sample = stretch.first + std::int64_t{start.step} * kStep;
    code.sighting.words.fill(both.word);
    code.sighting.words[1] = lower.word;
    code.sighting.words[2] = upper.word;
    const int differ = std::popcount(lower.word ^ upper.word);
    code.sighting.opposite = std::max(differ, kCodeBits - differ);
    code.sighting.clarity = std::clamp(both.clarity, 0.0, 1.0);
    if (code.sighting.opposite >= kClearlyHeard)
      remember(static_cast<int>((code.sample % kPeriodSamples + kPeriodSamples) % kPeriodSamples));
    heard.push_back(code);
  }
  return heard;
}

}  // namespace kiroku::light

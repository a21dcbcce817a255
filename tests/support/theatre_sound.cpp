#include "tests/support/theatre_sound.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <complex>
#include <numbers>
#include <unsupported/Eigen/FFT>

#include <Eigen/Core>

namespace kiroku::test {
namespace {

double level_of(const Samples& sound) {
  double sum = 0;
  for (const float sample : sound) sum += static_cast<double>(sample) * static_cast<double>(sample);
  return std::sqrt(sum / static_cast<double>(std::max<std::size_t>(sound.size(), 1)));
}

Samples scaled_to(Samples sound, double level) {
  const double now = level_of(sound);
  const auto factor = static_cast<float>(now > 0 ? level / now : 0);
  for (float& sample : sound) sample *= factor;
  return sound;
}

Samples convolved(const Samples& a, const Samples& b) {
  const std::size_t size = std::bit_ceil(a.size() + b.size());
  Eigen::FFT<float> fft;
  const auto spectrum_of = [&](Samples samples) {
    samples.resize(size, 0.0F);
    std::vector<std::complex<float>> spectrum;
    fft.fwd(spectrum, samples);
    return spectrum;
  };
  std::vector<std::complex<float>> product = spectrum_of(a);
  const std::vector<std::complex<float>> other = spectrum_of(b);
  for (std::size_t i = 0; i < product.size(); ++i) product[i] *= other[i];
  Samples result;
  fft.inv(result, product);
  result.resize(a.size());
  return result;
}

/// A sinc in a window of `reach` zero crossings to either side.
double sinc_at(double x, double reach) {
  if (std::abs(x) >= reach) return 0;
  const double window = 0.5 + 0.5 * std::cos(std::numbers::pi * x / reach);
  return std::abs(x) < 1e-9 ? 1 : window * std::sin(std::numbers::pi * x) / (std::numbers::pi * x);
}

}  // namespace

Samples as_samples(std::span<const std::int16_t> sound) {
  Samples samples;
  for (const std::int16_t sample : sound) samples.push_back(static_cast<float>(sample) / 32'768.0F);
  return samples;
}

std::vector<std::int16_t> as_16_bit(const Samples& sound) {
  std::vector<std::int16_t> samples;
  for (const float sample : sound)
    samples.push_back(
        static_cast<std::int16_t>(std::lrint(std::clamp(sample * 32'768.0F, -32'768.0F, 32'767.0F))));
  return samples;
}

Samples at_level(Samples sound, double db) {
  return scaled_to(std::move(sound), kTalkLevel * std::pow(10, db / 20));
}

void add(Samples& to, const Samples& what, std::size_t at) {
  for (std::size_t i = 0; i < what.size() && at + i < to.size(); ++i) to[at + i] += what[i];
}

Samples in_a_room(const Samples& sound, double rt60, unsigned seed) {
  std::mt19937 random(seed);
  std::normal_distribution<double> normal;
  Samples echoes(static_cast<std::size_t>(rt60 * kTheatreRate));
  const double falls = std::log(1'000.0) / static_cast<double>(echoes.size());
  // The first echo comes 2 ms after the direct sound: a wall or a table 70 cm further.
  for (std::size_t i = kTheatreRate / 500; i < echoes.size(); ++i)
    echoes[i] = static_cast<float>(normal(random) * std::exp(-falls * static_cast<double>(i)));
  double power = 0;
  for (const float echo : echoes) power += static_cast<double>(echo) * static_cast<double>(echo);
  for (float& echo : echoes) echo /= static_cast<float>(std::sqrt(power));
  echoes[0] = 1;
  return convolved(sound, echoes);
}

Samples of_a_crystal(const Samples& sound, double ppm) {
  constexpr int kReach = 8;
  Samples played(sound.size());
  for (std::size_t i = 0; i < played.size(); ++i) {
    const double from = static_cast<double>(i) * (1 + ppm * 1e-6);
    const auto middle = static_cast<std::int64_t>(from);
    double sum = 0;
    for (std::int64_t at = middle - kReach; at <= middle + kReach; ++at) {
      if (at >= 0 && at < static_cast<std::int64_t>(sound.size()))
        sum += static_cast<double>(sound[static_cast<std::size_t>(at)]) *
               sinc_at(from - static_cast<double>(at), kReach);
    }
    played[i] = static_cast<float>(sum);
  }
  return played;
}

Samples thinned(const Samples& sound) {
  constexpr int kBy = 3, kReach = 16 * kBy;
  constexpr double kPass = 0.95;  // of the new half rate
  std::array<double, 2 * kReach + 1> taps{};
  double all = 0;
  for (int i = -kReach; i <= kReach; ++i) {
    double& tap = taps[static_cast<std::size_t>(i + kReach)];
    tap = sinc_at(i * kPass / kBy, kReach * kPass / kBy);
    all += tap;
  }
  Samples thin;
  for (std::size_t middle = 0; middle < sound.size(); middle += kBy) {
    double sum = 0;
    for (int i = -kReach; i <= kReach; ++i) {
      const std::int64_t at = static_cast<std::int64_t>(middle) + i;
      if (at >= 0 && at < static_cast<std::int64_t>(sound.size()))
        sum += static_cast<double>(sound[static_cast<std::size_t>(at)]) *
               taps[static_cast<std::size_t>(i + kReach)];
    }
    thin.push_back(static_cast<float>(sum / all));
  }
  return thin;
}

Samples talk(std::size_t samples, unsigned seed) {
  std::mt19937 random(seed);
  std::uniform_real_distribution<double> share(0, 1);
  std::normal_distribution<double> normal;
  Samples voice(samples, 0.0F);
  for (std::size_t at = 0; at < samples;) {
    const auto length = static_cast<std::size_t>((0.12 + 0.15 * share(random)) * kTheatreRate);
    const double kind = share(random);
    // A fifth is pause, a quarter hisses: an s has its power from 4 kHz on.
    const bool is_pause = kind<0.2, is_hiss = kind> 0.75;
    const double pitch = 100 + 60 * share(random), loud = 0.5 + share(random);
    const std::array<double, 4> formants{300 + 500 * share(random), 900 + 1'400 * share(random), 2'600,
                                         3'600};
    std::array<double, 4> before{}, before_that{};
    double phase = 0, last = 0;
    for (std::size_t i = 0; i < length && at + i < samples && !is_pause; ++i) {
      const double fade = std::sin(std::numbers::pi * static_cast<double>(i) / static_cast<double>(length));
      double value = 0;
      if (is_hiss) {
        const double noise = normal(random);
        value = 0.25 * (noise - last);  // falls towards low pitches
        last = noise;
      } else {
        phase += pitch / kTheatreRate;
        const double pulse = phase >= 1 ? 1 : 0;
        phase -= pulse;
        constexpr double kBreadthHz = 90;
        const double decay = std::exp(-std::numbers::pi * kBreadthHz / kTheatreRate);
        for (std::size_t f = 0; f < formants.size(); ++f) {
          const double turn = 2 * std::numbers::pi * formants[f] / kTheatreRate;
          const double now = pulse / static_cast<double>(f + 1) + 2 * decay * std::cos(turn) * before[f] -
                             decay * decay * before_that[f];
          before_that[f] = before[f];
          before[f] = now;
          value += now * 0.1;
        }
      }
      voice[at + i] = static_cast<float>(value * fade * loud);
    }
    at += length;
  }
  return scaled_to(std::move(voice), kTalkLevel);
}

Samples beeps(std::size_t samples) {
  constexpr double kEverySecond = 0.8, kLength = 0.12, kPitch = 880;
  Samples sound(samples, 0.0F);
  for (std::size_t i = 0; i < samples; ++i) {
    const double time = std::fmod(static_cast<double>(i) / kTheatreRate, kEverySecond);
    if (time >= kLength) continue;
    for (int harmonic = 1; harmonic <= 8; ++harmonic)
      sound[i] += static_cast<float>(std::sin(2 * std::numbers::pi * kPitch * harmonic * time) / harmonic);
  }
  return scaled_to(std::move(sound), kTalkLevel);
}

Samples ventilation(std::size_t samples, unsigned seed) {
  std::mt19937 random(seed);
  std::normal_distribution<float> normal;
  constexpr std::array<float, 6> kKept{0.99886F, 0.99332F, 0.96900F, 0.86650F, 0.55000F, -0.7616F};
  constexpr std::array<float, 6> kTaken{0.0555179F, 0.0750759F, 0.1538520F,
                                        0.3104856F, 0.5329522F, -0.0168980F};
  std::array<float, 6> state{};
  float late = 0;
  Samples noise;
  for (std::size_t i = 0; i < samples; ++i) {
    const float white = normal(random);
    float sum = late + white * 0.5362F;
    for (std::size_t k = 0; k < state.size(); ++k) {
      state[k] = kKept[k] * state[k] + white * kTaken[k];
      sum += state[k];
    }
    late = white * 0.115926F;
    noise.push_back(sum);
  }
  return scaled_to(std::move(noise), kTalkLevel);
}

}  // namespace kiroku::test

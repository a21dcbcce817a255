// Sound of an operating theatre, made up: an echoing room, talk, a monitor's beeps, a noise that falls
// towards high pitches, and a sound card whose crystal is off. Levels are root mean squares beside talk, in
// dB. Functions are pure.
#pragma once

#include <cstddef>
#include <cstdint>
#include <random>
#include <span>
#include <vector>

namespace kiroku::test {

using Samples = std::vector<float>;

inline constexpr int kTheatreRate = 48'000;
/// Root mean square of talk while somebody talks, as a share of full scale: -26 dB.
inline constexpr double kTalkLevel = 0.05;

Samples as_samples(std::span<const std::int16_t> sound);
std::vector<std::int16_t> as_16_bit(const Samples& sound);
/// Brought to a level beside talk.
Samples at_level(Samples sound, double db);
/// Adds `what` from sample `at` on, as far as there is room.
void add(Samples& to, const Samples& what, std::size_t at = 0);

/// As a microphone hears it that stands where echoes are as loud as the direct sound: they fall by 60 dB in
/// `rt60` seconds (M. Schroeder's model: noise that decays exponentially).
Samples in_a_room(const Samples& sound, double rt60, unsigned seed);
/// As a card plays it whose crystal is fast by so many parts of a million.
Samples of_a_crystal(const Samples& sound, double ppm);
/// Every third sample, after a low pass: of 48,000 a second 16,000.
Samples thinned(const Samples& sound);

/// Syllables of a voice, voiced and unvoiced, with pauses.
Samples talk(std::size_t samples, unsigned seed);
/// A pulse oximeter's beep each 0.8 s, with harmonics up to 7 kHz.
Samples beeps(std::size_t samples);
/// Ventilation: noise whose power falls by 3 dB an octave (P. Kellet's filter).
Samples ventilation(std::size_t samples, unsigned seed);

}  // namespace kiroku::test

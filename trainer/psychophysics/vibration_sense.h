// How strongly a fingertip feels a vibration of its skin. Pure functions, thread-safe.
//
// Sources, each for what its abstract says. Skin without hair has four channels of touch, which together feel
// 0.4 Hz to more than 500 Hz (Bolanowski, Gescheider, Verrillo and Checkosky, "Four channels mediate the
// mechanical aspects of touch", Journal of the Acoustical Society of America 84, 1988). Three of them, P, NP
// I and NP III, account for a fingertip's thresholds (Gescheider, Bolanowski, Pope and Verrillo, "A
// four-channel analysis of the tactile sensitivity of the fingertip", Somatosensory and Motor Research 19,
// 2002). P and NP I have similar thresholds at 40 Hz (Güçlü and Bolanowski, "Vibrotactile thresholds of the
// Non-Pacinian I channel: I", Somatosensory and Motor Research 22, 2005). P alone adds up over time
// (Gescheider, Bolanowski and Verrillo, "Some characteristics of tactile channels", Behavioural Brain
// Research 148, 2004). Thresholds of P fall by 12 dB an octave and rise by 9 dB an octave above some 220 Hz
// (Verrillo, "Vibrotactile thresholds for hairy skin", Journal of Experimental Psychology 72, 1966, which
// says that skin without hair has the same).
#pragma once

#include <array>
#include <cstdint>
#include <span>

namespace kiroku::trainer {

enum class TouchChannel : std::uint8_t { kNp3, kNp1, kPacinian };
inline constexpr std::array<TouchChannel, 3> kTouchChannels{TouchChannel::kNp3, TouchChannel::kNp1,
                                                            TouchChannel::kPacinian};

/// What the sources above leave open: they are parameters, and what is concluded is to hold for all of their
/// values within the stated ranges (touch_curves_to_try()).
struct TouchCurves {
  /// The amplitude that P just feels where it feels best, dB re 1 µm. It depends on the area that vibrates
  /// and on the person, by tens of dB.
  double pacinian_best_db = -20;
  /// By how much NP I feels less for each octave below 40 Hz, dB.
  double np1_slope_db = 5;
  /// Below it NP III feels first; there the two have the same threshold. Hz, less than 40.
  double np3_to_hz = 3;
};

/// The amplitude (mean to peak) of a sinusoid that is just felt by the channel, m. P: as the sources say,
/// best at 220 Hz; infinite for 0 Hz. NP I: that of P at 40 Hz, the same above, more by np1_slope_db an
/// octave below. NP III: that of NP I at np3_to_hz, at all frequencies. kiroku::UsageError for curves without
/// sense.
double felt_amplitude_m(const TouchCurves& curves, TouchChannel channel, double hz);

/// How strongly each channel answers to a movement of the skin, 1 being just felt: the movement is weighted
/// by 1 / felt_amplitude_m() at each of its frequencies; of NP III and NP I counts the largest value, of P
/// the root of twice the mean square in the strongest second, so that a long sinusoid that is just felt gives
/// 1 in each. `period_s` apart; what was before and comes after is rest.
std::array<double, kTouchChannels.size()> felt_by_channels(const TouchCurves& curves,
                                                           std::span<const double> skin_m, double period_s);

/// The strongest of them, in dB above what is just felt. Minus infinity where nothing moves.
double felt_level_db(const TouchCurves& curves, std::span<const double> skin_m, double period_s);

/// How hard a fingertip's pad is under a force that presses it, N/m: b + m F, as its force grows
/// exponentially with its indentation (Pawluk and Howe, "Dynamic contact of the human fingerpad against a
/// flat surface", Journal of Biomechanical Engineering 121, 1999). b = 190 N/m and m = 2100 /m are ours. If
/// both are wrong by a factor, every level is off by the same dB, as it is by TouchCurves::pacinian_best_db.
double fingerpad_stiffness_n_m(double force_n);

}  // namespace kiroku::trainer

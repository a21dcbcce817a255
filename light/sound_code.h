// The code of a display as faint sound (docs/reference/light.md, "The sound"): what a loudspeaker in the room
// plays beside the picture. It carries the 49 bits of light_code(), and its error correction is the same: the
// ledger is the list of all codes there can be, and the nearest one is what was sent.
//
// Multi-carrier spread spectrum: N. Yee, J.-P. Linnartz, G. Fettweis, "Multi-Carrier CDMA in Indoor Wireless
// Radio Networks", PIMRC 1993. Each bit lies on all carriers, with a sign for all of them; which phase a
// carrier has in a slot is known to everybody.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "light/light_code.h"

namespace kiroku::light {

/// One code begins with each second of Unix time that can be divided by this, and lasts nearly until the
/// next.
inline constexpr std::int64_t kSoundPeriodSeconds = 5;
/// Bit i, the highest first, is sent in slot i.
inline constexpr int kSlots = kCodeBits;
/// A slot is 96 ms: a whole number of samples at 16 and at 48 kHz. Carriers are whole multiples of 1/96 ms:
/// from 3,000 to 6,990 Hz, where a theatre is quieter than below, and which a recording with 16,000 samples a
/// second still has. 384 of them take 768 bits a slot, three times SHA-256.
inline constexpr int kSlotMilliseconds = 96, kFirstCarrier = 288, kCarriers = 384;

/// Quarter turns of each carrier in slot `slot`: two bits each, the first ones highest, of SHA-256 over
/// "kiroku-light-sound/1\n<slot>\n<part>\n" for the parts 0, 1 and 2 one after the other.
std::array<std::uint8_t, kCarriers> carrier_turns(int slot);

/// Makes the sound of codes. Thread-safe once made.
class SoundCoder {
 public:
  static constexpr int kRate = 48'000;  // samples a second, one channel
  static constexpr int kSlotSamples = kRate / 1'000 * kSlotMilliseconds;
  static constexpr int kCodeSamples = kSlots * kSlotSamples;  // 4.704 s
  static constexpr int kPeriodSamples = kRate * static_cast<int>(kSoundPeriodSeconds);
  /// The sound's root mean square, as a share of full scale: -20 dB. Its peaks stay below full scale.
  static constexpr double kLevel = 0.1;

  SoundCoder();
  /// kCodeSamples of 16 bits.
  [[nodiscard]] std::vector<std::int16_t> sound_of(std::uint64_t code) const;

 private:
  std::vector<float> slots_;  // kSlots x kSlotSamples, each as a bit 1 sounds
};

}  // namespace kiroku::light

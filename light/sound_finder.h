// Finds and reads codes in sound (sound_code.h). What it is given may come from an attacker: time and memory
// are bounded by the sound's length. It runs where foreign media are decoded (media/box/), so its only
// library is Eigen, which is headers. Not thread-safe.
//
// How it reads. Noise that is louder at one pitch or moment is made even (each short stretch keeps its phases
// alone: the phase transform of C. Knapp and G. Carter, "The generalized correlation method for estimation of
// time delay", 1976). What a slot's carriers are turned by is taken back, which leaves the bit's sign times
// the room's answer to a short sound. That is the same in all 49 slots: the matrix of slots and delays has
// one large singular value, and its vector's signs are the bits. So the room's echoes add up, and neither the
// room nor the loudspeaker need be known. All bits turned over are another reading of the same vector, as a
// code of light that hangs upside down.
#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "light/picture_finder.h"
#include "light/sound_code.h"

namespace kiroku::light {

/// What may be a code in sound.
struct HeardCode {
  std::int64_t sample = 0;  // with which it begins, counted as the stretch's samples are
  /// words: of all carriers, of the lower half and of the upper half; the others are the first again.
  /// opposite: bits in which the two halves say the same. clarity: as of pictures.
  Sighting sighting;
};

/// A stretch of sound, samples of 16 bits, one channel, kRate a second.
struct SoundStretch {
  std::int64_t first = 0;  // number of the first sample in the stream
  std::span<const std::int16_t> samples;
};

class SoundFinder {
 public:
  static constexpr int kRate = 16'000;
  static constexpr int kSlotSamples = kRate / 1'000 * kSlotMilliseconds;
  static constexpr int kCodeSamples = kSlots * kSlotSamples;
  static constexpr int kPeriodSamples = kRate * static_cast<int>(kSoundPeriodSeconds);
  /// Of one stretch at most so many are told.
  static constexpr std::size_t kMostHeard = 3;
  static constexpr std::size_t kMostPhases = 4;
  /// A code of which the halves say the same in so many bits is one.
  static constexpr int kClearlyHeard = 40;

  /// Goes on with phases that were found before, of which at most kMostPhases are used.
  explicit SoundFinder(std::span<const int> phases = {});
  ~SoundFinder();
  SoundFinder(const SoundFinder&) = delete;
  SoundFinder& operator=(const SoundFinder&) = delete;

  /// What is most like a code of those that begin in the first `starts` samples and end in the stretch, the
  /// likeliest first. Noise gives some, too: whether it is a code is for the ledger to say. None in silence,
  /// and where the stretch is shorter than a code.
  std::vector<HeardCode> read(const SoundStretch& stretch, int starts);
  /// Where in a period codes were clearly heard, the newest first: a loudspeaker keeps its delay.
  [[nodiscard]] const std::vector<int>& phases() const { return phases_; }

 private:
  struct Tables;
  struct Spectra;
  void remember(int phase);

  std::unique_ptr<Tables> tables_;
  std::vector<int> phases_;
};

}  // namespace kiroku::light

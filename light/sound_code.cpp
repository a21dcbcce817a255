#include "light/sound_code.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <string>

#include "crypto/hash.h"

namespace kiroku::light {
namespace {

constexpr int kPart = 128;  // carriers whose turns one SHA-256 gives
// Slots fade in and out, so that no click is heard where one follows another.
constexpr int kFadeSamples = SoundCoder::kRate / 1'000 * 4;

}  // namespace

std::array<std::uint8_t, kCarriers> carrier_turns(int slot) {
  static_assert(kCarriers % kPart == 0);
  std::array<std::uint8_t, kCarriers> turns{};
  for (int part = 0; part < kCarriers / kPart; ++part) {
    const std::string text =
        "kiroku-light-sound/1\n" + std::to_string(slot) + "\n" + std::to_string(part) + "\n";
    const crypto::Sha256Digest digest = crypto::sha256(bytes_of(text));
    for (int i = 0; i < kPart; ++i) {
      const auto byte = static_cast<unsigned>(digest[static_cast<std::size_t>(i / 4)]);
      turns[static_cast<std::size_t>(part * kPart + i)] =
          static_cast<std::uint8_t>(byte >> (6 - 2 * (i % 4)) & 3U);
    }
  }
  return turns;
}

SoundCoder::SoundCoder() : slots_(static_cast<std::size_t>(kCodeSamples)) {
  // One turn of the slowest wave that fits a slot; every carrier's phases are among these.
  std::vector<float> turn(kSlotSamples);
  for (int i = 0; i < kSlotSamples; ++i)
    turn[static_cast<std::size_t>(i)] = static_cast<float>(std::cos(2 * std::numbers::pi * i / kSlotSamples));
  const auto amplitude = static_cast<float>(kLevel * std::sqrt(2.0 / kCarriers));
  for (int slot = 0; slot < kSlots; ++slot) {
    float* const wave = slots_.data() + static_cast<std::ptrdiff_t>(slot) * kSlotSamples;
    const auto turns = carrier_turns(slot);
    for (int carrier = 0; carrier < kCarriers; ++carrier) {
      int phase = turns[static_cast<std::size_t>(carrier)] * (kSlotSamples / 4);
      for (int i = 0; i < kSlotSamples; ++i) {
        wave[i] += amplitude * turn[static_cast<std::size_t>(phase)];
        phase += kFirstCarrier + carrier;
        if (phase >= kSlotSamples) phase -= kSlotSamples;
      }
    }
    for (int i = 0; i < kFadeSamples; ++i) {
      const double sine = std::sin(std::numbers::pi / 2 * (i + 0.5) / kFadeSamples);
      wave[i] *= static_cast<float>(sine * sine);
      wave[kSlotSamples - 1 - i] *= static_cast<float>(sine * sine);
    }
  }
}

std::vector<std::int16_t> SoundCoder::sound_of(std::uint64_t code) const {
  std::vector<std::int16_t> sound(slots_.size());
  for (int i = 0; i < kCodeSamples; ++i) {
    const bool is_one = (code >> (kSlots - 1 - i / kSlotSamples) & 1U) != 0;
    const float sample = slots_[static_cast<std::size_t>(i)] * (is_one ? 32'767.0F : -32'767.0F);
    sound[static_cast<std::size_t>(i)] =
        static_cast<std::int16_t>(std::lrint(std::clamp(sample, -32'767.0F, 32'767.0F)));
  }
  return sound;
}

}  // namespace kiroku::light

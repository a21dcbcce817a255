// When a sound card took its samples, by the machine's clock. A card counts samples by a crystal of its own,
// which is right to some 100 ppm: 3.6 s in ten hours. So its count is compared with the machine's clock again
// and again, and the rate at which it really takes samples is followed. Pure arithmetic; used by one thread.
//
// A delay-locked loop of second order: F. Adriaensen, "Using a DLL to filter time", Linux Audio Conference
// 2005. What a driver says of its count jumps by what it transfers at once (1 to 20 ms), so that no single
// reading is believed.
#pragma once

#include <cstdint>
#include <optional>

namespace kiroku::recorder {

class SoundClock {
 public:
  /// A reading further than this from what the ones before let expect is not of the same run of samples.
  static constexpr std::int64_t kLargestErrorNs = 50'000'000;
  /// So many such readings in a row begin a new run: samples were lost, and the driver did not say so.
  static constexpr int kContradictions = 5;
  /// No crystal is wrong by as much.
  static constexpr double kLargestRateError = 0.01;

  /// `rate`: samples a second, as the card states them.
  explicit SoundClock(int rate);

  /// The card had taken `samples` at `time_ns`. Both counts only grow.
  void observe(std::int64_t samples, std::int64_t time_ns);
  /// When the card took sample number `sample`; only after observe().
  [[nodiscard]] std::int64_t time_of(std::int64_t sample) const;
  [[nodiscard]] bool has_begun() const { return last_.has_value(); }
  /// Samples that the card takes in a second of the machine's clock.
  [[nodiscard]] double rate() const { return 1e9 / ns_a_sample_; }

 private:
  struct Place {
    std::int64_t sample = 0;
    double time_ns = 0;
  };

  double nominal_ns_;  // a sample
  double ns_a_sample_;
  std::optional<Place> last_;  // on the line that the readings are compared with
  int contradictions_ = 0;     // in a row
};

}  // namespace kiroku::recorder

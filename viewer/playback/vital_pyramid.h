// Vital signs of a whole case at any zoom: least, greatest and last value of every stretch of time, at six
// widths. Memory: 54 bytes for each quarter of a second in which a quantity was measured. An object belongs
// to one thread.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <tuple>
#include <vector>

#include "base/bytes.h"
#include "media/vital_sample.h"

namespace kiroku::playback {

/// What was measured within [start_ns, end_ns).
struct VitalBin {
  std::int64_t start_ns = 0, end_ns = 0;
  double min = 0, max = 0;
  double last = 0;
  std::int64_t last_ns = 0;
  /// Whether any of it is questionable: not the device's, or the recorder's, good value.
  bool is_questionable = false;
  bool operator==(const VitalBin&) const = default;
};

/// One quantity of one device. Values that a device reported, good or questionable; what it reported as
/// missing is no value, nor is what is invalid.
struct VitalSeries {
  std::string code, unit, source;  // as in media::VitalSample
  bool is_wave = false;
  /// The usual distance of two values; 0 while there is but one. Where bins are farther apart, nothing was
  /// measured.
  std::int64_t every_ns = 0;
  std::vector<VitalBin> bins;  // in order; none where there was no value
};

class VitalPyramid {
 public:
  /// Narrowest bins kept of a whole case.
  static constexpr std::int64_t kBaseNs = 250'000'000;
  /// And of a short stretch: 1/512 s.
  static constexpr std::int64_t kFinestNs = kBaseNs / 128;
  /// More quantities than any theatre has; what comes beyond is left out.
  static constexpr std::size_t kMostSeries = 512;

  /// Width of bins for a span to be shown in at most `bins` of them, those at its ends aside: kFinestNs times
  /// a power of two. Bins begin at whole multiples of their width, so that they stay what they are when the
  /// span moves.
  static std::int64_t width_for(std::int64_t span_ns, std::size_t bins);

  /// Keeps bins of `finest_ns`, a width of width_for(), and wider ones.
  explicit VitalPyramid(std::int64_t finest_ns = kBaseNs) : finest_ns_(finest_ns) {}

  /// Samples in order of their time, or nearly so. `only` (half open) narrows what is taken of them.
  void add(const media::VitalSample& sample, std::int64_t from_ns = INT64_MIN,
           std::int64_t to_ns = INT64_MAX);

  /// Everything in [from_ns, to_ns), in bins of `width_ns`, a width of width_for() not below the finest. Bins
  /// at both ends are whole: they may reach beyond.
  [[nodiscard]] std::vector<VitalSeries> view(std::int64_t from_ns, std::int64_t to_ns,
                                              std::int64_t width_ns) const;
  /// The last bin of each quantity whose last value is not after `time_ns`; others are left out.
  [[nodiscard]] std::vector<VitalSeries> before(std::int64_t time_ns) const;
  /// The longest waveform block added.
  [[nodiscard]] std::int64_t longest_block_ns() const { return longest_block_ns_; }

  /// Everything, for a cache; read back by restore(), which gives nothing for what is no such thing.
  [[nodiscard]] Bytes save() const;
  static std::optional<VitalPyramid> restore(ByteView saved);

 private:
  static constexpr std::size_t kLevels = 6;
  static constexpr std::int64_t kFactor = 4;
  static constexpr std::size_t kJudgedDistances = 15;

  /// A bin; where it lies follows from last_ns and the level's width.
  struct Kept {
    std::int64_t last_ns = 0;
    double min = 0, max = 0, last = 0;
    std::uint64_t questionable = 0;  // 0 or 1: a list of these is kept as it lies in memory
  };
  struct Series {
    VitalSeries described;  // without bins
    std::array<std::vector<Kept>, kLevels> levels;
    std::int64_t newest_ns = INT64_MIN;
    std::vector<std::int64_t> distances;  // the first ones
  };

  Series* series_of(const media::VitalSample& sample);
  static void merge(std::vector<Kept>& level, std::int64_t width_ns, const Kept& more);

  std::int64_t finest_ns_;
  std::vector<Series> series_;
  std::map<std::tuple<std::string, std::string, std::string, bool>, std::size_t> by_name_;
  std::int64_t longest_block_ns_ = 0;
};

}  // namespace kiroku::playback

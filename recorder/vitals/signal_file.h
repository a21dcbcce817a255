// What readers of recorded signals (EDF, WFDB, .vital) have in common: they give lines block by block, in
// order of time, out of files that may be damaged. Objects belong to one thread.
#pragma once

#include <chrono>
#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "media/vital_line.h"
#include "recorder/vitals/patient_number.h"
#include "recorder/vitals/vital_source.h"

namespace kiroku::recorder {

/// Reads one file. Lines of a later block are not before those of an earlier one but for the little that
/// channels of different rates differ by; within a block they may stand in any order.
class SignalReader {
 public:
  virtual ~SignalReader() = default;
  /// Adds the next block's lines, which may be none; false at the end, when nothing was added. Throws
  /// kiroku::Error naming the file where it cannot be read on.
  virtual bool read_block(std::vector<VitalLine>& lines) = 0;
  /// By which the file names its patient; none: it does not.
  [[nodiscard]] virtual std::vector<PatientNumber> patient() const { return {}; }
};

/// Opens `FILE.edf` (edf_reader.h), `FILE.hea` (wfdb_reader.h) or `FILE.vital` (vital_file_reader.h).
/// Options: `speed=max`, `zone=+05:30|UTC|local`: the zone of times of day in EDF and WFDB files (local:
/// this machine's, by its rules for then).
std::unique_ptr<VitalSource> open_signal_source(const SourceAddress& address);

/// Turns the numbers of a file into values, rounded to a thousandth of a step, so that a value is no longer
/// than what is known of it.
class Scaling {
 public:
  Scaling() : Scaling(1, 0) {}
  /// value = gain * (number - zero)
  Scaling(double gain, double zero);
  [[nodiscard]] double operator()(double number) const;

 private:
  double gain_, zero_, precision_;
};

/// A run of evenly spaced values as samples. One that has no values, or only missing ones, is a sample of
/// quality missing; one whose values are more than a minute apart is a single value.
VitalSample wave_sample(std::int64_t end_ns, double rate_hz, std::vector<double> values);

/// A waveform's line holds no more values than this.
inline constexpr std::size_t kMostBlockValues = 30'000;

}  // namespace kiroku::recorder

// Vital signs as a table of comma-separated values (RFC 4180), in order of time. An object belongs to one
// thread.
//
//   time,code,value,unit,quality,source,since_start,device_time
//   600.4,MDC_ECG_HEART_RATE,72,/min,good,MON@10.0.0.9,0.4,2026-08-05T09:15:02.000000Z
//
// `time` is in seconds of the case clock, exact to the nanosecond; `since_start` is in seconds since the
// export's time 0, which is time 0 of the films that are exported with it. A waveform becomes one row a
// value, each at its own time (vital_sample.h); the first values of a waveform that began before the case
// have negative times. A sample without value has an empty field. `device_time` is when the device says that
// it measured, by its own clock; "" where it does not say, and in all rows of a waveform but the last, whose
// time it is. A name that a spreadsheet would take for a formula has an apostrophe before it. Read back by
// the recorder's CSV source, all rows but those of negative time give the same times, codes, values, units
// and qualities.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <queue>
#include <string>
#include <vector>

#include "base/utc_time.h"
#include "crypto/age_stream.h"
#include "media/vital_sample.h"

namespace kiroku::media {

class VitalsTable {
 public:
  /// Writes the line of column names. Rows leave through `sink` in large pieces.
  VitalsTable(crypto::ByteSink sink, std::int64_t zero_ns);
  /// Samples in order of their time_ns; throws kiroku::Error else.
  void add(const VitalSample& sample);
  /// Writes what was held back to bring waveforms into order. Nothing may be added after.
  void finish();

 private:
  struct Row {
    std::int64_t time_ns = 0;
    std::uint64_t sequence = 0;
    std::optional<double> value;
    std::optional<UtcTime> device_time;
    std::shared_ptr<const std::string> rest;  // code, and unit to source, as they stand around the value
    std::size_t code_bytes = 0;
  };
  struct Later {
    bool operator()(const Row& a, const Row& b) const {
      return a.time_ns != b.time_ns ? a.time_ns > b.time_ns : a.sequence > b.sequence;
    }
  };

  void write_until(std::int64_t time_ns);
  void write(const Row& row);
  void flush();

  crypto::ByteSink sink_;
  std::int64_t zero_ns_;
  std::priority_queue<Row, std::vector<Row>, Later> held_;
  std::string text_;
  std::int64_t last_ns_ = 0;
  std::uint64_t sequence_ = 0;
};

}  // namespace kiroku::media

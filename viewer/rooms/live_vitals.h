// Vital signs while they are recorded, as the server knows them: what stands on the monitors of a room now.
// Plain values.
#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <vector>

namespace kiroku::viewer {

/// Evenly spaced values of a wave, the last one at `end_ns` on the case clock; NaN where the device had none.
struct LiveWaveBlock {
  std::int64_t end_ns = 0;
  double rate_hz = 0;
  std::vector<double> values;
};

struct LiveVitalSeries {
  std::string stream, source, code;
  std::string unit;  // UCUM
  bool is_wave = false;
  /// Of the newest value, on the case clock; of a wave of its newest block.
  std::int64_t time_ns = 0;
  /// The newest number; nothing where the device reported that it has none, and of a wave.
  std::optional<double> value;
  /// Of a wave: those that end after what was asked, oldest first.
  std::vector<LiveWaveBlock> blocks;
  /// The newest number, or block, may be none of this patient's, or is a test: its device or the recorder
  /// says so.
  bool is_questionable = false;
};

/// One that its device has not ended, in its own words.
struct LiveAlarm {
  std::string stream, source, text, priority;
  std::int64_t since_ns = 0;
};

struct LiveVitalsNow {
  std::vector<LiveVitalSeries> series;  // in the order in which they came first
  std::vector<LiveAlarm> alarms;        // likewise
};

/// Of a room; nothing where this process records no vital signs there. Called from several threads; returns
/// at once. May be null.
using LiveVitals =
    std::function<std::optional<LiveVitalsNow>(const std::string& room, std::int64_t after_ns)>;

}  // namespace kiroku::viewer

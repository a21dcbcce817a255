// What the monitors of all rooms show while a case is recorded, taken from the recorder's taps by a thread of
// its own, whether somebody looks or not: an alarm that began before is still there. Thread-safe.
#pragma once

#include <condition_variable>
#include <map>
#include <memory>
#include <mutex>
#include <string>
#include <thread>
#include <tuple>
#include <vector>

#include "recorder/vitals_tap.h"
#include "viewer/rooms/live_vitals.h"

namespace kiroku::live {

class LiveMonitors {
 public:
  LiveMonitors();
  ~LiveMonitors();
  LiveMonitors(const LiveMonitors&) = delete;
  LiveMonitors& operator=(const LiveMonitors&) = delete;

  /// Before the first case. Nobody else takes from the tap.
  void add(const std::string& room, const std::string& stream, std::shared_ptr<recorder::VitalsTap> tap);
  /// As viewer::LiveVitals.
  [[nodiscard]] std::optional<viewer::LiveVitalsNow> now(const std::string& room, std::int64_t after_ns);

  /// Of a wave so much is kept.
  static constexpr std::int64_t kWaveKept_ns = 10'000'000'000;
  /// Of one stream; of a device that sends more, what it said last is shown, and the graver alarms.
  static constexpr std::size_t kMostSeries = 200, kMostAlarms = 100;

 private:
  struct Stream {
    std::string room, name;
    std::shared_ptr<recorder::VitalsTap> tap;
    std::vector<viewer::LiveVitalSeries> series;
    std::vector<viewer::LiveAlarm> alarms;
    /// What tells one alarm from another: code, what it is about.
    std::vector<std::tuple<std::string, std::string>> alarm_keys;
  };
  /// With the mutex held.
  static void drain(Stream& stream);
  static void take(Stream& stream, const media::VitalSample& sample);
  static void take(Stream& stream, const media::DeviceAlarm& alarm);
  void run();

  std::mutex mutex_;
  std::condition_variable changed_;
  std::vector<Stream> streams_;
  bool ending_ = false;
  std::thread thread_;
};

}  // namespace kiroku::live

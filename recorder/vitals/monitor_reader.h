// What one monitor says in its messages, as lines of a vitals stream: IHE PCD-01 (ORU^R01), alarms (ORU^R40,
// IHE PCD-04) and waveforms (NA arrays in ORU^R01 and ORU^W01), as monitors really send them. An object
// belongs to one thread.
//
//   numeric value   a sample; NM and SN "^97", and what says no type but is a number
//   no value        a sample of quality "missing": status X, flag NAV, nothing, -999, -99.9, 32767, 8388607,
//   "---" other value     a text waveform        a sample with rate and values; the rate from
//   MDC_ATTR_SAMP_RATE or MDC_ATTR_TIME_PD_SAMP under
//                   its sub-identifier, a CD before it, "500 Hz" in its own segment, the message before, or
//                   from begin and end in OBR; counts become values by MDC_ATTR_NU_MSMT_RES where they have
//                   no unit
//   repeated cuff   a cuff pressure (also: APERIODIC) with the time of the one before and its value is the
//   same
//                   measurement, and not a sample again
//   quality         INV, W, D: invalid; QUES, DEMO, TEST, CALIB: questionable; so is what was measured before
//                   the case began, or may have been: a queue brings an earlier patient's values. When it was
//                   says OBX-14, else OBR-7, else MSH-7. Of texts and alarms, too
//   time            of arrival; what was measured more than kLateUs before by the monitor's clock while the
//                   recording ran keeps its quality, which is the monitor's word: its device_time says when,
//                   and a notice that it is so
//
// Whatever is not understood, or was taken otherwise than it stands, becomes a notice; the same notice is
// made once a monitor. The message itself is kept beside by whoever has it (hl7_vitals.h).
#pragma once

#include <chrono>
#include <cstdint>
#include <map>
#include <optional>
#include <set>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "media/vital_line.h"
#include "recorder/vitals/assumed_zone.h"
#include "recorder/vitals/device_clock_estimate.h"
#include "recorder/vitals/hl7_message.h"
#include "recorder/vitals/hl7_observation.h"

namespace kiroku::recorder {

class MonitorReader {
 public:
  /// An observation that arrives so long after it was measured was stored in between, or is an earlier one.
  static constexpr std::int64_t kLateUs = 120'000'000;
  /// A clock that is more than kLateUs from this machine's is known from so many messages in a row on, over
  /// so long a time, whose times go on as they arrive. Those of a queue come faster than they were made.
  static constexpr std::size_t kSteadyMessages = 3;
  static constexpr std::int64_t kSteadyNs = 3'000'000'000;
  static constexpr std::int64_t kSteadyUs = 2'000'000;           // so far apart by both clocks at most
  static constexpr std::int64_t kForgottenNs = 180'000'000'000;  // after so long without one that fits
  /// An order (OBR-7) that is stated for so long goes on: when it began says nothing of what it observes now.
  static constexpr std::int64_t kOrderGoesOnNs = 60'000'000'000;
  static constexpr std::size_t kMostOrders = 64;

  /// `source` stands in the lines; times without zone count as MSH-7 states, else by `assumed_zone`.
  MonitorReader(std::string source, const AssumedZone& assumed_zone);

  /// Whether messages of this type (MSH-9, "ORU^R01") hold what is read here.
  static bool reads(const std::string& type);

  /// The lines of a message that reads(), all stamped `arrival_ns`, which must not decrease; of its segments
  /// from `begin` to `end` alone, where it is of several patients. `arrived` is this machine's time then;
  /// nothing for a message of a file, which may be of any day.
  std::vector<media::VitalLine> read(const Hl7Message& message, std::int64_t arrival_ns,
                                     std::optional<UtcTime> arrived = {}, std::size_t begin = 0,
                                     std::size_t end = SIZE_MAX);
  /// The case begins there, and not where the recording did, which goes ahead of it. What was told before may
  /// not be in it.
  void case_begins(std::int64_t begins_ns);

 private:
  struct Order;

  void notice(const std::string& name, const std::string& text);
  void read_clock(const Hl7Message& message, std::optional<UtcTime> arrived);
  /// Whether the message's time may be taken for the monitor's clock of now, and not for that of a message
  /// which waited somewhere.
  bool tells_clock(std::optional<UtcTime> arrived);
  void note_unknown_segments(std::span<const Hl7Segment> segments);
  void note_order(const Order& order);
  /// When what is observed was measured, as far as its patient goes; `stated` is its device_time().
  [[nodiscard]] std::optional<UtcTime> measured_at(const Order& order, const Observation& observation,
                                                   const std::optional<UtcTime>& stated) const;
  void note_lateness(const Observation& observation, const std::optional<UtcTime>& measured);
  void read_order(const Order& order, bool alarms);
  void read_one(const Order& order, std::size_t index);
  void read_number(const Order& order, const Observation& observation);
  void read_text(const Order& order, const Observation& observation);
  void read_wave(const Order& order, std::size_t index);
  void read_alarm(const Order& order, std::size_t index);
  [[nodiscard]] double rate_of(const Order& order, std::size_t index, std::size_t values) const;
  [[nodiscard]] std::optional<UtcTime> device_time(const Order& order, const Observation& observation) const;
  bool is_repeated(const Observation& observation, const media::VitalSample& sample);
  media::VitalQuality quality_of(const Observation& observation, const std::optional<UtcTime>& measured);
  /// By the monitor's clock, or as long as nobody knows it. By this machine's where messages state no time.
  [[nodiscard]] bool may_be_before_recording(const std::optional<UtcTime>& measured) const;

  std::string source_;
  AssumedZone assumed_zone_;
  AssumedZone zone_;  // of the message being read
  std::int64_t arrival_ns_ = 0;
  std::optional<UtcTime> message_time_;
  std::vector<media::VitalLine> lines_;  // of the message being read
  DeviceClockEstimate clock_;
  bool is_clock_known_ = false;
  /// Messages in a row that are as far from this machine's time as the first, while the clock is not known.
  struct Apart {
    std::int64_t since_ns = 0;  // arrival of the first
    UtcTime time;               // that it states
    std::size_t messages = 0;
    std::int64_t newest_ns = 0;  // arrival of the last of them
  };
  std::optional<Apart> apart_;
  bool is_live_ = false;       // the message being read has an `arrived`
  UtcTime zero_of_clock_{};    // by the estimate, once there is a message_time_
  UtcTime zero_of_machine_{};  // by this machine's clock; of a message with an `arrived`
  std::int64_t begins_ns_ = 0;
  std::optional<std::int64_t> clock_stated_ns_;
  std::map<std::pair<std::string, std::string>, std::pair<UtcTime, std::optional<double>>> measured_;
  std::map<std::pair<std::string, std::string>, double> rates_;  // by code and sub-identifier
  struct Stated {
    std::int64_t first_ns = 0, last_ns = 0;  // arrival
  };
  std::map<UtcTime, Stated> orders_;  // by OBR-7
  std::set<std::string> noticed_;
};

}  // namespace kiroku::recorder

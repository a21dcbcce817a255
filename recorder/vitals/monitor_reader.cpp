#include "recorder/vitals/monitor_reader.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdlib>
#include <limits>
#include <optional>

#include "recorder/vitals/sender_zone.h"

namespace kiroku::recorder {
namespace {

using media::VitalQuality;

constexpr std::int64_t kClockEveryNs = 60'000'000'000;
/// Bounds what one monitor can make us remember.
constexpr std::size_t kMostRemembered = 4096;
constexpr std::size_t kMostWaveValues = 30'000;
constexpr double kHighestRateHz = 1e6;
/// Attributes stand close behind what they belong to; without a bound a long message would take its square in
/// time.
constexpr std::size_t kFarthestAttribute = 64;

constexpr std::array<std::string_view, 6> kTypesRead{"ORU^R01", "ORU^R30", "ORU^R31",
                                                     "ORU^R32", "ORU^W01", "ORU^R40"};
/// Segments that hold no vital sign by their nature; they stand in the message kept beside.
constexpr std::array<std::string_view, 20> kSegmentsPassedOver{
    "MSH", "SFT", "UAC", "EVN", "PID", "PD1", "NK1", "PV1", "PV2", "ORC",
    "OBR", "OBX", "NTE", "TQ1", "TQ2", "CTD", "SPM", "PRT", "DSC", "AL1"};

std::string parent_of(const std::string& sub_id) {
  const std::size_t dot = sub_id.rfind('.');
  return dot == std::string::npos ? "" : sub_id.substr(0, dot);
}

bool is_intermittent(const Observation& observation) {
  constexpr std::array<std::string_view, 3> kNames{"NONINV", "CUFF", "NIBP"};
  return observation.method.find("APERIODIC") != std::string::npos ||
         std::ranges::any_of(kNames, [&](std::string_view name) {
           return observation.quantity.code.find(name) != std::string::npos;
         });
}

/// "---", "***", "?": what a display shows for no value.
bool is_blank(std::string_view text) { return text.find_first_not_of("-*?. ") == std::string_view::npos; }

std::string first_words(const std::string& text) {
  constexpr std::size_t kLongest = 80;
  if (text.size() <= kLongest) {
    return text;
  }
  std::size_t end = kLongest;
  while (end > 0 && (static_cast<unsigned char>(text[end]) & 0xC0U) == 0x80) {
    --end;  // not within a character
  }
  return text.substr(0, end) + "…";
}

/// The number of an NM, or of an SN without comparator and second number.
std::optional<double> number_of(const Observation& observation) {
  if (observation.type == "SN") {
    const bool plain = observation.value.component(1).empty() && observation.value.component(3).empty();
    return plain ? parse_decimal(observation.value.component(2).text()) : std::nullopt;
  }
  return parse_decimal(observation.value.text());
}

}  // namespace

/// The observations under one OBR.
struct MonitorReader::Order {
  std::optional<Hl7Time> begin, end;  // OBR-7, OBR-8
  std::vector<Observation> observations;

  /// The attribute `name` of an observation, which stands under its sub-identifier, or right behind it.
  [[nodiscard]] const Observation* attribute(std::size_t of, std::string_view name) const {
    const Observation& owner = observations[of];
    const std::size_t farthest = std::min(observations.size(), of + 1 + kFarthestAttribute);
    for (std::size_t i = of + 1; i < farthest; ++i) {
      const Observation& other = observations[i];
      const bool under = !owner.sub_id.empty() && parent_of(other.sub_id) == owner.sub_id;
      const bool behind = other.sub_id.empty() || other.sub_id == owner.sub_id;
      if (other.quantity.code == name && (under || behind)) {
        return &other;
      }
      if (!under && !other.quantity.is_attribute() && !other.quantity.is_event() && owner.sub_id.empty()) {
        return nullptr;
      }
    }
    return nullptr;
  }
};

MonitorReader::MonitorReader(std::string source, const AssumedZone& assumed_zone)
    : source_(std::move(source)), assumed_zone_(assumed_zone), zone_(assumed_zone) {}

bool MonitorReader::reads(const std::string& type) {
  return std::ranges::find(kTypesRead, type) != kTypesRead.end();
}

void MonitorReader::notice(const std::string& name, const std::string& text) {
  if (noticed_.size() >= kMostRemembered) {
    noticed_.clear();
  }
  if (noticed_.insert(name + ' ' + text).second) {
    lines_.emplace_back(media::VitalNotice{arrival_ns_, name, text, source_});
  }
}

std::vector<media::VitalLine> MonitorReader::read(const Hl7Message& message, std::int64_t arrival_ns,
                                                  std::optional<UtcTime> arrived, std::size_t begin,
                                                  std::size_t end) {
  const std::span all(message.segments());
  const std::size_t first = std::min(begin, all.size());
  const auto segments = all.subspan(first, std::min(end, all.size()) - first);
  lines_.clear();
  arrival_ns_ = arrival_ns;
  const std::optional<std::chrono::minutes> its_zone = stated_zone(message);
  zone_ = its_zone ? AssumedZone(*its_zone) : assumed_zone_;
  for (const std::string& remark : message.remarks()) {
    notice("message-form", remark);
  }
  note_unknown_segments(segments);
  read_clock(message, arrived);
  std::vector<Order> orders(1);
  for (const Hl7Segment& segment : segments) {
    if (segment.name() == "OBR") {
      Order& order = orders.emplace_back();
      order.begin = parse_hl7_time(segment.field(7).component(1).text());
      order.end = parse_hl7_time(segment.field(8).component(1).text());
    } else if (segment.name() == "OBX") {
      orders.back().observations.push_back(read_observation(segment));
    }
  }
  const bool alarms = message.type() == "ORU^R40";
  bool empty = true;
  for (const Order& order : orders) {
    empty = empty && order.observations.empty();
    note_order(order);
    read_order(order, alarms);
  }
  if (empty) {
    notice("message-empty", "a message of type " + message.type() + " holds no observation");
  }
  return std::move(lines_);
}

void MonitorReader::note_unknown_segments(std::span<const Hl7Segment> segments) {
  for (const Hl7Segment& segment : segments) {
    if (std::ranges::find(kSegmentsPassedOver, segment.name()) == kSegmentsPassedOver.end()) {
      notice("segment-unknown",
             "the segment " + std::string(segment.name()) + " is not understood; it stands in the message");
    }
  }
}

void MonitorReader::read_clock(const Hl7Message& message, std::optional<UtcTime> arrived) {
  message_time_.reset();
  is_live_ = arrived.has_value();
  if (arrived) zero_of_machine_ = *arrived - std::chrono::microseconds(arrival_ns_ / 1000);
  const std::string text = message.header().field(7).component(1).text();
  const auto time = parse_hl7_time(text);
  if (!time || !time->is_instant()) {
    notice("time-unreadable",
           text.empty() ? "the message states no time (MSH-7)"
                        : "the time '" + first_words(text) + "' of the message (MSH-7) says no instant");
    return;
  }
  if (!time->zone) {
    const auto minutes = std::chrono::duration_cast<std::chrono::minutes>(zone_.at(time->local));
    const std::string zone = format_hl7_zone(minutes);
    notice("zone-assumed",
           "times without zone were taken to be " + (minutes.count() == 0 ? "UTC" : "UTC" + zone));
  }
  message_time_ = time->utc(zone_);
  if (!tells_clock(arrived)) return;
  const auto step_us = clock_.add(arrival_ns_, *message_time_);
  zero_of_clock_ = clock_.estimate().zero;
  if (step_us) {
    lines_.emplace_back(media::VitalNotice{
        arrival_ns_, "device-clock-set",
        "the clock of the monitor was set by " + std::to_string(*step_us / 1000) + " ms", source_});
  }
  if (step_us || !clock_stated_ns_ || arrival_ns_ - *clock_stated_ns_ >= kClockEveryNs) {
    media::DeviceClock clock = clock_.estimate();
    clock.source = source_;
    lines_.emplace_back(std::move(clock));
    clock_stated_ns_ = arrival_ns_;
  }
}

bool MonitorReader::tells_clock(std::optional<UtcTime> arrived) {
  if (is_clock_known_) return true;
  if (arrived && std::abs((*arrived - *message_time_).count()) > kLateUs) {
    const auto drift_us = [this](const Apart& first) {
      return (*message_time_ - first.time).count() - (arrival_ns_ - first.since_ns) / 1000;
    };
    // What is held up on its way, or stamped in whole minutes, only seems earlier: a later one tells.
    const bool is_forgotten = apart_ && arrival_ns_ - apart_->newest_ns > kForgottenNs;
    if (!apart_ || is_forgotten || drift_us(*apart_) > kSteadyUs)
      apart_ = Apart{arrival_ns_, *message_time_, 0, arrival_ns_};
    if (std::abs(drift_us(*apart_)) <= kSteadyUs) {
      ++apart_->messages;
      apart_->newest_ns = arrival_ns_;
    }
    if (apart_->messages < kSteadyMessages || arrival_ns_ - apart_->since_ns < kSteadyNs) return false;
  }
  is_clock_known_ = true;
  return true;
}

void MonitorReader::read_order(const Order& order, bool alarms) {
  bool has_alarm = false;
  for (std::size_t i = 0; i < order.observations.size(); ++i) {
    const Observation& observation = order.observations[i];
    for (const std::string& remark : observation.remarks) {
      notice("observation-form", observation.name() + ": " + remark);
    }
    if (alarms && observation.quantity.is_event()) {
      has_alarm = true;
      read_alarm(order, i);
    } else {
      read_one(order, i);
    }
  }
  if (alarms && !has_alarm && !order.observations.empty()) {
    notice("alarm-unknown", "an alarm message holds no event that is understood");
  }
}

void MonitorReader::read_one(const Order& order, std::size_t index) {
  const Observation& observation = order.observations[index];
  constexpr std::array<std::string_view, 4> kOfWaves{"MDC_ATTR_SAMP_RATE", "MDC_ATTR_TIME_PD_SAMP",
                                                     "MDC_ATTR_NU_MSMT_RES", "MDC_ATTR_DATA_RANGE"};
  constexpr std::array<std::string_view, 6> kOfAlarms{"PHASE",    "ALARM_STATE", "INACTIVATION",
                                                      "PRIORITY", "ALERT_TEXT",  "ALERT_SOURCE"};
  const std::string& code = observation.quantity.code;
  if (observation.is_containment() || std::ranges::find(kOfWaves, code) != kOfWaves.end()) {
    return;  // read with what they belong to
  }
  if (observation.quantity.is_attribute() && std::ranges::any_of(kOfAlarms, [&](std::string_view part) {
        return code.find(part) != std::string::npos;
      })) {
    return;
  }
  const std::string& type = observation.type;
  if (code.empty()) {
    notice("observation-unknown", "an OBX says not what it observed (OBX-3); it stands in the message");
  } else if (type == "NA") {
    read_wave(order, index);
  } else if (type == "CD") {
    return;  // describes the waveform behind it
  } else if (type == "NM" || type == "SN") {
    read_number(order, observation);
  } else if (type.empty()) {
    notice("observation-form", observation.name() + ": says no value type (OBX-2)");
    read_number(order, observation);
  } else if (type == "ED" || type == "RP" || type == "MA") {
    notice("type-unknown", observation.name() + ": values of type " + type +
                               " are not understood; they stand in the message");
  } else {
    // Some send numbers as strings; a unit tells them from other words.
    const bool number = type == "ST" && !observation.unit.unit.empty() && number_of(observation);
    number ? read_number(order, observation) : read_text(order, observation);
  }
}

bool MonitorReader::may_be_before_recording(const std::optional<UtcTime>& measured) const {
  if (!is_live_ || !measured) return false;
  const std::chrono::microseconds begins(begins_ns_ / 1000);
  // Whoever measured it may not be this patient; where nobody knows the clock it may have been then.
  if (is_clock_known_) return (zero_of_clock_ + begins - *measured).count() > kLateUs;
  return message_time_ || (zero_of_machine_ + begins - *measured).count() > kLateUs;
}

void MonitorReader::case_begins(std::int64_t begins_ns) {
  if (begins_ns == begins_ns_) return;
  begins_ns_ = begins_ns;
  noticed_.clear();
}

media::VitalQuality MonitorReader::quality_of(const Observation& observation,
                                              const std::optional<UtcTime>& measured) {
  if (observation.has_flag("INV") || observation.status == "W" || observation.status == "D") {
    return VitalQuality::kInvalid;
  }
  for (const std::string_view flag : {"DEMO", "TEST", "CALIB"}) {
    if (observation.has_flag(flag)) {
      notice("not-of-a-patient", "the monitor marks values as " + std::string(flag) +
                                     " (OBX-8); they are recorded as questionable");
      return VitalQuality::kQuestionable;
    }
  }
  if (may_be_before_recording(measured)) {
    notice("measured-before",
           is_clock_known_ || !message_time_
               ? observation.name() +
                     ": values were measured before the case began; they are recorded as questionable: they "
                     "may be of an earlier patient"
               : "messages state a time (MSH-7) more than two minutes from this machine's, "
                 "as those of a queue do; until the monitor's clock is known their values "
                 "are recorded as questionable: they may be of an earlier patient");
    return VitalQuality::kQuestionable;
  }
  const bool questionable = observation.has_flag("QUES") || observation.status == "X";
  return questionable ? VitalQuality::kQuestionable : VitalQuality::kGood;
}

std::optional<UtcTime> MonitorReader::device_time(const Order& order, const Observation& observation) const {
  if (observation.time) {
    return observation.time->utc(zone_);
  }
  if (order.begin && order.begin->is_instant()) {
    return order.begin->utc(zone_);
  }
  return message_time_;
}

void MonitorReader::note_order(const Order& order) {
  if (!order.begin || !order.begin->is_instant()) return;
  const auto [known, added] = orders_.try_emplace(order.begin->utc(zone_), Stated{arrival_ns_, arrival_ns_});
  known->second.last_ns = arrival_ns_;
  if (orders_.size() <= kMostOrders) return;
  const auto last_ns = [](const auto& each) { return each.second.last_ns; };
  orders_.erase(std::ranges::min_element(orders_, {}, last_ns));
}

std::optional<UtcTime> MonitorReader::measured_at(const Order& order, const Observation& observation,
                                                  const std::optional<UtcTime>& stated) const {
  const bool is_by_order = !observation.time && order.begin && order.begin->is_instant();
  if (!is_by_order || is_intermittent(observation) || !message_time_) return stated;
  const auto known = orders_.find(order.begin->utc(zone_));
  const bool goes_on = known != orders_.end() && arrival_ns_ - known->second.first_ns >= kOrderGoesOnNs;
  return goes_on ? message_time_ : stated;
}

void MonitorReader::note_lateness(const Observation& observation, const std::optional<UtcTime>& measured) {
  if (!measured || !message_time_ || may_be_before_recording(measured)) return;
  // A message that was held up has an old time itself: the clock's estimate tells.
  const UtcTime device_now =
      std::max(*message_time_, zero_of_clock_ + std::chrono::microseconds(arrival_ns_ / 1000));
  if ((device_now - *measured).count() > kLateUs) {
    notice("measured-earlier", observation.name() +
                                   ": values arrive long after they were measured; they stand where they "
                                   "arrived, and device_time says when they were measured");
  }
}

void MonitorReader::read_number(const Order& order, const Observation& observation) {
  media::VitalSample sample;
  sample.time_ns = arrival_ns_;
  sample.device_time = device_time(order, observation);
  sample.code = observation.quantity.code;
  sample.mdc = observation.quantity.mdc;
  sample.unit = observation.unit.unit;
  sample.source = source_;
  const std::string text = observation.value.text();
  const std::optional<double> number = number_of(observation);
  const bool unavailable = observation.has_flag("NAV") || (observation.status == "X" && text.empty());
  if (unavailable || (number ? means_missing(*number) : is_blank(text))) {
    sample.quality = VitalQuality::kMissing;
  } else if (number) {
    sample.value = number;
    sample.quality = quality_of(observation, measured_at(order, observation, sample.device_time));
  } else {
    const bool repeated = observation.value.repetitions().size() > 1;
    notice("value-no-number", observation.name() + ": the value '" + first_words(text) + "' is no number" +
                                  (repeated ? " but several" : "") + "; it is recorded as a text");
    read_text(order, observation);
    return;
  }
  if (!is_repeated(observation, sample)) {
    note_lateness(observation, sample.device_time);
    lines_.emplace_back(std::move(sample));
  }
}

bool MonitorReader::is_repeated(const Observation& observation, const media::VitalSample& sample) {
  if (!observation.time || !is_intermittent(observation)) {
    return false;
  }
  if (measured_.size() >= kMostRemembered) {
    measured_.clear();
  }
  const std::pair now{*sample.device_time, sample.value};
  const auto [last, added] = measured_.try_emplace({sample.code, observation.sub_id}, now);
  if (!added && last->second == now) {
    notice("measurement-repeated",
           observation.name() +
               ": a measurement that the monitor sends again with its old time is recorded once");
    return true;
  }
  last->second = now;
  return false;
}

void MonitorReader::read_text(const Order& order, const Observation& observation) {
  media::VitalText text;
  text.time_ns = arrival_ns_;
  text.device_time = device_time(order, observation);
  text.code = observation.quantity.code;
  text.mdc = observation.quantity.mdc;
  text.source = source_;
  for (const Hl7Field& repetition : observation.value.repetitions()) {
    // Of a coded value the words; of all else everything.
    const bool coded = observation.type == "CE" || observation.type == "CWE" || observation.type == "CNE";
    const std::string words =
        coded && !repetition.component(2).empty() ? repetition.component(2).text() : repetition.text();
    text.text += (text.text.empty() ? "" : "\n") + words;
  }
  if (observation.type == "SN" || (observation.type != "NM" && !observation.unit.unit.empty())) {
    text.text += observation.unit.unit.empty() ? "" : " " + observation.unit.unit;
  }
  text.quality = quality_of(observation, measured_at(order, observation, text.device_time));
  note_lateness(observation, text.device_time);
  lines_.emplace_back(std::move(text));
}

double MonitorReader::rate_of(const Order& order, std::size_t index, std::size_t values) const {
  const Observation& wave = order.observations[index];
  if (const Observation* const rate = order.attribute(index, "MDC_ATTR_SAMP_RATE")) {
    const double scale = rate->unit.unit == "/min" ? 60 : 1;
    return parse_decimal(rate->value.text()).value_or(0) / scale;
  }
  if (const Observation* const period = order.attribute(index, "MDC_ATTR_TIME_PD_SAMP")) {
    const double seconds = period->unit.unit == "ms" ? 1e-3 : period->unit.unit == "us" ? 1e-6 : 1;
    return 1 / (parse_decimal(period->value.text()).value_or(0) * seconds);
  }
  if (index > 0 && order.observations[index - 1].type == "CD") {
    return parse_decimal(order.observations[index - 1].value.component(5).text()).value_or(0);
  }
  if (!wave.rate_text.empty()) {
    return parse_decimal(wave.rate_text.substr(0, wave.rate_text.find_first_not_of("0123456789.")))
        .value_or(0);
  }
  if (const auto known = rates_.find({wave.quantity.code, wave.sub_id}); known != rates_.end()) {
    return known->second;
  }
  if (order.begin && order.end && order.end->local > order.begin->local) {
    const std::chrono::duration<double> length = order.end->utc(zone_) - order.begin->utc(zone_);
    return static_cast<double>(values) / length.count();
  }
  return 0;
}

void MonitorReader::read_wave(const Order& order, std::size_t index) {
  const Observation& observation = order.observations[index];
  media::VitalSample wave;
  std::size_t unreadable = 0;
  for (const Hl7Field& row : observation.value.repetitions()) {
    for (const Hl7Field& field : row.components()) {
      const auto value = parse_decimal(field.raw());
      unreadable += !value && !is_blank(field.raw()) ? 1U : 0U;
      const bool missing = !value || means_missing_in_waveform(*value);
      wave.values.push_back(missing ? std::numeric_limits<double>::quiet_NaN() : *value);
    }
  }
  const std::size_t count = wave.values.size();
  if (unreadable > 0) {
    notice("waveform-unreadable",
           observation.name() + ": values of the waveform are no numbers; they are missing");
  }
  const double rate_hz = rate_of(order, index, count);
  wave.time_ns = arrival_ns_;
  wave.code = observation.quantity.code;
  wave.mdc = observation.quantity.mdc;
  wave.unit = observation.unit.unit;
  wave.source = source_;
  const bool none = std::ranges::all_of(wave.values, [](double value) { return std::isnan(value); });
  if (none || observation.has_flag("NAV")) {
    wave.values.clear();
    wave.device_time = device_time(order, observation);
    wave.quality = VitalQuality::kMissing;
    lines_.emplace_back(std::move(wave));
    return;
  }
  if (!(rate_hz > 0) || rate_hz > kHighestRateHz) {
    notice("waveform-without-rate",
           observation.name() + ": the waveform has no sampling rate; it stands in the message");
    return;
  }
  const double seconds = static_cast<double>(count) / rate_hz;
  if (count > kMostWaveValues || seconds * 1e9 > static_cast<double>(media::kLongestWaveformNs)) {
    notice("waveform-too-long", observation.name() + ": a waveform of more than a minute, or of more than " +
                                    std::to_string(kMostWaveValues) + " values, stands in the message only");
    return;
  }
  if (rates_.size() >= kMostRemembered) {
    rates_.clear();
  }
  rates_[{wave.code, observation.sub_id}] = rate_hz;
  wave.rate_hz = rate_hz;
  const Observation* const resolution = order.attribute(index, "MDC_ATTR_NU_MSMT_RES");
  const bool counts = wave.unit.empty() || wave.unit == "1";
  if (const auto scale = resolution != nullptr ? parse_decimal(resolution->value.text()) : std::nullopt;
      scale && *scale != 0 && counts) {
    for (double& value : wave.values) {
      value *= *scale;
    }
    wave.unit = resolution->unit.unit;
  }
  // The monitor states when a block began; a sample's own time is its end.
  const auto block = std::chrono::microseconds(std::llround(seconds * 1e6));
  if (observation.time) {
    wave.device_time = observation.time->utc(zone_) + block;
  } else if (order.begin && order.begin->is_instant()) {
    wave.device_time = order.begin->utc(zone_) + block;
  } else {
    wave.device_time = message_time_;
  }
  wave.quality = quality_of(observation, measured_at(order, observation, wave.device_time));
  const Observation* const inoperative = order.attribute(index, "MDC_EVT_INOP");
  if (inoperative != nullptr && parse_decimal(inoperative->value.text()).value_or(0) != 0) {
    wave.quality = VitalQuality::kQuestionable;
  }
  if (const std::string problem = media::problem_of(wave); !problem.empty()) {
    notice("waveform-unreadable", observation.name() + ": " + problem + "; it stands in the message");
    return;
  }
  note_lateness(observation, wave.device_time);
  lines_.emplace_back(std::move(wave));
}

void MonitorReader::read_alarm(const Order& order, std::size_t index) {
  const Observation& event = order.observations[index];
  media::DeviceAlarm alarm;
  alarm.time_ns = arrival_ns_;
  alarm.device_time = device_time(order, event);
  alarm.code = event.quantity.code;
  alarm.mdc = event.quantity.mdc;
  alarm.source = source_;
  // What the value says: the kind of event where the code is only "alarm", else what it is about, or words.
  const Quantity said = quantity_of(event.value);
  const bool coded = said.mdc != 0 || said.code.starts_with("MDC");
  if (coded && alarm.code == "MDC_EVT_ALARM") {
    alarm.code = said.code;
    alarm.mdc = said.mdc;
  } else if (coded) {
    alarm.about = said.code;
  } else {
    alarm.text = event.value.text();
  }
  for (const std::string& flag : event.flags) {
    // IHE PCD-04 puts priority and type among the abnormal flags: A~PM~SA.
    if (flag.size() == 2 && flag[0] == 'P') {
      alarm.priority = flag;
    }
  }
  std::string inactivation;
  for (std::size_t i = index + 1; i < order.observations.size(); ++i) {
    const Observation& other = order.observations[i];
    if (other.quantity.is_event()) {
      break;
    }
    if (!other.quantity.is_attribute() || parent_of(other.sub_id) != parent_of(event.sub_id)) {
      continue;
    }
    const std::string& name = other.quantity.code;
    const std::string value = other.value.text();
    const auto is = [&](std::string_view part) { return name.find(part) != std::string::npos; };
    if (is("PHASE")) {
      alarm.phase = value;
    } else if (is("INACTIVATION")) {
      inactivation = value;
    } else if (is("ALARM_STATE")) {
      alarm.state = value;
    } else if (is("PRIORITY")) {
      alarm.priority = value;
    } else if (is("ALERT_TEXT")) {
      alarm.text = value;
    } else if (is("ALERT_SOURCE")) {
      const Quantity about = quantity_of(other.value);
      alarm.about = about.mdc != 0 ? about.code : value;
    }
  }
  // "active, audio-paused"; that it can sound is the rule, and not said.
  if (!inactivation.empty() && inactivation != "enabled") {
    alarm.state += (alarm.state.empty() ? "" : ", ") + inactivation;
  }
  alarm.quality = quality_of(event, measured_at(order, event, alarm.device_time));
  note_lateness(event, alarm.device_time);
  lines_.emplace_back(std::move(alarm));
}

}  // namespace kiroku::recorder

#include "recorder/vitals/hl7_observation.h"

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>

namespace kiroku::recorder {
namespace {

/// HL7 table 0125, as far as observations of devices have it.
constexpr std::array<std::string_view, 26> kTypes{"AD",  "CD", "CE", "CF", "CNE", "CWE", "CX",  "DR", "DT",
                                                  "DTM", "ED", "FT", "ID", "IS",  "MA",  "NA",  "NM", "NR",
                                                  "RP",  "SN", "ST", "TM", "TS",  "TX",  "XAD", "XTN"};

bool is_type(std::string_view text) { return std::ranges::find(kTypes, text) != kTypes.end(); }

bool is_code(const Hl7Field& field) { return field.components().size() >= 2 && !field.component(1).empty(); }

bool is_unit_term(const Hl7Field& field) { return field.raw().find("MDC_DIM_") != std::string_view::npos; }

/// Puts fields back where they belong, with a remark for each way in which they were not.
Hl7Segment unshifted(Hl7Segment segment, std::vector<std::string>& remarks) {
  // OBX||1|NM|code: a field too many before the type.
  if (!is_type(segment.field(2).raw()) && is_type(segment.field(3).raw()) && is_code(segment.field(4))) {
    segment = segment.without(segment.field(1).empty() ? 1 : 2);
    remarks.emplace_back("its fields are shifted to the right by one; they were read from where they stand");
  }
  // OBX|1|code|…: the type is left out.
  if (!is_type(segment.field(2).raw()) && is_code(segment.field(2)) && !is_code(segment.field(3))) {
    segment = segment.with_empty(2);
    remarks.emplace_back(
        "its fields are shifted to the left by one (no value type); they were read from where "
        "they stand");
  }
  // OBX|1|NM|code|value|unit: the sub-identifier is left out.
  if (is_unit_term(segment.field(5)) && !is_unit_term(segment.field(6)) &&
      parse_decimal(segment.field(4).raw())) {
    segment = segment.with_empty(4);
    remarks.emplace_back(
        "its fields are shifted to the left by one (no sub-identifier); they were read from where "
        "they stand");
  }
  return segment;
}

/// Names of what was observed stand in every line that is made of it, and some are remembered.
constexpr std::size_t kLongestName = 1000;

bool is_named_at_length(const Hl7Segment& segment) {
  constexpr std::array<std::size_t, 6> kNames{1, 2, 3, 4, 6, 14};
  return std::ranges::any_of(
      kNames, [&](std::size_t number) { return segment.field(number).raw().size() > kLongestName; });
}

/// "500 Hz" or "500Hz" as the whole of a component.
bool states_rate(std::string_view text) {
  const std::size_t number = std::min(text.find_first_not_of("0123456789."), text.size());
  std::string_view rest = text.substr(number);
  while (rest.starts_with(' ')) {
    rest.remove_prefix(1);
  }
  return number > 0 && (rest == "Hz" || rest == "HZ" || rest == "hz");
}

}  // namespace

bool Observation::has_flag(std::string_view flag) const {
  return std::ranges::find(flags, flag) != flags.end();
}

bool Observation::is_containment() const {
  return value.empty() && (type.empty() || quantity.code.starts_with("MDC_DEV_"));
}

std::string Observation::name() const {
  return "OBX" + (set_id.empty() ? "" : " " + set_id) + " (" + quantity.code + ")";
}

Observation read_observation(const Hl7Segment& sent) {
  Observation observation;
  const Hl7Segment segment = unshifted(sent, observation.remarks);
  if (is_named_at_length(segment)) {
    observation.remarks.push_back("its number, type, name, sub-identifier, unit or time is longer than " +
                                  std::to_string(kLongestName) + " bytes");
    return observation;
  }
  observation.set_id = segment.field(1).text();
  observation.type = segment.field(2).text();
  observation.quantity = quantity_of(segment.field(3));
  observation.sub_id = segment.field(4).text();
  observation.value = segment.field(5);
  observation.unit = unit_of(segment.field(6));
  for (const Hl7Field& flag : segment.field(8).repetitions()) {
    if (!flag.empty()) {
      observation.flags.push_back(flag.component(1).text());
    }
  }
  observation.status = segment.field(11).text();
  observation.time_text = segment.field(14).component(1).text();
  observation.time = parse_hl7_time(observation.time_text);
  if (observation.time && !observation.time->is_instant()) {
    observation.time.reset();
  }
  observation.method = std::string(segment.field(17).raw());
  for (const std::size_t number : {6U, 7U, 13U, 17U}) {
    for (const Hl7Field& part : segment.field(number).components()) {
      if (states_rate(part.raw())) {
        observation.rate_text = part.text();
      }
    }
  }
  if (!observation.quantity.remark.empty()) {
    observation.remarks.push_back(observation.quantity.remark);
  }
  if (!observation.unit.known) {
    observation.remarks.push_back("the unit '" + observation.unit.unit +
                                  "' is not known; it was kept as it is");
  }
  if (!observation.time_text.empty() && !observation.time) {
    observation.remarks.push_back("the time '" + observation.time_text + "' (OBX-14) says no instant");
  }
  return observation;
}

std::optional<double> parse_decimal(std::string_view text) {
  while (text.starts_with(' ')) {
    text.remove_prefix(1);
  }
  while (text.ends_with(' ')) {
    text.remove_suffix(1);
  }
  if (text.starts_with('+') && !text.starts_with("+-")) {
    text.remove_prefix(1);
  }
  double number = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), number);
  if (error != std::errc() || end != text.data() + text.size() || !std::isfinite(number)) {
    return std::nullopt;
  }
  return number;
}

bool means_missing(double number) {
  constexpr std::array<double, 4> kSmall{-999, -99.9, -999.9, -9999};
  return std::ranges::find(kSmall, number) != kSmall.end() || means_missing_in_waveform(number);
}

bool means_missing_in_waveform(double number) {
  constexpr std::array<double, 4> kLargest{32767, -32768, 8388607, -8388608};
  return std::ranges::find(kLargest, number) != kLargest.end();
}

}  // namespace kiroku::recorder

#include "media/vital_sample.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include "base/error.h"
#include "crypto/utf8.h"
#include "media/json_line.h"

namespace kiroku::media {
namespace {

constexpr std::array<std::pair<VitalQuality, std::string_view>, 4> kQualities{
    {{VitalQuality::kGood, "good"},
     {VitalQuality::kQuestionable, "questionable"},
     {VitalQuality::kInvalid, "invalid"},
     {VitalQuality::kMissing, "missing"}}};

}  // namespace

std::string_view quality_name(VitalQuality quality) {
  for (const auto& [value, name] : kQualities) {
    if (value == quality) {
      return name;
    }
  }
  return "";
}

std::optional<VitalQuality> parse_quality(std::string_view name) {
  for (const auto& [value, known] : kQualities) {
    if (known == name) {
      return value;
    }
  }
  return std::nullopt;
}

std::string problem_of(const VitalSample& sample) {
  if (sample.time_ns < 0 || sample.time_ns >= kTimeLimitNs) {
    return "time_ns is not from 0 to 2^53 - 1";
  }
  if (sample.code.empty()) {
    return "the code is empty";
  }
  for (const std::string* text : {&sample.code, &sample.unit, &sample.source}) {
    if (!crypto::is_utf8(*text)) {
      return "a text is not UTF-8";
    }
  }
  if (sample.rate_hz == 0) {
    if (!sample.values.empty()) {
      return "there are values but no rate";
    }
    if (sample.value.has_value() == (sample.quality == VitalQuality::kMissing)) {
      return "a value must be null if, and only if, its quality is missing";
    }
    return sample.value && !std::isfinite(*sample.value) ? "the value is not finite" : "";
  }
  if (!(sample.rate_hz > 0) || !std::isfinite(sample.rate_hz)) {
    return "rate_hz is not a positive number";
  }
  if (sample.value || sample.quality == VitalQuality::kMissing) {
    return "a waveform cannot have a single value, nor the quality missing";
  }
  if (sample.values.empty()) {
    return "a waveform has no values";
  }
  if (static_cast<double>(sample.values.size()) / sample.rate_hz * 1e9 >
      static_cast<double>(kLongestWaveformNs)) {
    return "a waveform is longer than " + std::to_string(kLongestWaveformNs / 1'000'000'000) + " s";
  }
  if (std::ranges::any_of(sample.values, [](double value) { return std::isinf(value); })) {
    return "a value is not finite";
  }
  if (std::ranges::all_of(sample.values, [](double value) { return std::isnan(value); })) {
    return "a waveform has no value but null";
  }
  return "";
}

std::string to_json_line(const VitalSample& sample) {
  if (const std::string problem = problem_of(sample); !problem.empty()) {
    throw Error("cannot write the vital sign '" + sample.code + "': " + problem);
  }
  std::string line = "{\"time_ns\":";
  append_number(line, sample.time_ns);
  if (sample.device_time) {
    line += ",\"device_time\":\"" + format_utc(*sample.device_time) + '"';
  }
  line += ",\"code\":";
  append_text(line, sample.code);
  if (sample.mdc != 0) {
    line += ",\"mdc\":";
    append_number(line, sample.mdc);
  }
  if (sample.is_waveform()) {
    line += ",\"rate_hz\":";
    append_number(line, sample.rate_hz);
    line += ",\"values\":";
    char before = '[';
    for (const double value : sample.values) {
      line += std::exchange(before, ',');
      if (std::isnan(value)) {
        line += "null";
      } else {
        append_number(line, value);
      }
    }
    line += ']';
  } else if (sample.value) {
    line += ",\"value\":";
    append_number(line, *sample.value);
  } else {
    line += ",\"value\":null";
  }
  line += ",\"unit\":";
  append_text(line, sample.unit);
  line += ",\"source\":";
  append_text(line, sample.source);
  line += ",\"quality\":\"";
  line += quality_name(sample.quality);
  line += "\"}";
  if (line.size() > kMaximumVitalLineBytes) {
    throw Error("cannot write the vital sign '" + sample.code + "': its line would be longer than 1 MiB");
  }
  return line;
}

VitalParse parse_vital_line(std::string_view line) {
  if (line.size() > kMaximumVitalLineBytes) {
    return {std::nullopt, "the line is longer than 1 MiB"};
  }
  LineFields fields(line);
  return read_vital_sample(fields);
}

VitalParse read_vital_sample(LineFields& fields) {
  VitalSample sample;
  std::string quality;
  fields.number("time_ns", sample.time_ns);
  if (fields.has("device_time")) {
    fields.utc("device_time", sample.device_time.emplace());
  }
  fields.text("code", sample.code);
  if (fields.has("mdc") && fields.number("mdc", sample.mdc) && sample.mdc == 0) {
    fields.refuse("mdc", "is 0, which stands for unknown and is left out");
  }
  if (fields.has("rate_hz") || fields.has("values")) {
    if (fields.number("rate_hz", sample.rate_hz) && !(sample.rate_hz > 0)) {
      fields.refuse("rate_hz", "is not a positive number");
    }
    fields.numbers("values", sample.values);
  } else {
    fields.number_or_null("value", sample.value);
  }
  fields.text("unit", sample.unit);
  fields.text("source", sample.source);
  if (fields.text("quality", quality)) {
    if (const auto known = parse_quality(quality)) {
      sample.quality = *known;
    } else {
      fields.refuse("quality", "is none of good, questionable, invalid, missing");
    }
  }
  if (!fields.no_more()) {
    return {std::nullopt, fields.problem()};
  }
  if (std::string problem = problem_of(sample); !problem.empty()) {
    return {std::nullopt, std::move(problem)};
  }
  return {std::move(sample), ""};
}

std::int64_t waveform_time_ns(const VitalSample& waveform, std::size_t index) {
  const auto before_end = static_cast<double>(waveform.values.size() - index);
  return waveform.time_ns - std::llround(before_end * 1e9 / waveform.rate_hz);
}

}  // namespace kiroku::media

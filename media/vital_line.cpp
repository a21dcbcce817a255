#include "media/vital_line.h"

#include <type_traits>
#include <utility>

#include "base/bytes.h"
#include "base/error.h"
#include "crypto/encoding.h"
#include "crypto/utf8.h"
#include "media/json_line.h"

namespace kiroku::media {
namespace {

constexpr auto kPadding = crypto::Base64Padding::kPadded;

/// Writes an object whose first two keys are time_ns and kind.
class LineWriter {
 public:
  LineWriter(std::int64_t time_ns, std::string_view kind) {
    if (time_ns < 0 || time_ns >= kTimeLimitNs) {
      throw Error("cannot write a " + std::string(kind) +
                  " of the vital signs: time_ns is not from 0 to 2^53 - 1");
    }
    line_ = "{\"time_ns\":";
    append_number(line_, time_ns);
    add("kind", kind);
  }
  void add(std::string_view key, std::string_view text) {
    if (!crypto::is_utf8(text)) {
      throw Error("cannot write '" + std::string(key) + "' of the vital signs: it is not UTF-8");
    }
    begin(key);
    append_text(line_, text);
  }
  void add(std::string_view key, const std::optional<UtcTime>& time) {
    if (time) {
      add(key, std::string_view(format_utc(*time)));
    }
  }
  template <typename Number>
  requires std::is_arithmetic_v<Number>
  void add(std::string_view key, Number number) {
    begin(key);
    append_number(line_, number);
  }
  void add_code(const std::string& code, std::uint32_t mdc) {
    if (code.empty()) {
      throw Error("cannot write a line of the vital signs: its code is empty");
    }
    add("code", std::string_view(code));
    if (mdc != 0) {
      add("mdc", mdc);
    }
  }
  void add_quality(VitalQuality quality) {
    if (quality == VitalQuality::kMissing)
      throw Error("cannot write a line of the vital signs: words and alarms are never missing");
    if (quality != VitalQuality::kGood) add("quality", quality_name(quality));
  }
  std::string finish() && {
    line_ += '}';
    return std::move(line_);
  }

 private:
  void begin(std::string_view key) {
    line_ += ",\"";
    line_ += key;
    line_ += "\":";
  }
  std::string line_;
};

std::string write(const VitalSample& sample) { return to_json_line(sample); }

std::string write(const VitalText& text) {
  LineWriter writer(text.time_ns, "text");
  writer.add("device_time", text.device_time);
  writer.add_code(text.code, text.mdc);
  writer.add("text", std::string_view(text.text));
  writer.add("source", std::string_view(text.source));
  writer.add_quality(text.quality);
  return std::move(writer).finish();
}

std::string write(const DeviceAlarm& alarm) {
  LineWriter writer(alarm.time_ns, "alarm");
  writer.add("device_time", alarm.device_time);
  writer.add_code(alarm.code, alarm.mdc);
  writer.add("text", std::string_view(alarm.text));
  writer.add("about", std::string_view(alarm.about));
  writer.add("phase", std::string_view(alarm.phase));
  writer.add("state", std::string_view(alarm.state));
  writer.add("priority", std::string_view(alarm.priority));
  writer.add("source", std::string_view(alarm.source));
  writer.add_quality(alarm.quality);
  return std::move(writer).finish();
}

std::string write(const DeviceMessage& message) {
  const auto written = [&](std::string_view key, std::string_view content) {
    LineWriter writer(message.time_ns, "message");
    writer.add("answer", std::string_view(message.answer));
    writer.add(key, content);
    writer.add("source", std::string_view(message.source));
    return std::move(writer).finish();
  };
  if (crypto::is_utf8(message.bytes)) {
    std::string line = written("text", message.bytes);
    if (line.size() <= kMaximumVitalLineBytes) {
      return line;
    }
  }
  return written("base64", crypto::to_base64(bytes_of(message.bytes), kPadding));
}

std::string write(const DeviceClock& clock) {
  LineWriter writer(clock.time_ns, "device-clock");
  writer.add("zero", std::optional(clock.zero));
  writer.add("spread_ns", clock.spread_ns);
  writer.add("messages", clock.messages);
  writer.add("source", std::string_view(clock.source));
  return std::move(writer).finish();
}

std::string write(const VitalNotice& notice) {
  LineWriter writer(notice.time_ns, "notice");
  writer.add("notice", std::string_view(notice.notice));
  writer.add("text", std::string_view(notice.text));
  writer.add("source", std::string_view(notice.source));
  return std::move(writer).finish();
}

template <typename Line>
void read_time_and_code(LineFields& fields, Line& line) {
  if (fields.has("device_time")) {
    fields.utc("device_time", line.device_time.emplace());
  }
  if (fields.text("code", line.code) && line.code.empty()) {
    fields.refuse("code", "is empty");
  }
  if (fields.has("mdc") && fields.number("mdc", line.mdc) && line.mdc == 0) {
    fields.refuse("mdc", "is 0, which stands for unknown and is left out");
  }
}

/// Good is left out.
template <typename Line>
void read_quality(LineFields& fields, Line& line) {
  std::string name;
  if (!fields.has("quality") || !fields.text("quality", name)) return;
  line.quality = parse_quality(name).value_or(VitalQuality::kGood);
  if (line.quality != VitalQuality::kQuestionable && line.quality != VitalQuality::kInvalid)
    fields.refuse("quality", "is none of questionable, invalid");
}

void read(LineFields& fields, VitalText& text) {
  read_time_and_code(fields, text);
  read_quality(fields, text);
  fields.text("text", text.text);
}

void read(LineFields& fields, DeviceAlarm& alarm) {
  read_time_and_code(fields, alarm);
  read_quality(fields, alarm);
  fields.text("text", alarm.text);
  fields.text("about", alarm.about);
  fields.text("phase", alarm.phase);
  fields.text("state", alarm.state);
  fields.text("priority", alarm.priority);
}

void read(LineFields& fields, DeviceMessage& message) {
  fields.text("answer", message.answer);
  if (!fields.has("base64")) {
    fields.text("text", message.bytes);
    return;
  }
  std::string encoded;
  if (fields.text("base64", encoded)) {
    if (const auto bytes = crypto::from_base64(encoded, kPadding)) {
      message.bytes = std::string(text_of(*bytes));
    } else {
      fields.refuse("base64", "is not well formed");
    }
  }
}

void read(LineFields& fields, DeviceClock& clock) {
  fields.utc("zero", clock.zero);
  fields.number("spread_ns", clock.spread_ns);
  fields.number("messages", clock.messages);
}

void read(LineFields& fields, VitalNotice& notice) {
  fields.text("notice", notice.notice);
  fields.text("text", notice.text);
}

template <typename Line>
VitalLineParse read_as(LineFields& fields) {
  Line line;
  if (fields.number("time_ns", line.time_ns) && (line.time_ns < 0 || line.time_ns >= kTimeLimitNs)) {
    fields.refuse("time_ns", "is not from 0 to 2^53 - 1");
  }
  read(fields, line);
  fields.text("source", line.source);
  if (!fields.no_more()) {
    return {std::nullopt, fields.problem()};
  }
  return {VitalLine(std::move(line)), ""};
}

}  // namespace

std::int64_t time_ns_of(const VitalLine& line) {
  return std::visit([](const auto& known) { return known.time_ns; }, line);
}

void set_time_ns(VitalLine& line, std::int64_t time_ns) {
  std::visit([&](auto& known) { known.time_ns = time_ns; }, line);
}

std::string to_json_line(const VitalLine& line) {
  std::string text = std::visit([](const auto& known) { return write(known); }, line);
  if (text.size() > kMaximumVitalLineBytes) {
    throw Error("cannot write a line of the vital signs: it would be longer than 1 MiB");
  }
  return text;
}

VitalLineParse parse_vital_line_of_any_kind(std::string_view text) {
  if (text.size() > kMaximumVitalLineBytes) {
    return {std::nullopt, "the line is longer than 1 MiB"};
  }
  LineFields fields(text);
  if (!fields.has("kind")) {
    VitalParse parse = read_vital_sample(fields);
    return {std::move(parse.sample), std::move(parse.problem)};
  }
  std::string kind;
  if (!fields.text("kind", kind)) {
    return {std::nullopt, fields.problem()};
  }
  if (kind == "text") {
    return read_as<VitalText>(fields);
  }
  if (kind == "alarm") {
    return read_as<DeviceAlarm>(fields);
  }
  if (kind == "message") {
    return read_as<DeviceMessage>(fields);
  }
  if (kind == "device-clock") {
    return read_as<DeviceClock>(fields);
  }
  if (kind == "notice") {
    return read_as<VitalNotice>(fields);
  }
  return {std::nullopt, "the kind '" + kind + "' is none of text, alarm, message, device-clock, notice"};
}

}  // namespace kiroku::media

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

constexpr std::int64_t kTimeLimitNs = std::int64_t{1} << 53U;
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

/// Reads `,"key":"text"`.
bool read_text(LineCursor& cursor, std::string_view key, std::string& into) {
  return cursor.expect(",\"" + std::string(key) + "\":") && cursor.text(into);
}

template <typename Line>
bool read_time_and_code(LineCursor& cursor, Line& line) {
  if (cursor.skip(",\"device_time\":") && !cursor.utc(line.device_time.emplace(), "device_time")) {
    return false;
  }
  if (!read_text(cursor, "code", line.code)) {
    return false;
  }
  return !cursor.skip(",\"mdc\":") || cursor.number(line.mdc);
}

bool read(LineCursor& cursor, VitalText& text) {
  return read_time_and_code(cursor, text) && read_text(cursor, "text", text.text) &&
         read_text(cursor, "source", text.source);
}

bool read(LineCursor& cursor, DeviceAlarm& alarm) {
  return read_time_and_code(cursor, alarm) && read_text(cursor, "text", alarm.text) &&
         read_text(cursor, "about", alarm.about) && read_text(cursor, "phase", alarm.phase) &&
         read_text(cursor, "state", alarm.state) && read_text(cursor, "priority", alarm.priority) &&
         read_text(cursor, "source", alarm.source);
}

bool read(LineCursor& cursor, DeviceMessage& message) {
  if (!read_text(cursor, "answer", message.answer)) {
    return false;
  }
  if (cursor.skip(",\"base64\":")) {
    std::string encoded;
    if (!cursor.text(encoded)) {
      return false;
    }
    const auto bytes = crypto::from_base64(encoded, kPadding);
    if (!bytes) {
      return cursor.fail("base64 is not well formed");
    }
    message.bytes = std::string(text_of(*bytes));
  } else if (!read_text(cursor, "text", message.bytes)) {
    return false;
  }
  return read_text(cursor, "source", message.source);
}

bool read(LineCursor& cursor, DeviceClock& clock) {
  return cursor.expect(",\"zero\":") && cursor.utc(clock.zero, "zero") && cursor.expect(",\"spread_ns\":") &&
         cursor.number(clock.spread_ns) && cursor.expect(",\"messages\":") && cursor.number(clock.messages) &&
         read_text(cursor, "source", clock.source);
}

bool read(LineCursor& cursor, VitalNotice& notice) {
  return read_text(cursor, "notice", notice.notice) && read_text(cursor, "text", notice.text) &&
         read_text(cursor, "source", notice.source);
}

template <typename Line>
VitalLineParse read_as(LineCursor& cursor, std::int64_t time_ns, std::string_view text) {
  Line line;
  line.time_ns = time_ns;
  if (!read(cursor, line) || !cursor.end_of_object()) {
    return {std::nullopt, cursor.problem()};
  }
  // Whatever has a second form is refused, so that a line says one thing in one way.
  try {
    if (write(line) == text) {
      return {VitalLine(std::move(line)), ""};
    }
  } catch (const Error& error) {
    return {std::nullopt, error.what()};
  }
  return {std::nullopt, "the line is not in the form in which it would have been written"};
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
  LineCursor cursor(text);
  std::int64_t time_ns = 0;
  std::string kind;
  if (!cursor.skip("{\"time_ns\":") || !cursor.number(time_ns) || !cursor.skip(",\"kind\":")) {
    VitalParse parse = parse_vital_line(text);
    return {std::move(parse.sample), std::move(parse.problem)};
  }
  if (!cursor.text(kind)) {
    return {std::nullopt, cursor.problem()};
  }
  if (kind == "text") {
    return read_as<VitalText>(cursor, time_ns, text);
  }
  if (kind == "alarm") {
    return read_as<DeviceAlarm>(cursor, time_ns, text);
  }
  if (kind == "message") {
    return read_as<DeviceMessage>(cursor, time_ns, text);
  }
  if (kind == "device-clock") {
    return read_as<DeviceClock>(cursor, time_ns, text);
  }
  if (kind == "notice") {
    return read_as<VitalNotice>(cursor, time_ns, text);
  }
  return {std::nullopt, "the kind '" + kind + "' is none of text, alarm, message, device-clock, notice"};
}

}  // namespace kiroku::media

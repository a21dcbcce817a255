#include "media/vital_sample.h"

#include <array>
#include <charconv>
#include <cmath>
#include <utility>

#include "base/error.h"
#include "crypto/utf8.h"

namespace kiroku::media {
namespace {

constexpr std::int64_t kTimeLimitNs = std::int64_t{1} << 53U;

constexpr std::array<std::pair<VitalQuality, std::string_view>, 4> kQualities{
    {{VitalQuality::kGood, "good"},
     {VitalQuality::kQuestionable, "questionable"},
     {VitalQuality::kInvalid, "invalid"},
     {VitalQuality::kMissing, "missing"}}};

template <typename Number>
void append_number(std::string& line, Number number) {
  std::array<char, 32> text{};
  const auto end = std::to_chars(text.data(), text.data() + text.size(), number).ptr;
  line.append(text.data(), end);
}

void append_text(std::string& line, std::string_view text) {
  constexpr std::string_view kHexDigits = "0123456789abcdef";
  line += '"';
  for (const char c : text) {
    const auto code = static_cast<unsigned char>(c);
    if (c == '"' || c == '\\') {
      line += '\\';
      line += c;
    } else if (code < 0x20) {
      line += "\\u00";
      line += kHexDigits[code >> 4U];
      line += kHexDigits[code & 0xFU];
    } else {
      line += c;
    }
  }
  line += '"';
}

/// Reads a line from its start; after the first failure every call fails, and problem() stays.
class Cursor {
 public:
  explicit Cursor(std::string_view line) : line_(line) {}

  [[nodiscard]] const std::string& problem() const { return problem_; }
  [[nodiscard]] bool at_end() const { return position_ == line_.size(); }

  bool fail(std::string_view what) {
    if (problem_.empty()) {
      problem_ = std::string(what) + " at column " + std::to_string(position_ + 1);
    }
    return false;
  }
  /// Steps over `expected` if it comes next.
  bool skip(std::string_view expected) {
    if (!problem_.empty() || !line_.substr(position_).starts_with(expected)) {
      return false;
    }
    position_ += expected.size();
    return true;
  }
  bool expect(std::string_view expected) {
    return skip(expected) || fail("expected " + std::string(expected));
  }
  /// A number in exactly the form append_number gives it.
  template <typename Number>
  bool number(Number& into) {
    if (!problem_.empty()) {
      return false;
    }
    const char* const begin = line_.data() + position_;
    const auto [end, error] = std::from_chars(begin, line_.data() + line_.size(), into);
    if (error != std::errc()) {
      return fail("expected a number");
    }
    std::string canonical;
    append_number(canonical, into);
    const auto length = static_cast<std::size_t>(end - begin);
    if (line_.substr(position_, length) != canonical) {
      return fail("a number is not in its shortest form");
    }
    position_ += length;
    return true;
  }
  bool text(std::string& into) {
    if (!expect("\"")) {
      return false;
    }
    const std::size_t begin = position_;
    into.clear();
    while (position_ < line_.size() && line_[position_] != '"') {
      char c = line_[position_];
      std::size_t length = 1;
      if (static_cast<unsigned char>(c) < 0x20) {
        return fail("a control character is not escaped");
      }
      if (c == '\\' && !escape(c, length)) {
        return false;
      }
      into += c;
      position_ += length;
    }
    if (!crypto::is_utf8(line_.substr(begin, position_ - begin))) {
      return fail("a text is not UTF-8");
    }
    return expect("\"");
  }

 private:
  bool escape(char& c, std::size_t& length) {
    const std::string_view rest = line_.substr(position_);
    if (rest.starts_with("\\\"") || rest.starts_with("\\\\")) {
      c = rest[1];
      length = 2;
      return true;
    }
    unsigned code = 0;
    if (rest.starts_with("\\u00") && rest.size() >= 6) {
      const auto [end, error] = std::from_chars(rest.data() + 4, rest.data() + 6, code, 16);
      c = static_cast<char>(code);
      std::string canonical;
      append_text(canonical, std::string_view(&c, 1));
      if (error == std::errc() && end == rest.data() + 6 && code < 0x20 &&
          canonical.substr(1, 6) == rest.substr(0, 6)) {
        length = 6;
        return true;
      }
    }
    return fail("a character is escaped that need not be");
  }

  std::string_view line_;
  std::size_t position_ = 0;
  std::string problem_;
};

bool read_values(Cursor& cursor, std::vector<double>& values) {
  if (!cursor.expect("[")) {
    return false;
  }
  do {
    if (!cursor.number(values.emplace_back())) {
      return false;
    }
  } while (cursor.skip(","));
  return cursor.expect("]");
}

bool read_device_time(Cursor& cursor, VitalSample& sample) {
  std::string text;
  if (!cursor.text(text)) {
    return false;
  }
  sample.device_time = parse_utc(text);
  if (!sample.device_time || format_utc(*sample.device_time) != text) {
    return cursor.fail("device_time is not RFC 3339 UTC with six decimals");
  }
  return true;
}

bool read_value(Cursor& cursor, VitalSample& sample) {
  if (cursor.skip("\"value\":")) {
    return cursor.skip("null") || cursor.number(sample.value.emplace());
  }
  if (!cursor.expect("\"rate_hz\":") || !cursor.number(sample.rate_hz)) {
    return false;
  }
  if (!(sample.rate_hz > 0)) {
    return cursor.fail("rate_hz is not a positive number");
  }
  return cursor.expect(",\"values\":") && read_values(cursor, sample.values);
}

bool read_sample(Cursor& cursor, VitalSample& sample) {
  if (!cursor.expect("{\"time_ns\":") || !cursor.number(sample.time_ns) || !cursor.expect(",")) {
    return false;
  }
  if (cursor.skip("\"device_time\":") && !(read_device_time(cursor, sample) && cursor.expect(","))) {
    return false;
  }
  if (!cursor.expect("\"code\":") || !cursor.text(sample.code) || !cursor.expect(",")) {
    return false;
  }
  if (cursor.skip("\"mdc\":")) {
    if (!cursor.number(sample.mdc) || !cursor.expect(",")) {
      return false;
    }
    if (sample.mdc == 0) {
      return cursor.fail("mdc is 0, which stands for unknown and is left out");
    }
  }
  std::string quality;
  if (!read_value(cursor, sample) || !cursor.expect(",\"unit\":") || !cursor.text(sample.unit) ||
      !cursor.expect(",\"source\":") || !cursor.text(sample.source) || !cursor.expect(",\"quality\":") ||
      !cursor.text(quality)) {
    return false;
  }
  const auto known = parse_quality(quality);
  if (!known) {
    return cursor.fail("quality is none of good, questionable, invalid, missing");
  }
  sample.quality = *known;
  return cursor.expect("}") && (cursor.at_end() || cursor.fail("there is more after the object"));
}

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
  for (const double value : sample.values) {
    if (!std::isfinite(value)) {
      return "a value is not finite";
    }
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
      append_number(line, value);
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
  Cursor cursor(line);
  VitalSample sample;
  if (!read_sample(cursor, sample)) {
    return {std::nullopt, cursor.problem()};
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

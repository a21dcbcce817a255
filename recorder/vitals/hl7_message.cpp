#include "recorder/vitals/hl7_message.h"

#include <algorithm>
#include <array>
#include <charconv>
#include <utility>

#include "crypto/utf8.h"
#include "recorder/vitals/hl7_charset.h"

namespace kiroku::recorder {
namespace {

bool is_upper(char c) { return c >= 'A' && c <= 'Z'; }
bool is_digit(char c) { return c >= '0' && c <= '9'; }
bool is_line_end(char c) { return c == '\r' || c == '\n'; }

/// Printable ASCII that is neither letter nor digit.
bool can_separate(char c) {
  return c > ' ' && c < 0x7F && !is_upper(c) && !(c >= 'a' && c <= 'z') && !is_digit(c) && c != '"';
}

bool starts_segment(std::string_view line, char field_separator) {
  return line.size() >= 3 && is_upper(line[0]) && (is_upper(line[1]) || is_digit(line[1])) &&
         (is_upper(line[2]) || is_digit(line[2])) && (line.size() == 3 || line[3] == field_separator);
}

std::vector<std::string_view> split(std::string_view text, char separator) {
  std::vector<std::string_view> parts;
  for (;;) {
    const std::size_t end = std::min(text.find(separator), text.size());
    parts.push_back(text.substr(0, end));
    if (end == text.size()) {
      return parts;
    }
    text.remove_prefix(end + 1);
  }
}

std::string_view without_wrapping(std::string_view bytes) {
  constexpr std::string_view kByteOrderMark = "\xEF\xBB\xBF";
  if (bytes.starts_with(kByteOrderMark)) {
    bytes.remove_prefix(kByteOrderMark.size());
  }
  constexpr std::string_view kBefore = " \t\r\n\x0B";
  bytes.remove_prefix(std::min(bytes.find_first_not_of(kBefore), bytes.size()));
  // A NUL at the end comes from senders that count the one of their C string.
  constexpr std::string_view kAfter("\r\n\x1C\x0B\0", 5);
  const std::size_t last = bytes.find_last_not_of(kAfter);
  return bytes.substr(0, last == std::string_view::npos ? 0 : last + 1);
}

/// Separators from "MSH|^~\&|"; a sentence in `problem` if they cannot be.
Hl7Separators read_separators(std::string_view bytes, std::vector<std::string>& remarks,
                              std::string& problem) {
  Hl7Separators separators;
  separators.field = bytes.size() > 3 ? bytes[3] : '\0';
  if (!can_separate(separators.field)) {
    problem = "MSH-1 is no field separator";
    return separators;
  }
  const std::string_view rest = bytes.substr(4);
  std::string stated(rest.substr(0, std::min(rest.find(separators.field), rest.size())));
  if (stated.size() > 6 || !std::ranges::all_of(stated, can_separate)) {
    problem = "MSH-2 names no separators";
    return separators;
  }
  if (const std::size_t doubled = stated.find("\\\\"); doubled != std::string::npos) {
    stated.erase(doubled, 1);
    remarks.emplace_back("MSH-2 has its backslash twice");
  }
  if (stated.empty()) {
    remarks.emplace_back("MSH-2 is empty; the usual separators were taken");
  } else if (stated.size() == 3 && stated[2] == '&') {
    separators = {separators.field, stated[0], stated[1], '\0', '&'};
    remarks.emplace_back("MSH-2 names no escape character");
  } else {
    // The fifth, the mark of truncated text, separates nothing.
    const std::array<char*, 4> places{&separators.component, &separators.repetition, &separators.escape,
                                      &separators.subcomponent};
    for (std::size_t i = 0; i < std::min(stated.size(), places.size()); ++i) {
      *places[i] = stated[i];
    }
  }
  std::array<char, 5> all{separators.field, separators.component, separators.repetition, separators.escape,
                          separators.subcomponent};
  std::ranges::sort(all);
  if (std::ranges::adjacent_find(all) != all.end()) {
    problem = "MSH-1 and MSH-2 name one separator twice";
  }
  return separators;
}

std::vector<std::string> stated_charsets(std::string_view bytes, const Hl7Separators& separators) {
  const std::string_view line = bytes.substr(0, bytes.find_first_of("\r\n"));
  const std::vector<std::string_view> fields = split(line, separators.field);
  constexpr std::size_t kCharset = 17;  // MSH-18: MSH-1 is the separator itself
  std::vector<std::string> charsets;
  if (fields.size() > kCharset && fields[kCharset].size() <= 200) {
    for (const std::string_view one : split(fields[kCharset], separators.repetition)) {
      charsets.emplace_back(one);
    }
  }
  return charsets;
}

/// Where the header's version (MSH-12) begins, the last field that no header is without; npos if it ends
/// before.
std::size_t end_of_required_header(std::string_view header, char separator) {
  std::size_t at = 0;
  for (int field = 2; field <= 12 && at != std::string_view::npos; ++field) {
    at = header.find(separator, at + 1);
  }
  return at;
}

/// Whether `line` begins as a header does: MSH-1, delimiters, and MSH-1 again. "MSH: 12 pg/ml" does not.
bool begins_header(std::string_view line, char separator) {
  if (line.size() < 5 || !line.starts_with("MSH") || !can_separate(line[3])) return false;
  const std::size_t end = line.find(line[3], 4);
  if (end == std::string_view::npos) return false;
  const std::string_view delimiters = line.substr(4, end - 4);
  const bool named = delimiters.size() >= 2 || line[3] == separator;
  return named && delimiters.size() <= 6 && std::ranges::all_of(delimiters, can_separate);
}

/// Whether a second header stands in `text`, at the beginning of a line or, where the line's end is missing,
/// anywhere: what separates fields does not stand within one.
bool has_second_header(std::string_view text, char separator) {
  constexpr std::size_t kLeast = 7;  // "MSH|^~|"
  const std::string_view header = text.substr(0, text.find(separator, 4));
  if (header.size() + 1 >= kLeast && header.size() < text.size() &&
      text.find(text.substr(0, header.size() + 1), header.size()) != std::string_view::npos) {
    return true;
  }
  for (std::size_t end = text.find_first_of("\r\n"); end != std::string_view::npos;
       end = text.find_first_of("\r\n", end + 1)) {
    if (begins_header(text.substr(end + 1), separator)) return true;
  }
  return false;
}

/// Where within `segment` another begins though no line ends; npos if nowhere.
std::size_t find_glued(std::string_view segment, char separator, std::size_t from) {
  constexpr std::array<std::string_view, 5> kNames{"PID", "PV1", "OBR", "OBX", "NTE"};
  for (std::size_t at = segment.find(separator, from); at != std::string_view::npos;
       at = segment.find(separator, at + 1)) {
    if (at < from + 3 || at - 3 == 0) {
      continue;
    }
    const std::string_view name = segment.substr(at - 3, 3);
    if (std::ranges::find(kNames, name) == kNames.end()) {
      continue;
    }
    const std::string_view rest = segment.substr(at + 1);
    const std::size_t digits = std::min(rest.find_first_not_of("0123456789"), rest.size());
    if (digits == rest.size() || rest[digits] != separator) {
      continue;  // every one of them begins with a set identifier, or nothing
    }
    if (name == "NTE" && digits == 0) {
      continue;  // a word can end so: PACIENTE
    }
    const std::string_view type = rest.substr(digits + 1, 4);
    const std::size_t letters = std::min(type.find(separator), type.size());
    const bool has_type =
        letters < type.size() && letters >= 2 && std::ranges::all_of(type.substr(0, letters), is_upper);
    // After a separator a field could say so itself; an observation with number and type is none.
    const bool after_separator = segment[at - 4] == separator;
    if (!after_separator || (name == "OBX" && digits > 0 && has_type)) {
      return at - 3;
    }
  }
  return std::string_view::npos;
}

bool append_hex(std::string& to, std::string_view digits) {
  std::string bytes;
  for (std::size_t i = 0; i + 1 < digits.size(); i += 2) {
    unsigned value = 0;
    const auto [end, error] = std::from_chars(digits.data() + i, digits.data() + i + 2, value, 16);
    if (error != std::errc() || end != digits.data() + i + 2) {
      return false;
    }
    bytes += static_cast<char>(value);
  }
  if (digits.empty() || digits.size() % 2 != 0 || !crypto::is_utf8(bytes)) {
    return false;
  }
  to += bytes;
  return true;
}

/// Resolves what stands between two escape characters; false if it is none that is known.
bool append_escape(std::string& to, std::string_view escape, const Hl7Separators& separators) {
  constexpr std::array<std::string_view, 7> kFormatting{".fi", ".nf", ".ce", ".in", ".ti", ".sk", "H"};
  if (escape == "F") {
    to += separators.field;
  } else if (escape == "S") {
    to += separators.component;
  } else if (escape == "T") {
    to += separators.subcomponent;
  } else if (escape == "R") {
    to += separators.repetition;
  } else if (escape == "E") {
    to += separators.escape;
  } else if (escape == "P") {
    to += '#';
  } else if (escape == ".br" || escape.starts_with(".sp")) {
    to += '\n';
  } else if (escape.starts_with('X')) {
    return append_hex(to, escape.substr(1));
  } else {
    return escape == "N" || std::ranges::any_of(kFormatting, [&](std::string_view known) {
             return escape == known || (known.size() == 3 && escape.starts_with(known));
           });
  }
  return true;
}

}  // namespace

std::vector<Hl7Field> Hl7Field::repetitions() const {
  std::vector<Hl7Field> fields;
  if (separators_ != nullptr) {
    for (const std::string_view part : split(raw_, separators_->repetition)) {
      fields.emplace_back(part, *separators_);
    }
  }
  return fields;
}

std::vector<Hl7Field> Hl7Field::components() const {
  std::vector<Hl7Field> fields;
  if (separators_ != nullptr) {
    for (const std::string_view part : split(raw_, separators_->component)) {
      fields.emplace_back(part, *separators_);
    }
  }
  return fields;
}

Hl7Field Hl7Field::component(std::size_t number) const {
  if (separators_ == nullptr) {
    return {};
  }
  std::string_view rest = raw_.substr(0, raw_.find(separators_->repetition));
  for (; number > 1; --number) {
    const std::size_t end = rest.find(separators_->component);
    if (end == std::string_view::npos) {
      return {};
    }
    rest.remove_prefix(end + 1);
  }
  return {rest.substr(0, rest.find(separators_->component)), *separators_};
}

std::string Hl7Field::text() const {
  if (separators_ == nullptr || raw_ == "\"\"") {
    return "";
  }
  if (separators_->escape == '\0' || raw_.find(separators_->escape) == std::string_view::npos) {
    return std::string(raw_);
  }
  std::string text;
  std::string_view rest = raw_;
  for (;;) {
    const std::size_t begin = rest.find(separators_->escape);
    text += rest.substr(0, begin);
    const std::size_t end =
        begin == std::string_view::npos ? begin : rest.find(separators_->escape, begin + 1);
    if (end == std::string_view::npos) {
      return begin == std::string_view::npos ? text : text + std::string(rest.substr(begin));
    }
    if (!append_escape(text, rest.substr(begin + 1, end - begin - 1), *separators_)) {
      text += rest.substr(begin, end - begin + 1);
    }
    rest.remove_prefix(end + 1);
  }
}

Hl7Field Hl7Segment::field(std::size_t number) const {
  return number < fields_.size() ? Hl7Field(fields_[number], *separators_) : Hl7Field();
}

Hl7Segment Hl7Segment::without(std::size_t number) const {
  std::vector<std::string_view> fields = fields_;
  if (number < fields.size()) {
    fields.erase(fields.begin() + static_cast<std::ptrdiff_t>(number));
  }
  return {std::move(fields), *separators_};
}

Hl7Segment Hl7Segment::with_empty(std::size_t number) const {
  std::vector<std::string_view> fields = fields_;
  if (number <= fields.size()) {
    fields.insert(fields.begin() + static_cast<std::ptrdiff_t>(number), std::string_view());
  }
  return {std::move(fields), *separators_};
}

std::string Hl7Message::type() const {
  const Hl7Field type = header().field(9);
  const std::string trigger = type.component(2).text();
  return type.component(1).text() + (trigger.empty() ? "" : "^" + trigger);
}

std::string Hl7Message::sender() const {
  std::string sender = header().field(3).component(1).text();
  if (const std::string identifier = header().field(3).component(2).text(); !identifier.empty()) {
    sender += "^" + identifier;
  }
  if (const std::string facility = header().field(4).component(1).text(); !facility.empty()) {
    sender += "/" + facility;
  }
  return sender;
}

/// Builds a message, whose constructor is private.
struct Hl7Parser {
  static Hl7Parse parse(std::string_view bytes) {
    bytes = without_wrapping(bytes);
    if (bytes.size() > Hl7Message::kMaximumBytes) {
      return {nullptr,
              "the message is longer than " + std::to_string(Hl7Message::kMaximumBytes >> 10U) + " KiB"};
    }
    if (!bytes.starts_with("MSH")) {
      return {nullptr, "the message does not begin with MSH"};
    }
    std::unique_ptr<Hl7Message> message(new Hl7Message);
    std::string problem;
    message->separators_ = read_separators(bytes, message->remarks_, problem);
    if (!problem.empty()) {
      return {nullptr, problem};
    }
    // Before anything is split: in Shift-JIS and its kin a separator's byte may be half a character.
    Utf8Text text = hl7_text_as_utf8(bytes, stated_charsets(bytes, message->separators_));
    message->text_ = std::move(text.text);
    if (!text.remark.empty()) {
      message->remarks_.push_back(std::move(text.remark));
    }
    message->holds_another_ = has_second_header(message->text_, message->separators_.field);
    split_segments(*message);
    if (message->segments_.size() > Hl7Message::kMaximumSegments) {
      return {nullptr,
              "the message has more than " + std::to_string(Hl7Message::kMaximumSegments) + " segments"};
    }
    return {std::move(message), ""};
  }

  static void split_segments(Hl7Message& message) {
    const std::string_view text = message.text_;
    const char separator = message.separators_.field;
    std::size_t begin = 0, end = 0;  // of the segment in the making
    bool continued = false;
    while (end < text.size()) {
      const std::size_t line = std::min(text.find_first_not_of("\r\n", end), text.size());
      const std::size_t line_end = std::min(text.find_first_of("\r\n", line), text.size());
      if (line == line_end) {
        break;
      }
      if (starts_segment(text.substr(line, line_end - line), separator)) {
        add(message, text.substr(begin, end - begin));
        begin = line;
      } else {
        continued = true;
      }
      end = line_end;
    }
    add(message, text.substr(begin, end - begin));
    if (continued) {
      message.remarks_.emplace_back(
          "a line begins with no segment name; it was taken to go on with the segment before");
    }
  }

  static void add(Hl7Message& message, std::string_view segment) {
    const char separator = message.separators_.field;
    while (!segment.empty() && message.segments_.size() <= Hl7Message::kMaximumSegments) {
      // A monitor may be called CLIENTE: within the header only what follows all of it is another segment.
      const std::size_t next = find_glued(
          segment, separator, segment.starts_with("MSH") ? end_of_required_header(segment, separator) : 3);
      std::vector<std::string_view> fields = split(segment.substr(0, next), separator);
      if (fields.front() == "MSH") {
        fields.insert(fields.begin() + 1, segment.substr(3, 1));
      }
      message.segments_.emplace_back(std::move(fields), message.separators_);
      if (next == std::string_view::npos) {
        return;
      }
      segment.remove_prefix(next);
      message.remarks_.push_back("the segment end before a " + std::string(segment.substr(0, 3)) +
                                 " is missing");
    }
  }
};

Hl7Parse parse_hl7_message(std::string_view bytes) { return Hl7Parser::parse(bytes); }

std::vector<std::string_view> split_hl7_messages(std::string_view bytes) {
  constexpr std::array<std::string_view, 4> kEnvelopes{"FHS", "BHS", "BTS", "FTS"};
  std::vector<std::string_view> messages;
  std::size_t begin = 0;
  bool envelope = false;
  const auto finish = [&](std::size_t end) {
    const std::string_view message = without_wrapping(bytes.substr(begin, end - begin));
    if (!message.empty() && !envelope) {
      messages.push_back(message);
    }
    begin = end;
  };
  for (std::size_t line = 0; line < bytes.size();) {
    while (line < bytes.size() &&
           (is_line_end(bytes[line]) || bytes[line] == '\x0B' || bytes[line] == '\x1C')) {
      ++line;
    }
    const std::string_view rest = bytes.substr(line);
    const bool is_envelope = rest.size() > 3 &&
                             std::ranges::find(kEnvelopes, rest.substr(0, 3)) != kEnvelopes.end() &&
                             can_separate(rest[3]);
    if (is_envelope || (rest.size() > 3 && rest.starts_with("MSH") && can_separate(rest[3]))) {
      finish(line);
      envelope = is_envelope;
    }
    line += std::min(rest.find_first_of("\r\n\x1C"), rest.size());
  }
  finish(bytes.size());
  return messages;
}

}  // namespace kiroku::recorder

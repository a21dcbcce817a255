#include "archive/format/strict_json.h"

#include <algorithm>
#include <iterator>
#include <set>

#include <nlohmann/json.hpp>

#include "crypto/encoding.h"
#include "crypto/utf8.h"

namespace kiroku::archive {

namespace {

std::string at_byte(std::size_t position, std::string_view what) {
  return "byte " + std::to_string(position) + ": " + std::string(what);
}

/// Key names in messages come from the file: shortened, and safe to print since control characters were
/// refused before.
std::string named(std::string_view key) {
  constexpr std::size_t kLongest = 40;
  std::size_t end = std::min(key.size(), kLongest);
  while (end < key.size() && end > 0 && (static_cast<unsigned char>(key[end]) & 0xC0U) == 0x80U) {
    --end;
  }
  std::string name = "\"";
  for (const char c : key.substr(0, end)) {
    name += static_cast<unsigned char>(c) < 0x20 || c == 0x7F ? '?' : c;
  }
  return name + (end < key.size() ? "…\"" : "\"");
}

/// Walks the text and tells how far the parser has come, which SAX events do not.
class CountingIterator {
 public:
  using iterator_category = std::input_iterator_tag;
  using value_type = char;
  using difference_type = std::ptrdiff_t;
  using pointer = const char*;
  using reference = const char&;

  CountingIterator(const char* at, const char** furthest) : at_(at), furthest_(furthest) {}
  reference operator*() const { return *at_; }
  CountingIterator& operator++() {
    *furthest_ = ++at_;
    return *this;
  }
  CountingIterator operator++(int) {
    CountingIterator before = *this;
    ++*this;
    return before;
  }
  friend bool operator==(const CountingIterator& a, const CountingIterator& b) { return a.at_ == b.at_; }
  friend bool operator!=(const CountingIterator& a, const CountingIterator& b) { return !(a == b); }

 private:
  const char* at_;
  const char** furthest_;
};

/// Builds the value and stops at the first thing the strict profile refuses.
class Builder {
 public:
  explicit Builder(const JsonLimits& limits) : limits_(limits) {}

  // Names and signatures are nlohmann's SAX interface.
  bool null() { return refuse("null is not allowed"); }
  bool boolean(bool value) { return add(JsonValue(JsonValue::Content(value))); }
  bool number_integer(std::int64_t value) {
    if (value <= -kJsonIntegerLimit) {
      return refuse("a number is not above -2^53");
    }
    return add(JsonValue(JsonValue::Content(value)));
  }
  bool number_unsigned(std::uint64_t value) {
    if (value >= static_cast<std::uint64_t>(kJsonIntegerLimit)) {
      return refuse("a number is not below 2^53");
    }
    return add(JsonValue(JsonValue::Content(static_cast<std::int64_t>(value))));
  }
  bool number_float(double /*value*/, const std::string& text) {
    const bool whole =
        std::all_of(text.begin(), text.end(), [](char c) { return (c >= '0' && c <= '9') || c == '-'; });
    return refuse(whole ? "a number is not below 2^53 in magnitude" : "a number is not a plain integer");
  }
  bool string(std::string& value) {
    if (value.find('\0') != std::string::npos) {
      return refuse("a text contains NUL");
    }
    return add(JsonValue(JsonValue::Content(std::move(value))));
  }
  bool binary(std::vector<std::uint8_t>& /*value*/) { return refuse("binary data is not JSON"); }
  bool start_object(std::size_t /*members*/) { return open(JsonValue(JsonValue::Content(JsonObject{}))); }
  bool start_array(std::size_t /*items*/) { return open(JsonValue(JsonValue::Content(JsonArray{}))); }
  bool key(std::string& name) {
    if (name.find('\0') != std::string::npos) {
      return refuse("a key contains NUL");
    }
    if (!levels_.back().keys.insert(name).second) {
      return refuse("the key " + named(name) + " stands twice");
    }
    levels_.back().key = std::move(name);
    return true;
  }
  bool end_object() { return close(); }
  bool end_array() { return close(); }
  bool parse_error(std::size_t /*position*/, const std::string& /*last_token*/,
                   const nlohmann::json::exception& /*error*/) {
    return refuse("this is not JSON");
  }

  [[nodiscard]] const std::string& problem() const { return problem_; }
  std::optional<JsonValue> take() { return std::move(root_); }

 private:
  struct Level {
    JsonValue value;
    std::string key;             // of the member being read
    std::set<std::string> keys;  // all so far
  };

  bool refuse(std::string what) {
    problem_ = std::move(what);
    return false;
  }
  bool open(JsonValue value) {
    if (levels_.size() == limits_.depth) {
      return refuse("nesting is deeper than " + std::to_string(limits_.depth) + " levels");
    }
    levels_.push_back({std::move(value), {}, {}});
    return true;
  }
  bool close() {
    JsonValue done = std::move(levels_.back().value);
    levels_.pop_back();
    return add(std::move(done));
  }
  bool add(JsonValue value) {
    if (++values_ > limits_.values) {
      return refuse("there are more than " + std::to_string(limits_.values) + " values");
    }
    if (levels_.empty()) {
      root_ = std::move(value);
    } else if (auto* array = std::get_if<JsonArray>(&levels_.back().value.content())) {
      array->push_back(std::move(value));
    } else {
      std::get<JsonObject>(levels_.back().value.content())
          .emplace_back(std::move(levels_.back().key), std::move(value));
    }
    return true;
  }

  JsonLimits limits_;
  std::size_t values_ = 0;
  std::vector<Level> levels_;
  std::optional<JsonValue> root_;
  std::string problem_;
};

/// What may not stand in the text at all, before any parsing.
std::optional<JsonParse> refuse_bytes(std::string_view text) {
  for (std::size_t at = 0; at < text.size();) {
    const auto c = static_cast<unsigned char>(text[at]);
    const std::size_t length = c < 0x80 ? 1 : utf8_length(text.substr(at));
    std::string_view what;
    if (c == 0) {
      what = "NUL is not allowed";
    } else if (c < 0x20) {
      what = "a control character is not allowed";
    } else if (length == 0) {
      what = "this is not UTF-8";
    } else if (at == 0 && text.starts_with("\xEF\xBB\xBF")) {
      what = "a byte order mark is not allowed";
    }
    if (!what.empty()) {
      return JsonParse{std::nullopt, at, at_byte(at, what)};
    }
    at += length;
  }
  return std::nullopt;
}

/// As parse_json(), of a text that went through refuse_bytes().
JsonParse parse_any_json(std::string_view text, const JsonLimits& limits) {
  const char* furthest = text.data();
  Builder builder(limits);
  const char* end = text.data() + text.size();
  const bool read =
      nlohmann::json::sax_parse(CountingIterator(text.data(), &furthest), CountingIterator(end, &furthest),
                                &builder, nlohmann::json::input_format_t::json, true);
  if (!read) {
    // The parser has consumed the character that ends a token; the problem is at or before it.
    const auto consumed = static_cast<std::size_t>(furthest - text.data());
    const std::size_t position = consumed == 0 ? 0 : consumed - 1;
    return {std::nullopt, position, at_byte(position, builder.problem())};
  }
  return {builder.take(), 0, {}};
}

/// Reads what programs write: no blanks, no escapes, integers of few digits, keys once each. A ledger of
/// hours has tens of thousands of such lines. Of anything else it reads nothing, so that what is refused, and
/// why, is decided in one place. Its text went through refuse_bytes().
class PlainReader {
 public:
  PlainReader(std::string_view text, const JsonLimits& limits) : text_(text), limits_(limits) {}

  std::optional<JsonValue> read() {
    std::optional<JsonValue> value = take_value(0);
    return at_ == text_.size() ? std::move(value) : std::nullopt;
  }

 private:
  static constexpr std::size_t kUsualMembers = 16, kMostMembers = 64;
  static constexpr std::size_t kMostDigits = 15;  // below 2^53 whatever they are

  [[nodiscard]] char next() const { return at_ < text_.size() ? text_[at_] : '\0'; }
  bool take(char token) {
    const bool is_there = next() == token;
    at_ += is_there ? 1 : 0;
    return is_there;
  }
  bool take(std::string_view token) {
    if (!text_.substr(at_).starts_with(token)) return false;
    at_ += token.size();
    return true;
  }

  std::optional<JsonValue> take_value(std::size_t depth) {
    if (++values_ > limits_.values) return {};
    switch (next()) {
      case '"':
        if (const auto text = take_text()) return JsonValue(JsonValue::Content(std::string(*text)));
        return {};
      case '{':
        return depth < limits_.depth ? take_object(depth + 1) : std::nullopt;
      case '[':
        return depth < limits_.depth ? take_array(depth + 1) : std::nullopt;
      case 't':
        return take("true") ? std::optional(JsonValue(JsonValue::Content(true))) : std::nullopt;
      case 'f':
        return take("false") ? std::optional(JsonValue(JsonValue::Content(false))) : std::nullopt;
      default:
        return take_integer();
    }
  }

  std::optional<std::string_view> take_text() {
    if (!take('"')) return {};
    const std::size_t begin = at_;
    while (at_ < text_.size() && text_[at_] != '"' && text_[at_] != '\\') ++at_;
    const std::string_view text = text_.substr(begin, at_ - begin);
    return take('"') ? std::optional(text) : std::nullopt;
  }

  std::optional<JsonValue> take_integer() {
    const bool is_negative = take('-');
    const std::size_t begin = at_;
    std::int64_t value = 0;
    for (; next() >= '0' && next() <= '9' && at_ - begin < kMostDigits; ++at_)
      value = value * 10 + (next() - '0');
    // Behind the digits only what ends a value is taken: no further digit, fraction or exponent.
    const bool is_plain = at_ - begin == 1 ? value != 0 || !is_negative : at_ > begin && text_[begin] != '0';
    if (!is_plain || (next() != ',' && next() != '}' && next() != ']')) return {};
    return JsonValue(JsonValue::Content(is_negative ? -value : value));
  }

  std::optional<JsonValue> take_array(std::size_t depth) {
    JsonArray items;
    take('[');
    if (take(']')) return JsonValue(JsonValue::Content(std::move(items)));
    do {
      std::optional<JsonValue> item = take_value(depth);
      if (!item) return {};
      items.push_back(std::move(*item));
    } while (take(','));
    return take(']') ? std::optional(JsonValue(JsonValue::Content(std::move(items)))) : std::nullopt;
  }

  std::optional<JsonValue> take_object(std::size_t depth) {
    JsonObject members;
    take('{');
    if (take('}')) return JsonValue(JsonValue::Content(std::move(members)));
    if (depth == 1) members.reserve(kUsualMembers);
    do {
      const std::optional<std::string_view> key = take_text();
      if (!key || !take(':') || members.size() == kMostMembers) return {};
      for (const auto& member : members) {
        if (member.first == *key) return {};
      }
      std::optional<JsonValue> value = take_value(depth);
      if (!value) return {};
      members.emplace_back(*key, std::move(*value));
    } while (take(','));
    return take('}') ? std::optional(JsonValue(JsonValue::Content(std::move(members)))) : std::nullopt;
  }

  const std::string_view text_;
  const JsonLimits& limits_;
  std::size_t at_ = 0, values_ = 0;
};

enum Kind : std::size_t { kBoolean, kInteger, kText, kArray, kObject };

}  // namespace

std::size_t utf8_length(std::string_view text) {
  constexpr std::size_t kLongest = 4;
  for (std::size_t length = 1; length <= std::min(kLongest, text.size()); ++length) {
    if (crypto::is_utf8(text.substr(0, length))) {
      return length;
    }
  }
  return 0;
}

JsonParse parse_json(std::string_view text, const JsonLimits& limits) {
  if (text.size() > limits.bytes) {
    return {std::nullopt, limits.bytes,
            at_byte(limits.bytes, "the text is longer than " + std::to_string(limits.bytes) + " bytes")};
  }
  if (std::optional<JsonParse> refused = refuse_bytes(text)) {
    return *refused;
  }
  if (std::optional<JsonValue> plain = PlainReader(text, limits).read()) {
    return {std::move(plain), 0, {}};
  }
  return parse_any_json(text, limits);
}

JsonFields::JsonFields(const JsonValue& value, std::string where, std::string& problem)
    : object_(std::get_if<JsonObject>(&value.content())), where_(std::move(where)), problem_(&problem) {
  if (object_ == nullptr) {
    if (!failed()) {
      *problem_ = where_ + " is not an object";
    }
    return;
  }
  taken_.resize(object_->size(), false);
}

bool JsonFields::has(std::string_view key) const {
  return object_ != nullptr && std::any_of(object_->begin(), object_->end(),
                                           [&](const auto& member) { return member.first == key; });
}

void JsonFields::refuse(std::string_view key, std::string_view what) {
  if (!failed()) {
    *problem_ = where_ + ": " + named(key) + " " + std::string(what);
  }
}

const JsonValue* JsonFields::take(std::string_view key, std::size_t kind, std::string_view kind_name) {
  if (failed()) {
    return nullptr;
  }
  const auto found =
      std::find_if(object_->begin(), object_->end(), [&](const auto& member) { return member.first == key; });
  if (found == object_->end()) {
    refuse(key, "is missing");
    return nullptr;
  }
  taken_[static_cast<std::size_t>(found - object_->begin())] = true;
  if (found->second.content().index() != kind) {
    refuse(key, "is not " + std::string(kind_name));
    return nullptr;
  }
  return &found->second;
}

std::string JsonFields::text(std::string_view key) {
  const JsonValue* value = take(key, kText, "a text");
  return value == nullptr ? std::string() : std::get<std::string>(value->content());
}

std::vector<std::string> JsonFields::texts(std::string_view key) {
  std::vector<std::string> all;
  if (const JsonValue* value = take(key, kArray, "a list of texts")) {
    for (const JsonValue& item : std::get<JsonArray>(value->content())) {
      const auto* text = std::get_if<std::string>(&item.content());
      if (text == nullptr) {
        refuse(key, "is not a list of texts");
        return {};
      }
      all.push_back(*text);
    }
  }
  return all;
}

std::int64_t JsonFields::integer(std::string_view key) {
  const JsonValue* value = take(key, kInteger, "an integer");
  return value == nullptr ? 0 : std::get<std::int64_t>(value->content());
}

std::uint64_t JsonFields::count(std::string_view key) {
  const std::int64_t value = integer(key);
  if (value < 0) {
    refuse(key, "is negative");
    return 0;
  }
  return static_cast<std::uint64_t>(value);
}

bool JsonFields::flag(std::string_view key) {
  const JsonValue* value = take(key, kBoolean, "true or false");
  return value != nullptr && std::get<bool>(value->content());
}

crypto::Sha256Digest JsonFields::digest(std::string_view key) {
  crypto::Sha256Digest digest{};
  const JsonValue* value = take(key, kText, "a text");
  if (value == nullptr) {
    return digest;
  }
  const std::optional<Bytes> bytes = crypto::from_hex(std::get<std::string>(value->content()));
  if (!bytes || bytes->size() != digest.size()) {
    refuse(key, "is not a SHA-256 hash in 64 lower-case hex digits");
    return digest;
  }
  std::copy(bytes->begin(), bytes->end(), digest.begin());
  return digest;
}

UtcTime JsonFields::utc(std::string_view key) {
  constexpr std::size_t kWritten = std::string_view("2026-08-05T09:15:02.000123Z").size();
  const JsonValue* value = take(key, kText, "a text");
  if (value == nullptr) {
    return {};
  }
  const auto& written = std::get<std::string>(value->content());
  // Of this length it has all six decimals, and so is written as format_utc() does.
  const std::optional<UtcTime> time = written.size() == kWritten ? parse_utc(written) : std::nullopt;
  if (!time) {
    refuse(key, "is not a UTC time such as 2026-08-05T09:15:02.000123Z");
    return {};
  }
  return *time;
}

JsonFields JsonFields::object(std::string_view key) {
  static const JsonValue kEmpty{JsonValue::Content(JsonObject{})};
  const JsonValue* value = take(key, kObject, "an object");
  return {value == nullptr ? kEmpty : *value, std::string(key), *problem_};
}

std::vector<JsonFields> JsonFields::objects(std::string_view key) {
  std::vector<JsonFields> all;
  if (const JsonValue* value = take(key, kArray, "a list of objects")) {
    for (const JsonValue& item : std::get<JsonArray>(value->content())) {
      all.emplace_back(item, std::string(key) + "[" + std::to_string(all.size()) + "]", *problem_);
    }
  }
  return all;
}

std::vector<std::pair<std::string, JsonFields>> JsonFields::members() {
  std::vector<std::pair<std::string, JsonFields>> all;
  if (failed()) {
    return all;
  }
  taken_.assign(taken_.size(), true);
  for (const auto& [key, value] : *object_) {
    all.emplace_back(key, JsonFields(value, where_ + "." + key, *problem_));
  }
  return all;
}

void JsonFields::no_more() {
  if (failed()) {
    return;
  }
  const auto unknown = std::find(taken_.begin(), taken_.end(), false);
  if (unknown != taken_.end()) {
    refuse((*object_)[static_cast<std::size_t>(unknown - taken_.begin())].first, "is not known here");
  }
}

}  // namespace kiroku::archive

#include "archive/format/event_line.h"

#include <utility>

#include <nlohmann/json.hpp>

#include "base/bytes.h"
#include "base/foreign_json.h"
#include "crypto/encoding.h"

namespace kiroku::archive {

namespace {

constexpr std::size_t kSaltDigits = 64;

/// Whether each of its keys is one of the two, and stands once: readers take another one of two.
bool has_each_key_once(std::string_view line) {
  bool has_salt = false, has_event = false, is_other = false;
  const auto look = [&](int /*depth*/, nlohmann::json::parse_event_t event, nlohmann::json& value) {
    if (event != nlohmann::json::parse_event_t::key) return true;
    bool& has = value == "salt" ? has_salt : value == "event" ? has_event : is_other;
    is_other = is_other || has;
    has = true;
    return true;
  };
  const nlohmann::json ignored = nlohmann::json::parse(line, look, false);
  return has_salt && has_event && !is_other;
}

}  // namespace

std::optional<EventLine> parse_event_line(std::string_view line) {
  const nlohmann::json parsed = parse_foreign_json(line);
  if (!parsed.is_object() || !has_each_key_once(line)) return std::nullopt;
  const auto salt = parsed.find("salt"), event = parsed.find("event");
  if (salt == parsed.end() || event == parsed.end() || !salt->is_string() || !event->is_string())
    return std::nullopt;
  const std::string& digits = salt->get_ref<const std::string&>();
  if (digits.size() != kSaltDigits || digits.find_first_not_of("0123456789abcdef") != std::string::npos)
    return std::nullopt;
  std::optional<Bytes> committed = crypto::from_hex(digits);
  if (!committed) return std::nullopt;
  EventLine read{event->get<std::string>(), {}};
  append(*committed, bytes_of(read.event));
  read.commitment = crypto::sha256(*committed);
  return read;
}

}  // namespace kiroku::archive

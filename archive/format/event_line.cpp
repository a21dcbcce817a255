#include "archive/format/event_line.h"

#include <utility>

#include <nlohmann/json.hpp>

#include "base/bytes.h"
#include "base/foreign_json.h"
#include "crypto/encoding.h"

namespace kiroku::archive {

std::optional<EventLine> parse_event_line(std::string_view line) {
  const nlohmann::json parsed = parse_foreign_json(line);
  if (!parsed.is_object()) return std::nullopt;
  const auto salt = parsed.find("salt"), event = parsed.find("event");
  if (salt == parsed.end() || event == parsed.end() || !salt->is_string() || !event->is_string())
    return std::nullopt;
  std::optional<Bytes> committed = crypto::from_hex(salt->get_ref<const std::string&>());
  if (!committed) return std::nullopt;
  EventLine read{event->get<std::string>(), {}};
  append(*committed, bytes_of(read.event));
  read.commitment = crypto::sha256(*committed);
  return read;
}

}  // namespace kiroku::archive

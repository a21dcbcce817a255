#include "apps/kiroku/log_lines.h"

#include <nlohmann/json.hpp>

#include "base/printable.h"

namespace kiroku::apps {
namespace {

using nlohmann::ordered_json;

/// The text of a field, in quotation marks where it could be read as several: whoever may invite a guest
/// chooses the guest's name.
std::string shown_field(const std::string& text) {
  constexpr std::size_t kMost = 1'000;
  const bool is_long = text.size() > kMost;
  const std::string beginning = printable(text.substr(0, kMost));
  const bool is_one = beginning.find_first_of(" \"=") == std::string::npos;
  return (is_one ? beginning : ordered_json(beginning).dump()) +
         (is_long ? "\u2026 (" + std::to_string(text.size()) + " bytes; --json has all)" : "");
}

}  // namespace

std::string entry_details(const std::string& line) {
  std::string out;
  const ordered_json entry = ordered_json::parse(line);
  for (const auto& [key, value] : entry.items()) {
    if (key == "type" || key == "seq" || key == "utc" || key == "mono_ns") continue;
    out += (out.empty() ? "" : "  ") + key + "=" +
           (value.is_string() ? shown_field(value.get<std::string>()) : value.dump());
  }
  return out;
}

}  // namespace kiroku::apps

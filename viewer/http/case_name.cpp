#include "viewer/http/case_name.h"

#include "archive/format/case_layout.h"

namespace kiroku::viewer {

bool is_case_name(std::string_view text) {
  return archive::is_case_id(text) || parse_stored_case_name(text).has_value();
}

std::string stored_case_name(std::string_view appliance, std::string_view case_id) {
  return std::string(appliance) + "~" + std::string(case_id);
}

std::optional<std::pair<std::string, std::string>> parse_stored_case_name(std::string_view name) {
  const std::size_t sign = name.find('~');
  if (sign == std::string_view::npos) return {};
  const std::string_view appliance = name.substr(0, sign), case_id = name.substr(sign + 1);
  if (!archive::is_short_name(appliance) || !archive::is_case_id(case_id)) return {};
  return std::pair(std::string(appliance), std::string(case_id));
}

}  // namespace kiroku::viewer

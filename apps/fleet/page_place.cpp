#include "apps/fleet/page_place.h"

namespace kiroku::apps {

std::string page_place(const fleet::FleetCase& last) {
  return format_utc(last.row.opened) + "," + last.appliance + "," + last.row.case_id;
}

std::optional<fleet::CaseQuery::Place> parse_page_place(const std::string& text) {
  const std::size_t first = text.find(','), second = text.find(',', first + 1);
  if (first == std::string::npos || second == std::string::npos) return {};
  const std::optional<UtcTime> opened = parse_utc(text.substr(0, first));
  if (!opened) return {};
  return fleet::CaseQuery::Place{*opened, text.substr(first + 1, second - first - 1),
                                 text.substr(second + 1)};
}

}  // namespace kiroku::apps

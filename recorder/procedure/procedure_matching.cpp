#include "recorder/procedure/procedure_matching.h"

#include <algorithm>
#include <set>
#include <utility>

#include "base/ascii.h"
#include "recorder/procedure/window.h"

namespace kiroku::recorder {

bool is_of_room(const ProcedureRule& rule, const std::string& place) {
  return std::ranges::any_of(rule.locations,
                             [&](const std::string& location) { return same_but_for_case(place, location); });
}

bool is_meant_by(const ProcedureRule& rule, const std::string& place) {
  return rule.locations.empty() ? place.empty() : !place.empty() && is_of_room(rule, place);
}

std::string name_of_room(const ProcedureRule& rule) {
  std::set<std::string> locations;
  for (const std::string& each : rule.locations) locations.insert(lower_case(each));
  std::string name;
  for (const std::string& each : locations) name += each + "\n";
  return name;
}

bool is_named(const ProcedureRule& rule, std::string_view name) {
  if (rule.locations.empty() || name.empty()) return rule.locations.empty() && name.empty();
  while (!name.empty()) {
    const std::size_t end = name.find('\n');
    if (is_of_room(rule, std::string(name.substr(0, end)))) return true;
    name.remove_prefix(end == std::string_view::npos ? name.size() : end + 1);
  }
  return false;
}

std::vector<std::string_view> whole_places(const std::vector<std::string>& places) {
  std::vector<std::string_view> whole;
  for (const std::string& place : places) {
    const bool is_part = std::ranges::any_of(places, [&](const std::string& other) {
      return other.size() > place.size() && ("^" + other + "^").find("^" + place + "^") != std::string::npos;
    });
    if (!is_part) whole.emplace_back(place);
  }
  return whole;
}

bool share_a_place(const std::vector<std::string>& one, const std::vector<std::string>& other) {
  const auto has_any = [](const std::vector<std::string>& places, std::string_view whole) {
    return std::ranges::any_of(places,
                               [&](const std::string& place) { return same_but_for_case(place, whole); });
  };
  return std::ranges::any_of(whole_places(one), [&](auto whole) { return has_any(other, whole); }) ||
         std::ranges::any_of(whole_places(other), [&](auto whole) { return has_any(one, whole); });
}

bool are_two_visits(const ProcedureMessage& one, const ProcedureMessage& other) {
  return !one.visit.empty() && !other.visit.empty() && !read_alike(one.visit, other.visit);
}

bool are_two_accounts(const ProcedureMessage& one, const ProcedureMessage& other) {
  return !one.account.empty() && !other.account.empty() && one.sender == other.sender &&
         one.account != other.account;
}

bool is_another_name(const PersonName& one, const PersonName& other) {
  if (one.empty() || other.empty()) return false;
  const std::string given = lower_case(one.given), others = lower_case(other.given);
  return !same_but_for_case(one.family, other.family) ||
         (!given.starts_with(others) && !others.starts_with(given));
}

bool is_newborn(const std::string& birth_date, UtcTime at) {
  constexpr std::chrono::hours kNewborn{3 * 24};
  constexpr std::size_t kWhole = 10;
  const std::optional<UtcTime> born =
      birth_date.size() == kWhole ? parse_utc(birth_date + "T00:00:00Z") : std::nullopt;
  return born && is_within(*born, at, kNewborn);
}

bool is_of_appointment(const ProcedureMessage& message) {
  return message.kind == ProcedureMessage::Kind::kAppointment ||
         message.kind == ProcedureMessage::Kind::kCancels;
}

bool is_record(const ProcedureMessage& message) { return message.is_of_record || message.corrects; }

ProcedureMessage before_merging(const ProcedureMessage& merging) {
  ProcedureMessage before;
  before.patient = merging.replaces;
  before.numbers = merging.replaced_numbers;
  before.data.patient = merging.data.patient;
  before.data.birth_date = merging.data.birth_date;
  return before;
}

void leave_identity(ProcedureMessage& message) {
  ProcedureData data;
  data.patient_id = message.data.patient_id;
  data.patient_id_issuer = message.data.patient_id_issuer;
  data.patient = message.data.patient;
  data.birth_date = message.data.birth_date;
  message.data = std::move(data);
  message.places.clear();
  message.planned_places.clear();
}

}  // namespace kiroku::recorder

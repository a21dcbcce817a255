#include "recorder/vitals/hl7_patient_part.h"

#include <algorithm>
#include <array>

#include "base/ascii.h"
#include "base/error.h"

namespace kiroku::recorder {
namespace {

constexpr std::size_t kPlaceComponents = 3;  // point of care, room, bed
constexpr std::size_t kFacility = 4;

std::vector<Hl7Field> subcomponents(const Hl7Field& component, const Hl7Separators& separators) {
  std::vector<Hl7Field> parts;
  std::string_view rest = component.raw();
  for (;;) {
    const std::size_t end = std::min(rest.find(separators.subcomponent), rest.size());
    parts.emplace_back(rest.substr(0, end), separators);
    if (end == rest.size()) return parts;
    rest.remove_prefix(end + 1);
  }
}

std::string without_end(std::string text, char end) {
  while (text.ends_with(end)) text.pop_back();
  return text;
}

/// Adds the ways to write the place that a field names; all of it, or "".
std::string add_place(const Hl7Field& field, const Hl7Separators& separators,
                      std::vector<std::string>& spellings) {
  std::string whole, short_one;
  const auto add = [&](const std::string& text) {
    if (!text.empty()) spellings.push_back(text);
  };
  for (std::size_t number = 1; number <= kPlaceComponents; ++number) {
    const Hl7Field component = field.component(number);
    std::string full, first;
    if (!component.empty()) {
      const std::vector<Hl7Field> parts = subcomponents(component, separators);
      first = parts.front().text();
      for (const Hl7Field& part : parts) {
        full += (&part == &parts.front() ? "" : "&") + part.text();
        add(part.text());
      }
      full = without_end(full, '&');
      if (parts.size() > 1) add(full);
    }
    whole += (number == 1 ? "" : "^") + full;
    short_one += (number == 1 ? "" : "^") + first;
  }
  // PL.4: two hospitals may have a bed of one name.
  const std::string facility =
      field.component(kFacility).empty() ? "" : first_subcomponent(field.component(kFacility), separators);
  if (!facility.empty() && !without_end(short_one, '^').empty()) add(short_one + "^" + facility);
  whole = without_end(whole, '^');
  add(whole);
  add(without_end(short_one, '^'));
  return whole;
}

std::string percent_decoded(std::string_view text) {
  std::string decoded(text);
  for (const auto& [code, sign] : {std::pair{"%26", "&"}, std::pair{"%2c", ","}, std::pair{"%25", "%"}}) {
    for (std::size_t at = decoded.find(code); at != std::string::npos; at = decoded.find(code, at + 1)) {
      decoded.replace(at, 3, sign);
    }
  }
  return decoded;
}

}  // namespace

bool is_type_of_account(const std::string& type) {
  constexpr std::array<std::string_view, 5> kOfAccounts{"AN", "ANC", "AND", "ANT", "VN"};
  return std::ranges::find(kOfAccounts, type) != kOfAccounts.end();
}

Hl7Field chosen_identifier(const Hl7Field& list, const Hl7Field& older) {
  const std::vector<Hl7Field> identifiers = list.repetitions();
  const auto record_number = std::ranges::find_if(identifiers, [](const Hl7Field& one) {
    return one.component(5).text() == "MR" && !one.component(1).empty();
  });
  if (record_number != identifiers.end()) return *record_number;
  const auto persons = std::ranges::find_if(identifiers, [](const Hl7Field& one) {
    return !one.component(1).empty() && !is_type_of_account(one.component(5).text());
  });
  if (persons != identifiers.end()) return *persons;
  return list.component(1).empty() ? older : identifiers.front();
}

std::string first_subcomponent(const Hl7Field& component, const Hl7Separators& separators) {
  return Hl7Field(component.raw().substr(0, component.raw().find(separators.subcomponent)), separators)
      .text();
}

PatientNumber number_of(const Hl7Field& cx, bool is_of_account, const Hl7Separators& separators) {
  PatientNumber number{cx.component(1).text(), first_subcomponent(cx.component(4), separators), "",
                       cx.component(5).text()};
  const std::string_view issuer = cx.component(4).raw();
  const std::size_t first = issuer.find(separators.subcomponent);
  if (first != std::string_view::npos)
    number.issuer_id = first_subcomponent(Hl7Field(issuer.substr(first + 1), separators), separators);
  number.is_of_account = is_of_account || is_type_of_account(number.type);
  return number;
}

void take_numbers(std::vector<PatientNumber>& into, const Hl7Field& list, bool is_of_account,
                  const Hl7Separators& separators) {
  for (const Hl7Field& each : list.repetitions()) {
    if (!each.component(1).empty()) add_numbers(into, {number_of(each, is_of_account, separators)});
  }
}

std::vector<PatientNumber> numbers_of(const Hl7Segment& pid, const Hl7Separators& separators) {
  std::vector<PatientNumber> numbers;
  take_numbers(numbers, chosen_identifier(pid.field(3), pid.field(2)), false, separators);
  take_numbers(numbers, pid.field(3), false, separators);
  take_numbers(numbers, pid.field(2), false, separators);
  take_numbers(numbers, pid.field(18), true, separators);
  return numbers;
}

std::vector<PatientPart> patient_parts(const Hl7Message& message) {
  const Hl7Separators& separators = message.separators();
  const std::vector<Hl7Segment>& segments = message.segments();
  std::vector<PatientPart> parts(1);
  bool has_patient = false, has_visit = false, has_orders = false;
  for (std::size_t i = 0; i < segments.size(); ++i) {
    const Hl7Segment& segment = segments[i];
    const std::string_view name = segment.name();
    const bool is_patient = name == "PID", is_visit = name == "PV1";
    const bool begins =
        (is_patient && (has_patient || has_orders)) || (is_visit && (has_visit || has_orders));
    if (begins) {
      parts.back().end = i;
      // Another visit of the same patient.
      PatientPart next;
      next.begin = i;
      if (is_visit) {
        next.patient = parts.back().patient;
        next.numbers = parts.back().numbers;
        next.issuer = parts.back().issuer;
      }
      parts.push_back(std::move(next));
      has_patient = has_visit = has_orders = false;
    }
    PatientPart& part = parts.back();
    if (is_patient) {
      const Hl7Field identifier = chosen_identifier(segment.field(3), segment.field(2));
      part.patient = identifier.component(1).text();
      const Hl7Field issuer = identifier.component(4);
      part.issuer = issuer.empty() ? "" : first_subcomponent(issuer, separators);
      part.numbers = numbers_of(segment, separators);
    } else if (is_visit) {
      const std::string usual = add_place(segment.field(3), separators, part.spellings);
      const std::string temporary = add_place(segment.field(11), separators, part.spellings);
      part.place = usual.empty() ? temporary : usual;
    }
    has_patient = has_patient || is_patient;
    has_visit = has_visit || is_visit;
    has_orders = has_orders || name == "OBR" || name == "OBX";
    part.observes = part.observes || name == "OBX";
  }
  parts.back().end = segments.size();
  return parts;
}

PlaceList PlaceList::parse(std::string_view text, const std::string& source) {
  PlaceList list;
  for (;;) {
    const std::size_t comma = text.find(',');
    const std::string place = percent_decoded(lower_case(text.substr(0, comma)));
    if (place.empty()) {
      throw UsageError("source '" + source +
                       "': locations names places as PV1-3 of their messages has them, such as OR1 or "
                       "SURGERY^OR1; separate several with commas");
    }
    list.places_.push_back(place);
    if (comma == std::string_view::npos) return list;
    text.remove_prefix(comma + 1);
  }
}

bool PlaceList::takes(const PatientPart& part) const {
  return places_.empty() || std::ranges::any_of(part.spellings, [&](const std::string& spelling) {
           return std::ranges::find(places_, lower_case(spelling)) != places_.end();
         });
}

}  // namespace kiroku::recorder

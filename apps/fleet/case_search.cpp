#include "apps/fleet/case_search.h"

#include <optional>
#include <tuple>
#include <utility>

#include "base/error.h"

namespace kiroku::apps {

search::SearchWords search_words(const SubjectAsked& asked, const SubjectNames& names) {
  if (asked.patient.empty() && asked.procedure.empty())
    throw UsageError("to search give " + names.patient + " or " + names.procedure + " or both");
  if (!asked.authority.empty() && asked.patient.empty())
    throw UsageError(names.authority + " stands beside " + names.patient);
  if (!asked.coding_system.empty() && asked.procedure.empty())
    throw UsageError(names.coding_system + " stands beside " + names.procedure);
  const auto normal = [](const std::string& text, const std::string& name, auto form) {
    std::string word = form(text);
    if (word.empty() && !text.empty()) throw UsageError("of what " + name + " says nothing can be searched");
    return word;
  };
  return {normal(asked.patient, names.patient, search::normal_number),
          normal(asked.authority, names.authority, search::normal_word),
          normal(asked.procedure, names.procedure, search::normal_word),
          normal(asked.coding_system, names.coding_system, search::normal_word)};
}

Searched search_cases(fleet::FleetCatalogue& catalogue, fleet::CaseQuery query, search::NoteReader& reader,
                      const search::SearchWords& words) {
  constexpr std::size_t kAtOnce = 2000;
  const std::size_t most = std::exchange(query.limit, kAtOnce);
  const std::optional<fleet::CaseQuery::Place> after = std::exchange(query.after, std::nullopt);
  query.with_notes = true;
  const auto place_of = [](const fleet::FleetCase& one) {
    return fleet::CaseQuery::Place{one.row.opened, one.appliance, one.row.case_id};
  };
  const auto is_before = [](const fleet::CaseQuery::Place& one, const fleet::CaseQuery::Place& other) {
    return std::tie(one.opened, one.appliance, one.case_id) <
           std::tie(other.opened, other.appliance, other.case_id);
  };
  Searched result;
  while (true) {
    const std::vector<fleet::FleetCase> page = catalogue.find(query);
    for (const fleet::FleetCase& each : page) {
      ++result.looked_at;
      if (!each.search_note) {
        ++result.without_note;
        continue;
      }
      const auto note = search::SearchNote::parse(*each.search_note);
      using Answer = search::NoteReader::Answer;
      const Answer answer =
          note ? reader.read(each.appliance, each.row.case_id, *note, words) : Answer::kForeign;
      if (answer == Answer::kForeign) ++result.foreign;
      // Newest first.
      if (answer != Answer::kFits || (after && !is_before(place_of(each), *after))) continue;
      if (result.found.size() < most) {
        result.found.push_back(each);
      } else {
        result.is_all = false;
      }
    }
    if (page.size() < kAtOnce) return result;
    query.after = place_of(page.back());
  }
}

}  // namespace kiroku::apps

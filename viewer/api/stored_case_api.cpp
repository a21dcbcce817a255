// The list of all appliances' cases, and what is known of the appliances.
#include <nlohmann/json.hpp>

#include "archive/catalogue/catalogue_json.h"
#include "base/json_or_null.h"
#include "viewer/api/api.h"
#include "viewer/api/stored_cases.h"
#include "viewer/http/case_name.h"
#include "viewer/people/json_fields.h"

namespace kiroku::viewer {
namespace {

using nlohmann::ordered_json;

constexpr std::int64_t kUsualRows = 50;
constexpr std::int64_t kMostRows = 500;

ordered_json row_json(const StoredCase& one) {
  ordered_json out{{"id", stored_case_name(one.appliance, one.row.case_id)},
                   {"appliance", one.appliance},
                   {"case", one.row.case_id}};
  out.update(archive::catalogue_json(one.row));
  out["alarm"] = one.alarm;
  out["unchecked"] = or_null(one.unchecked);
  return out;
}

ordered_json cases_json(const StoredCasesPage& page) {
  ordered_json cases = ordered_json::array();
  for (const StoredCase& each : page.cases) cases.push_back(row_json(each));
  return cases;
}

std::optional<UtcTime> time_of(const std::optional<std::string>& text, const char* name) {
  if (!text) return {};
  const std::optional<UtcTime> time = parse_utc(*text);
  if (!time) throw Refusal(400, std::string("'") + name + "' is no time such as 2026-08-05T09:15:02Z");
  return time;
}

bool flag_of(const Request& request, const char* name) {
  const std::optional<std::string> text = request.query_text(name);
  if (text && *text != "true" && *text != "false")
    throw Refusal(400, std::string("'") + name + "' is neither true nor false");
  return text == "true";
}

std::size_t limit_of(std::int64_t limit) {
  if (limit < 1 || limit > kMostRows)
    throw Refusal(400, "'limit' must be from 1 to " + std::to_string(kMostRows));
  return static_cast<std::size_t>(limit);
}

StoredCasesQuestion question_of(const Request& request) {
  StoredCasesQuestion question;
  question.appliance = request.query_text("appliance");
  question.state = request.query_text("state");
  question.verdict = request.query_text("verdict");
  question.unverified = flag_of(request, "unverified");
  question.needs_a_person = flag_of(request, "attention");
  question.opened_from = time_of(request.query_text("from"), "from");
  question.opened_before = time_of(request.query_text("before"), "before");
  question.after = request.query_text("after");
  question.limit = limit_of(request.query_integer("limit").value_or(kUsualRows));
  return question;
}

/// "" where it is absent.
std::string text_of(const nlohmann::json& asked, const char* key) {
  return asked.contains(key) ? take_text(asked, key) : std::string();
}

StoredCasesQuestion question_of(const nlohmann::json& asked) {
  const auto text = [&](const char* key) {
    return asked.contains(key) ? std::optional(take_text(asked, key)) : std::nullopt;
  };
  const auto flag = [&](const char* key) {
    const auto found = asked.find(key);
    if (found == asked.end()) return false;
    if (!found->is_boolean()) throw Refusal(400, std::string("'") + key + "' is neither true nor false");
    return found->get<bool>();
  };
  StoredCasesQuestion question;
  question.appliance = text("appliance");
  question.state = text("state");
  question.verdict = text("verdict");
  question.unverified = flag("unverified");
  question.needs_a_person = flag("attention");
  question.opened_from = time_of(text("from"), "from");
  question.opened_before = time_of(text("before"), "before");
  question.after = text("after");
  const auto limit = asked.find("limit");
  if (limit != asked.end() && !limit->is_number_integer())
    throw Refusal(400, "'limit' must be a whole number");
  question.limit = limit_of(limit == asked.end() ? kUsualRows : limit->get<std::int64_t>());
  return question;
}

/// Nobody searches unseen: it is in the log before the answer is known. Whom they sought is not.
Response search_cases(ViewerContext& context, const Request& request) {
  const nlohmann::json asked = request.json();
  const StoredCasesSubject subject{text_of(asked, "patient"), text_of(asked, "authority"),
                                   text_of(asked, "procedure"), text_of(asked, "coding_system")};
  const StoredCasesQuestion question = question_of(asked);
  const std::shared_ptr<StoredCases> stored = context.home().stored;
  if (!stored->can_search())
    throw Refusal(404, "this server has no search key: 'kiroku-fleet serve --search-key FILE' gives it one");
  if (subject.patient.empty() && subject.procedure.empty())
    throw Refusal(400, "to search give 'patient' or 'procedure' or both");
  context.enter_access(request, ViewerContext::kEveryCase,
                       subject.procedure.empty() ? "searched for cases of a patient"
                       : subject.patient.empty() ? "searched for cases of a procedure"
                                                 : "searched for cases of a patient and a procedure");
  const StoredCasesSearch found = stored->search(question, subject);
  return Response::json({{"cases", cases_json(found.page)},
                         {"next", or_null(found.page.next)},
                         {"looked_at", found.looked_at},
                         {"without_note", found.without_note},
                         {"not_by_this_key", found.foreign}});
}

ordered_json appliance_json(const StoredAppliance& one) {
  return {{"name", one.name},
          {"cases", one.cases},
          {"bytes", one.bytes},
          {"open", one.open},
          {"unverified", one.unverified},
          {"not_intact", one.alarms},
          {"incomplete", one.incomplete},
          {"unproven", one.unproven},
          {"not_checked", one.unchecked},
          {"missing", one.missing},
          {"unreadable", one.unreadable},
          {"newest", format_utc(one.newest)},
          {"seen", format_utc(one.seen)}};
}

}  // namespace

void add_stored_case_routes(Router& router, ViewerContext& context) {
  const std::shared_ptr<StoredCases> stored = context.home().stored;
  router.add("GET", "api/fleet/cases", Right::kListCases, [stored](const Request& request) {
    const StoredCasesPage page = stored->list(question_of(request));
    return Response::json({{"cases", cases_json(page)}, {"next", or_null(page.next)}});
  });
  // As a body: nobody's number stands in the logs of whatever lies between.
  router.add("POST", "api/fleet/cases/search", Right::kWatch,
             [&context](const Request& request) { return search_cases(context, request); });
  router.add("GET", "api/fleet/cases/{case:case}", Right::kListCases, [stored](const Request& request) {
    const std::optional<StoredCase> row = stored->row(request.parameter("case"));
    if (!row) throw Refusal(404, "the catalogue has no case " + request.parameter("case"));
    return Response::json(row_json(*row));
  });
  router.add("GET", "api/fleet/appliances", Right::kListCases, [stored](const Request& /*request*/) {
    ordered_json appliances = ordered_json::array();
    for (const StoredAppliance& each : stored->appliances()) appliances.push_back(appliance_json(each));
    return Response::json({{"appliances", std::move(appliances)}});
  });
}

}  // namespace kiroku::viewer

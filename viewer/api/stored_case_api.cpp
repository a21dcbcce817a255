// The list of all appliances' cases, and what is known of the appliances.
#include <nlohmann/json.hpp>

#include "archive/catalogue/catalogue_json.h"
#include "base/json_or_null.h"
#include "viewer/api/api.h"
#include "viewer/api/stored_cases.h"
#include "viewer/http/case_name.h"

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

std::optional<UtcTime> time_of(const Request& request, const char* name) {
  const std::optional<std::string> text = request.query_text(name);
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

StoredCasesQuestion question_of(const Request& request) {
  StoredCasesQuestion question;
  question.appliance = request.query_text("appliance");
  question.state = request.query_text("state");
  question.verdict = request.query_text("verdict");
  question.unverified = flag_of(request, "unverified");
  question.needs_a_person = flag_of(request, "attention");
  question.opened_from = time_of(request, "from");
  question.opened_before = time_of(request, "before");
  question.after = request.query_text("after");
  const std::int64_t limit = request.query_integer("limit").value_or(kUsualRows);
  if (limit < 1 || limit > kMostRows)
    throw Refusal(400, "'limit' must be from 1 to " + std::to_string(kMostRows));
  question.limit = static_cast<std::size_t>(limit);
  return question;
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
    ordered_json cases = ordered_json::array();
    for (const StoredCase& each : page.cases) cases.push_back(row_json(each));
    return Response::json({{"cases", std::move(cases)}, {"next", or_null(page.next)}});
  });
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

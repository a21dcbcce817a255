// To what a case's patient consented, as the appliance log states it in the clear: it names nobody.
#include <chrono>
#include <memory>
#include <optional>

#include <nlohmann/json.hpp>

#include "base/error.h"
#include "base/json_or_null.h"
#include "viewer/api/api.h"
#include "viewer/people/turns.h"

namespace kiroku::viewer {
namespace {

using nlohmann::ordered_json;

ordered_json purposes_json(const archive::CaseConsents& of_case) {
  ordered_json purposes = ordered_json::array();
  for (const auto& [purpose, state] : of_case.purposes) {
    purposes.push_back({{"purpose", purpose},
                        {"stands", state.stands},
                        {"since", format_utc(state.since)},
                        {"entry", state.entry},
                        {"signed", state.stands || state.withdrawal_signed}});
  }
  return purposes;
}

Response consents_of_case(const ViewerContext& context, Turns& readers, const Request& request) {
  (void)context.case_folder(request);  // 404 where there is none
  const Turns::Turn turn(readers, request.session->person());
  const SitePurposes site = context.site_purposes();
  ordered_json purposes = ordered_json::array();
  std::optional<std::string> problem;
  try {
    const SiteConsent& consent = context.home().consent;
    const archive::Consents all = consent.consents ? consent.consents() : archive::Consents();
    const auto found = all.find(request.parameter("case"));
    if (found != all.end()) purposes = purposes_json(found->second);
  } catch (const Error& error) {
    problem = error.what();
  }
  return Response::json({{"site_purposes", site.names},
                         {"demand_purpose", site.are_demanded},
                         {"state", problem ? "could-not-check" : "checked"},
                         {"problem", or_null(problem)},
                         {"purposes", std::move(purposes)}});
}

}  // namespace

void add_consent_routes(Router& router, ViewerContext& context) {
  // Each reads the whole appliance log, which grows for years.
  const auto readers = std::make_shared<Turns>(
      Turns::Limits{.all = 2, .of_person = 1, .patience = std::chrono::seconds(5)},
      Turns::Sentences{"others look at what was consented to: try again in a moment",
                       "you look at what was consented to already, on another page: try again in a moment"});
  router.add(
      "GET", "api/cases/{case:case}/consents", Right::kReadCase,
      [&context, readers](const Request& request) { return consents_of_case(context, *readers, request); });
}

}  // namespace kiroku::viewer

// 'kiroku-fleet serve': the hospital's page.
#include <memory>

#include <nlohmann/json.hpp>

#include "apps/fleet/commands.h"
#include "apps/fleet/fleet_configuration.h"
#include "apps/fleet/hospital_cases.h"
#include "apps/fleet/hospital_rooms.h"
#include "apps/fleet/report_desk.h"
#include "apps/kiroku/home.h"
#include "apps/kiroku/serving.h"
#include "apps/kiroku/viewer_setup.h"
#include "base/json_or_null.h"

namespace kiroku::apps {
namespace {

struct Request {
  ServingRequest serving{.listen = "127.0.0.1:8443"};
  std::string configuration;
  std::optional<std::string> scratch, reports, search_key;
  std::vector<std::string> identities;
};

int run(const Request& request) {
  const FleetConfiguration configuration = FleetConfiguration::read(request.configuration);
  const Home home = Home::open(request.serving.home);
  const timestamp::TrustStore trust = configuration.trust_store();
  const auto cases = std::make_shared<HospitalCases>(configuration, request.scratch, request.search_key);
  const auto rooms = std::make_shared<HospitalRooms>(configuration);
  const std::string listen = request.reports.value_or(configuration.reports_listen);
  std::optional<ReportDesk> desk;
  if (!listen.empty()) desk.emplace(configuration, listen, trust, tell_on_standard_error());
  const bool has_page = page_of(request.serving).has_value();
  serve_until_stopped(
      request.serving, home,
      {.serves = "fleet",
       .identities = request.identities.empty() ? nullptr : shared_identities(request.identities, home),
       .more_routes = {},
       .tell = tell_on_standard_error(),
       .first_line =
           [has_page, &desk](const std::string& url) {
             return "Serving all appliances' cases on " + url +
                    (has_page ? "" : " (the API alone: no page is built)") +
                    (desk ? "\nAppliances report to " + desk->url() : "");
           },
       .tell_more =
           [&desk](nlohmann::ordered_json& told) {
             told["reports"] = or_null(desk ? desk->url() : std::string());
           },
       .change_home =
           [&](viewer::ViewerHome& of_page) {
             of_page.stored = cases;
             of_page.fleet_rooms = rooms;
             of_page.trust = &trust;
           }});
  return kDone;
}

}  // namespace

void add_fleet_serve_command(Command& program) {
  Command& command =
      program.add_command("serve", "the hospital's page: all appliances' cases, watched out of the store");
  const auto request = std::make_shared<Request>();
  add_serving_options(command, request->serving);
  command.option(
      "-i,--identity", "FILE", request->identities,
      "opens recordings for everybody who may watch. Without one everybody unlocks with their own, "
      "which stays in memory");
  command.option("--scratch", "DIR", request->scratch,
                 "where ledgers lie while cases are looked at, and a case without most of its segments while "
                 "it is verified",
                 "the folder for temporary files");
  command.writes("--scratch");
  command.option("--reports", "ADDRESS", request->reports, "where appliances report, such as 0.0.0.0:8444",
                 "[reports] of the configuration");
  command.option("--search-key", "FILE", request->search_key,
                 "the site's search key, by which everybody who may watch finds cases by patient and "
                 "procedure. It stays on this server");
  add_fleet_configuration_option(command, request->configuration);
  command.explain(
      "The list comes from the catalogue, which 'kiroku-fleet index' keeps up to date. Pictures come from "
      "the "
      "store while somebody watches; no case is copied. The home has the page's users ('kiroku user add'), "
      "and its appliance log has who saw what, and who searched. Any number of these may run, each with a "
      "home of its own.");
  command.example("kiroku-fleet serve --home /srv/kiroku-page", "the page on https://127.0.0.1:8443/");
  command.example(
      "kiroku-fleet serve --home /srv/kiroku-page --listen 0.0.0.0:443 --certificate fleet.pem --key "
      "fleet.key",
      "for the whole network, with the hospital's certificate");
  command.on_run([request] { return run(*request); });
}

}  // namespace kiroku::apps

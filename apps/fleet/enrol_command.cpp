// 'kiroku-fleet enrol', 'revoke' and 'rooms': which appliances report, and what they say.
#include <iostream>
#include <memory>
#include <pwd.h>
#include <unistd.h>

#include <nlohmann/json.hpp>

#include "apps/common/format.h"
#include "apps/common/json_output.h"
#include "apps/fleet/commands.h"
#include "apps/fleet/enrolling.h"
#include "apps/fleet/fleet_configuration.h"
#include "base/error.h"
#include "fleet/catalogue/room_board.h"

namespace kiroku::apps {
namespace {

struct Request {
  std::string configuration, code, name;
  bool json = false;
};

/// Whoever runs this, as the catalogue keeps it.
std::string user_of_machine() {
  const passwd* const user = ::getpwuid(::geteuid());
  return user == nullptr ? "user " + std::to_string(::geteuid()) : user->pw_name;
}

int enrol(const Request& request) {
  const FleetConfiguration configuration = FleetConfiguration::read(request.configuration);
  const fleet::FleetAuthority authority = fleet::FleetAuthority::open(configuration.authority);
  fleet::FleetReports reports = configuration.open_reports();
  const fleet::PendingEnrolment found = request_of_code(reports, authority, request.code);
  admit_request(reports, authority, found, configuration, user_of_machine());
  const std::string fingerprint = fleet::request_fingerprint(found.request_pem);
  if (request.json) {
    print_json({{"appliance", found.appliance}, {"fingerprint", fingerprint}});
  } else {
    std::cout << found.appliance << " is enrolled and reports from now on. Its request's fingerprint is\n  "
              << fingerprint << "\n";
  }
  return kDone;
}

int revoke(const Request& request) {
  const FleetConfiguration configuration = FleetConfiguration::read(request.configuration);
  if (!configuration.open_reports().revoke(request.name))
    throw UsageError("no appliance '" + printable(request.name) + "' is enrolled: see 'kiroku-fleet rooms'");
  if (request.json) {
    print_json({{"revoked", request.name}});
  } else {
    std::cout << request.name << " may not report any more. Its name is free for another appliance.\n";
  }
  return kDone;
}

std::string state_of(const fleet::BoardRow& row) {
  const std::string was = row.is_heard ? "" : "was ";
  if (!row.heard) return "never heard of";
  return row.room ? was + row.room->state : "no room known";
}

int rooms(const Request& request) {
  const FleetConfiguration configuration = FleetConfiguration::read(request.configuration);
  fleet::FleetReports reports = configuration.open_reports();
  const UtcTime now = reports.now();
  const std::vector<fleet::BoardRow> board = fleet::board_of(reports.appliances(), now);
  const std::vector<std::string> not_enrolled = reports.not_enrolled();
  bool needs_a_person = false;
  std::vector<std::vector<std::string>> table{{"appliance", "room", "state", "heard", "needs a person"}};
  for (const fleet::BoardRow& row : board) {
    needs_a_person = needs_a_person || !row.concerns.empty();
    std::string concerns;
    for (const fleet::Concern each : row.concerns)
      concerns += (concerns.empty() ? "" : ", ") + std::string(fleet::concern_name(each));
    table.push_back({row.appliance, row.room ? row.room->room : "", state_of(row),
                     row.heard ? format_local(*row.heard) : "", concerns});
  }
  if (request.json) {
    print_json(fleet::board_json(board, not_enrolled, now));
  } else if (board.empty()) {
    std::cout << "No appliance is enrolled: 'kiroku fleet enrol' on one begins it.\n";
  } else {
    std::cout << format_table(table, "lllll", 0);
  }
  if (!request.json) {
    for (const std::string& each : not_enrolled)
      std::cout << printable(each)
                << " has cases in the store and is not enrolled: what it does now is not known.\n";
  }
  return needs_a_person ? kAnswerIsNo : kDone;
}

}  // namespace

void add_fleet_enrol_command(Command& program) {
  Command& command = program.add_command("enrol", "lets an appliance report, by the code that it shows");
  const auto request = std::make_shared<Request>();
  command.argument("CODE", request->code, "what 'kiroku fleet enrol' shows on the appliance");
  command.flag("--json", request->json, "prints one JSON object instead");
  add_fleet_configuration_option(command, request->configuration);
  command.explain(
      "Read the code from the appliance itself: it is made of the appliance's request and of this fleet's "
      "authority, so that nobody can stand between the two. Codes are wrong five times before each further "
      "one "
      "has to wait. The hospital's page takes it, too (Rooms).");
  command.example("kiroku-fleet enrol K7QM-2XFA-9DTR-PHW4",
                  "the appliance that shows this code reports from now on");
  command.on_run([request] { return enrol(*request); });
}

void add_fleet_revoke_command(Command& program) {
  Command& command = program.add_command("revoke", "lets an appliance report no more");
  const auto request = std::make_shared<Request>();
  command.argument("NAME", request->name, "the appliance, as 'kiroku-fleet rooms' names it");
  command.flag("--json", request->json, "prints one JSON object instead");
  add_fleet_configuration_option(command, request->configuration);
  command.explain(
      "No certificate of this name counts from then on, on any server of the fleet. Its cases stay, and what "
      "it "
      "ships is the store's matter.");
  command.example("kiroku-fleet revoke or-2", "it was stolen, or another is to have its name");
  command.on_run([request] { return revoke(*request); });
}

void add_fleet_rooms_command(Command& program) {
  Command& command = program.add_command("rooms", "tells what all rooms of all appliances do now");
  const auto request = std::make_shared<Request>();
  command.flag("--json", request->json, "prints one JSON object instead");
  add_fleet_configuration_option(command, request->configuration);
  command.explain(
      "What needs a person comes first, and the exit status is 1 then. An appliance that was not heard of "
      "for 20 "
      "s is told as that: what it said before may not be so any more.");
  command.example("kiroku-fleet rooms", "each room, and what needs a person there");
  command.on_run([request] { return rooms(*request); });
}

}  // namespace kiroku::apps

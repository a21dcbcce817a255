// 'kiroku-fleet init': the catalogue's tables and roles.
#include <iostream>
#include <memory>

#include "apps/fleet/commands.h"
#include "apps/fleet/fleet_configuration.h"
#include "fleet/catalogue/fleet_catalogue.h"

namespace kiroku::apps {
namespace {

struct Request {
  std::string configuration;
  std::optional<std::string> as;
};

int run(const Request& request) {
  const FleetConfiguration configuration = FleetConfiguration::read(request.configuration);
  fleet::Postgres database(configuration.connection + " " + request.as.value_or(""));
  fleet::FleetCatalogue::prepare(database);
  std::cout
      << "The catalogue is ready. Give each user of the database the role for their work:\n"
         "  GRANT kiroku_reader TO ...;    lists and searches\n"
         "  GRANT kiroku_indexer TO ...;   'kiroku-fleet index'\n"
         "  GRANT kiroku_verifier TO ...;  'kiroku-fleet verify'\n"
         "  GRANT kiroku_reporter TO ...;  'kiroku-fleet serve' that takes reports, 'enrol' and 'revoke'\n"
         "Next: 'kiroku-fleet index' fills it from the store.\n";
  return kDone;
}

}  // namespace

void add_fleet_init_command(Command& program) {
  Command& command =
      program.add_command("init", "makes the catalogue's tables and roles, or brings them up to date");
  command.explain(
      "The database must be there: 'createdb kiroku'. Whoever runs this needs the right to make roles in it. "
      "It can be "
      "run again at any time; rows and verdicts stay.");
  const auto request = std::make_shared<Request>();
  command.option("--as", "CONNECTION", request->as,
                 "how to connect as the administrator, beside 'connection'");
  add_fleet_configuration_option(command, request->configuration);
  command.example("kiroku-fleet init --as 'user=postgres'", "as the server's administrator");
  command.on_run([request] { return run(*request); });
}

}  // namespace kiroku::apps

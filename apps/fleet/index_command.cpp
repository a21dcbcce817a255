// 'kiroku-fleet index': the catalogue, brought up to what the store holds.
#include <iostream>
#include <memory>

#include <nlohmann/json.hpp>

#include "apps/common/json_output.h"
#include "apps/common/scratch_folder.h"
#include "apps/fleet/commands.h"
#include "apps/fleet/fleet_configuration.h"
#include "base/error.h"
#include "base/number_text.h"
#include "fleet/catalogue/store_index.h"

namespace kiroku::apps {
namespace {

using nlohmann::ordered_json;

struct Request {
  std::string configuration;
  bool anew = false, json = false;
};

int run(const Request& request) {
  const FleetConfiguration configuration = FleetConfiguration::read(request.configuration);
  fleet::FleetCatalogue catalogue = configuration.open_catalogue();
  fleet::ObjectStore store = configuration.open_store();
  const ScratchFolder scratch;
  ordered_json told = ordered_json::array();
  bool is_all_there = true, is_all_read = true;
  // Also those of which the store has nothing any more.
  std::vector<std::string> appliances = fleet::appliances_in_store(store);
  for (const std::string& known : catalogue.appliances()) {
    if (!std::ranges::binary_search(appliances, known))
      appliances.insert(std::ranges::upper_bound(appliances, known), known);
  }
  for (const std::string& appliance : appliances) {
    const auto table = catalogue.table_of(appliance);
    const fleet::IndexReport report =
        fleet::index_appliance(store, appliance, *table, scratch.path(), request.anew);
    if (report.cases == 0 && report.missing.empty()) continue;  // something else's objects
    const fleet::NotesReport notes = fleet::index_notes(store, appliance, catalogue, request.anew);
    for (const std::string& each : notes.problems) print_error("kiroku-fleet", appliance + ": " + each);
    if (notes.more_problems > 0)
      print_error("kiroku-fleet", appliance + ": " + std::to_string(notes.more_problems) +
                                      " more objects are no search notes of their cases");
    is_all_read = is_all_read && notes.problems.empty();
    is_all_there = is_all_there && report.missing.empty();
    is_all_read = is_all_read && report.problems.empty();
    for (const std::string& each : report.problems) print_error("kiroku-fleet", appliance + ": " + each);
    told.push_back({{"appliance", appliance},
                    {"cases", report.cases},
                    {"read", report.read},
                    {"notes", notes.notes},
                    {"notes_read", notes.read},
                    {"problems", report.problems},
                    {"note_problems", notes.problems},
                    {"missing", report.missing}});
    for (const std::string& each : report.missing) {
      print_error("kiroku-fleet",
                  appliance + ": the store has nothing of case " + each +
                      " any more, though the catalogue knows it: no lock that holds lets that happen");
    }
    if (!request.json)
      std::cout << printable(appliance) << ": " << counted(report.cases, "case", "cases") << ", "
                << report.read << " new or changed\n";
  }
  if (request.json) print_json({{"appliances", told}});
  if (told.empty() && !request.json) std::cout << "The store has no case of any appliance.\n";
  return !is_all_there ? kAnswerIsNo : is_all_read ? kDone : kNoAnswer;
}

}  // namespace

void add_fleet_index_command(Command& program) {
  Command& command = program.add_command("index", "brings the catalogue up to what the store holds");
  command.explain(
      "The store is the truth and the catalogue an index of it: this makes it from an empty one, too. It "
      "lists every "
      "appliance's objects and reads the ledger of each case that is new or changed. A case of which the "
      "store has "
      "nothing any more is named, keeps its row with the state 'missing', and the exit status is 1.");
  const auto request = std::make_shared<Request>();
  command.flag("--anew", request->anew, "reads every case's ledger again");
  command.flag("--json", request->json, "prints one JSON object instead");
  add_fleet_configuration_option(command, request->configuration);
  command.example("kiroku-fleet index", "by a timer, each few minutes");
  command.on_run([request] { return run(*request); });
}

}  // namespace kiroku::apps

// kiroku-fleet: what a hospital runs beside its store: one catalogue of all appliances' cases, their
// verification, and the hospital's page.

#include "apps/common/command_line.h"
#include "apps/fleet/commands.h"
#include "base/process_hardening.h"

int main(int argc, char** argv) {
  using namespace kiroku::apps;
  kiroku::harden_process();
  Program program(
      "kiroku-fleet", "keeps the catalogue of all appliances' cases in a store, verifies and shows them",
      "First steps: docs/how-to/run-a-fleet.md, then 'kiroku-fleet init', 'index', 'verify' and 'serve'.\n");
  add_fleet_init_command(program.root());
  add_fleet_index_command(program.root());
  add_fleet_cases_command(program.root());
  add_fleet_status_command(program.root());
  add_fleet_verify_command(program.root());
  add_fleet_renew_command(program.root());
  add_fleet_serve_command(program.root());
  add_fleet_rooms_command(program.root());
  add_fleet_enrol_command(program.root());
  add_fleet_revoke_command(program.root());
  add_fleet_search_key_command(program.root());
  return program.run(argc, argv);
}

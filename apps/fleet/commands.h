// The commands of kiroku-fleet.
#pragma once

#include "apps/common/command_line.h"

namespace kiroku::apps {

void add_fleet_init_command(Command& program);
void add_fleet_index_command(Command& program);
void add_fleet_cases_command(Command& program);
void add_fleet_status_command(Command& program);
void add_fleet_verify_command(Command& program);
void add_fleet_renew_command(Command& program);
void add_fleet_serve_command(Command& program);
void add_fleet_enrol_command(Command& program);
void add_fleet_revoke_command(Command& program);
void add_fleet_rooms_command(Command& program);
void add_fleet_search_key_command(Command& program);

}  // namespace kiroku::apps

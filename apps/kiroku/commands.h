// Every command of kiroku adds itself to the program; one file a command.
#pragma once

#include "apps/common/command_line.h"

namespace kiroku::apps {

void add_init_command(Command& program);
void add_record_command(Command& program);
void add_case_command(Command& program);
void add_status_command(Command& program);
void add_recover_command(Command& program);
void add_doctor_command(Command& program);
void add_boot_command(Command& program);
void add_devices_command(Command& program);
void add_display_command(Command& program);
void add_cases_command(Command& program);
void add_verify_command(Command& program);
void add_report_command(Command& program);
void add_export_command(Command& program);
void add_excerpt_command(Command& program);
void add_erase_command(Command& program);
void add_renew_command(Command& program);
void add_seal_command(Command& program);
void add_unseal_command(Command& program);
void add_stamp_command(Command& program);
void add_token_command(Command& program);
void add_tsa_command(Command& program);
void add_log_command(Command& program);
void add_witness_command(Command& program);
void add_ship_command(Command& program);
void add_fetch_command(Command& program);
void add_hold_command(Command& program);
void add_release_command(Command& program);
/// Last, so that it knows all others.
void add_completion_command(Command& program);

/// --home DIR, the same words everywhere.
void add_home_option(Command& command, std::optional<std::string>& into);

}  // namespace kiroku::apps

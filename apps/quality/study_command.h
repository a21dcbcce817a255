// 'kiroku quality study': a blinded reading of codings. One function a command.
#pragma once

#include "apps/common/command_line.h"

namespace kiroku::apps {

void add_study_command(Command& quality);

void add_study_make_command(Command& study);
void add_study_serve_command(Command& study);
void add_study_status_command(Command& study);
void add_study_close_command(Command& study);
void add_study_report_command(Command& study);

}  // namespace kiroku::apps

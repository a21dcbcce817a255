// 'kiroku plan': planned operations, for a person at a terminal.
#pragma once

#include "apps/common/command_line.h"

namespace kiroku::apps {

/// Without what needs libraries of codecs. Returns 'kiroku plan', for these to be added.
Command& add_plan_command(Command& program);

/// Templates of plans, and plans made from them.
void add_plan_template_commands(Command& plan);
/// Films, which need libraries of codecs.
void add_plan_replay_command(Command& plan);
/// Sealing, which takes a home, its log and its authorities.
void add_plan_seal_commands(Command& plan);
/// 'kiroku compare': a plan beside a recording.
void add_compare_command(Command& program);
/// 'plan pick': pictures and the points under them, for programs.
void add_plan_pick_command(Command& plan);
/// 'plan serve': a page to plan on, with solvers and the viewer's server.
void add_plan_serve_command(Command& plan);

}  // namespace kiroku::apps

// 'kiroku train': experiments and training on the simulation core, for a person at a terminal.
#pragma once

#include "apps/common/command_line.h"

namespace kiroku::apps {

void add_train_command(Command& program);

/// Parts of it.
void add_train_haptic_rate_command(Command& train);
/// What a sense of touch lets expect, and how many people a study takes.
void add_train_threshold_commands(Command& train);
void add_train_budget_command(Command& train);
void add_train_exclusion_command(Command& train);
void add_train_stress_command(Command& train);
void add_train_serve_command(Command& train);
/// Trainees, results, the study with simulated ones.
void add_train_curriculum_commands(Command& train);

}  // namespace kiroku::apps

#include "apps/train/train_command.h"

namespace kiroku::apps {

void add_train_command(Command& program) {
  Command& train = program.add_command("train", "training and experiments with simulated tissue");
  add_train_haptic_rate_command(train);
  add_train_threshold_commands(train);
  add_train_budget_command(train);
  add_train_exclusion_command(train);
  add_train_stress_command(train);
  add_train_serve_command(train);
  add_train_curriculum_commands(train);
}

}  // namespace kiroku::apps

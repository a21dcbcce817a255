#include "apps/train/train_command.h"

namespace kiroku::apps {

void add_train_command(Command& program) {
  Command& train = program.add_command("train", "training and experiments with simulated tissue");
  add_train_haptic_rate_command(train);
}

}  // namespace kiroku::apps

// What is being done, for work whose end cannot be foretold. Not thread-safe.
#pragma once

#include <iostream>
#include <string>

#include "apps/common/command_line.h"
#include "apps/common/terminal.h"

namespace kiroku::apps {

/// A line of its own that the next step takes; only on a terminal. Gone with the object.
class StepLine {
 public:
  ~StepLine() {
    if (drawn_) std::cerr << "\r\033[K" << std::flush;
  }
  void show(const std::string& step) {
    if (!errors_are_terminal()) return;
    std::cerr << "\r" << printable(step) << " ...\033[K" << std::flush;
    drawn_ = true;
  }

 private:
  bool drawn_ = false;
};

}  // namespace kiroku::apps

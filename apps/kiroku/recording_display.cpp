#include "apps/kiroku/recording_display.h"

#include <iostream>

#include "apps/common/command_line.h"
#include "apps/common/format.h"
#include "apps/common/terminal.h"

namespace kiroku::apps {

RecordingDisplay::RecordingDisplay() : live_line_(errors_are_terminal()) {}

RecordingDisplay::~RecordingDisplay() {
  if (drawn_) std::cerr << "\r\033[K" << std::flush;
}

void RecordingDisplay::tell(const recorder::SessionStatus& status) {
  if (status.last_problem == last_problem_ || status.last_problem.empty()) return;
  if (drawn_) std::cerr << "\r\033[K";
  print_error("kiroku", "at " + format_duration(status.now_ns) + ": " + status.last_problem);
  last_problem_ = status.last_problem;
}

void RecordingDisplay::show(const recorder::SessionStatus& status) {
  tell(status);
  if (!live_line_) return;
  std::string line = status_line(status);
  const std::size_t width = terminal_width();
  if (line.size() >= width) line.resize(width - 1);
  std::cerr << "\r" << line << "\033[K" << std::flush;
  drawn_ = true;
}

std::string status_line(const recorder::SessionStatus& status) {
  std::string line = "recording " + format_duration(status.now_ns);
  for (const recorder::StreamStatus& stream : status.streams) {
    line += "  " + stream.name + " " + std::to_string(stream.frames);
    if (stream.dropped > 0) line += " (" + std::to_string(stream.dropped) + " lost)";
    if (!stream.live) line += " (silent)";
  }
  line += "  time-stamps " + std::to_string(status.tokens);
  if (status.missed > 0) line += " (" + std::to_string(status.missed) + " missed)";
  return line;
}

}  // namespace kiroku::apps

// What a person sees while a recording runs: one line on a terminal, and each problem once. One thread.
#pragma once

#include <string>

#include "recorder/session.h"

namespace kiroku::apps {

class RecordingDisplay {
 public:
  RecordingDisplay();
  ~RecordingDisplay();  // clears the line
  RecordingDisplay(const RecordingDisplay&) = delete;
  RecordingDisplay& operator=(const RecordingDisplay&) = delete;
  void show(const recorder::SessionStatus& status);
  /// What a person should see of it and was not shown yet: also what was found at the very end.
  void tell(const recorder::SessionStatus& status);

 private:
  bool live_line_, drawn_ = false;
  std::string last_problem_;
};

/// "0:01:12  endoscope 2160  room 2158 (2 lost)  vitals 72  2 time-stamps".
std::string status_line(const recorder::SessionStatus& status);

}  // namespace kiroku::apps

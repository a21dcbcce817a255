// The options of every command that reads a CT.
#pragma once

#include <optional>
#include <string>

#include "apps/common/command_line.h"
#include "sim/volume/volume_reader.h"

namespace kiroku::apps {

struct VolumeRequest {
  std::string path;
  std::optional<std::string> series;
  bool resample = false, json = false;
  [[nodiscard]] sim::VolumeOptions options() const { return {series.value_or(""), resample}; }
};
/// VOLUME, --series, --resample and --json. The request must live until the program has run.
void add_volume_options(Command& command, VolumeRequest& request);

}  // namespace kiroku::apps

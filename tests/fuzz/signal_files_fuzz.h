// What the fuzz targets of signal files share: all that a reader gives must be lines that can be written.
#pragma once

#include <cstdlib>
#include <functional>
#include <memory>
#include <vector>

#include "base/error.h"
#include "media/vital_line.h"
#include "recorder/vitals/signal_file.h"

namespace kiroku::test {

/// Opens and reads to the end, or for 200 blocks; a kiroku::Error is an answer like any other.
inline void read_all(const std::function<std::unique_ptr<recorder::SignalReader>()>& open) {
  try {
    const auto reader = open();
    std::vector<media::VitalLine> lines;
    for (int block = 0; block < 200 && reader->read_block(lines); ++block) {
      for (const media::VitalLine& line : lines) {
        const std::string text = media::to_json_line(line);
        if (!media::parse_vital_line_of_any_kind(text).line) std::abort();
      }
      lines.clear();
    }
  } catch (const Error&) {
    return;
  }
}

}  // namespace kiroku::test

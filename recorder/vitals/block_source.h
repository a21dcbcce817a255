// Sources that read a file block by block, each of several lines.
#pragma once

#include <atomic>
#include <deque>
#include <optional>
#include <vector>

#include "recorder/vitals/vital_source.h"

namespace kiroku::recorder {

/// Hands out the lines of one block before it asks for the next.
class BlockSource : public VitalSource {
 public:
  std::optional<VitalLine> next() final {
    while (!interrupted_ && ready_.empty() && !ended_) {
      std::vector<VitalLine> block;
      try {
        ended_ = !read_block(block);
      } catch (...) {
        ended_ = true;
        throw;
      }
      for (VitalLine& line : block) {
        ready_.push_back(std::move(line));
      }
    }
    if (interrupted_ || ready_.empty()) {
      return std::nullopt;
    }
    VitalLine line = std::move(ready_.front());
    ready_.pop_front();
    return line;
  }
  void interrupt() noexcept final { interrupted_ = true; }

 private:
  /// Adds the next lines in order of time, which may be none; false at the end, when nothing was added. Not
  /// called again once it has returned false or thrown.
  virtual bool read_block(std::vector<VitalLine>& lines) = 0;

  std::deque<VitalLine> ready_;
  bool ended_ = false;
  std::atomic<bool> interrupted_ = false;
};

}  // namespace kiroku::recorder

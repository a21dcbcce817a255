#include "apps/common/progress.h"

#include <iostream>

#include "apps/common/format.h"
#include "apps/common/terminal.h"

namespace kiroku::apps {

using std::chrono::steady_clock;

Progress::Progress(std::string doing)
    : doing_(std::move(doing)), start_(steady_clock::now()), last_(start_), wanted_(errors_are_terminal()) {}

Progress::~Progress() { clear(); }

void Progress::clear() {
  if (drawn_) std::cerr << "\r\033[K" << std::flush;
  drawn_ = false;
}

void Progress::update(std::uint64_t done, std::uint64_t total) {
  constexpr auto kBeforeFirst = std::chrono::seconds(2);
  constexpr auto kBetween = std::chrono::milliseconds(200);
  const auto now = steady_clock::now();
  if (!wanted_ || now - start_ < kBeforeFirst || (drawn_ && now - last_ < kBetween)) return;
  std::string line = progress_text(doing_, done, total, now - start_);
  const std::size_t width = terminal_width();
  if (line.size() >= width) line.resize(width - 1);
  std::cerr << "\r" << line << "\033[K" << std::flush;
  drawn_ = true;
  last_ = now;
}

std::string progress_text(const std::string& doing, std::uint64_t done, std::uint64_t total,
                          std::chrono::duration<double> elapsed) {
  const double rate = elapsed.count() > 0 ? double(done) / elapsed.count() : 0;
  std::string line = doing;
  if (total > 0) {
    const double share = double(done) / double(total);
    line += "  " + std::to_string(int(share * 100)) + " %";
  } else {
    line += "  " + format_bytes(done);
  }
  line += "  " + format_bytes(std::uint64_t(rate)) + "/s";
  if (total >= done && total > 0 && rate > 0) {
    const double left = double(total - done) / rate;
    line += "  " + format_duration(std::int64_t(left * 1e9)) + " left";
  }
  return line;
}

}  // namespace kiroku::apps

// A camera that writes pictures into a FIFO, for tests: YUV4MPEG2 of 48 lines.
#pragma once

#include <atomic>
#include <chrono>
#include <csignal>
#include <fcntl.h>
#include <filesystem>
#include <fstream>
#include <string>
#include <thread>
#include <utility>

#include "base/descriptor.h"
#include "tests/support/eventually.h"

namespace kiroku::test {

/// Writes pictures, 20 a second unless told otherwise, until `count` are written or nobody reads any more.
inline void write_film(const std::filesystem::path& pipe, int count, int width = 64,
                       std::chrono::milliseconds pause = std::chrono::milliseconds(50)) {
  std::ofstream out(pipe, std::ios::binary);
  out << "YUV4MPEG2 W" << width << " H48 F20:1 Ip A1:1 C420jpeg\n";
  for (int i = 0; i < count && out; ++i) {
    out << "FRAME\n"
        << std::string(static_cast<std::size_t>(width) * 48 * 3 / 2, static_cast<char>(i)) << std::flush;
    std::this_thread::sleep_for(pause);
  }
}

/// A camera that goes away after a first film, and comes back when it is told to. What it sends to a reader
/// that still closes what it read before is lost, as on a cable: it then begins anew, for the next reader.
/// Ignores SIGPIPE for the process.
class ReturningCamera {
 public:
  ReturningCamera(std::filesystem::path pipe, int first_pictures) : pipe_(std::move(pipe)) {
    std::signal(SIGPIPE, SIG_IGN);
    thread_ = std::thread([this, first_pictures] {
      write_film(pipe_, first_pictures);
      while (is_away_ && !is_over_) std::this_thread::yield();
      while (!is_over_) write_film(pipe_, 1000);
      has_ended_ = true;
    });
  }
  ReturningCamera(const ReturningCamera&) = delete;
  ReturningCamera& operator=(const ReturningCamera&) = delete;
  ~ReturningCamera() {
    is_over_ = true;
    static_cast<void>(eventually([this] {  // it may wait for a reader
      const Descriptor reader(::open(pipe_.c_str(), O_RDONLY | O_NONBLOCK));
      return has_ended_.load();
    }));
    thread_.join();
  }
  void come_back() { is_away_ = false; }
  bool is_away() const { return is_away_; }

 private:
  std::filesystem::path pipe_;
  std::atomic<bool> is_away_ = true, is_over_ = false, has_ended_ = false;
  std::thread thread_;
};

}  // namespace kiroku::test

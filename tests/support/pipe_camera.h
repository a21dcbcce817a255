// A camera that writes pictures into a FIFO, for tests: YUV4MPEG2 of 48 lines.
#pragma once

#include <chrono>
#include <filesystem>
#include <fstream>
#include <string>
#include <thread>

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

}  // namespace kiroku::test

// What the benches of pictures share: clocks, PNG files, and how alike two pictures are. For programs of one
// file.
#pragma once

#include <chrono>
#include <cmath>
#include <cstdint>
#include <cstdlib>
#include <fstream>
#include <string>
#include <sys/resource.h>
#include <zlib.h>

#include "sim/render/picture.h"
#include "tests/support/picture_likeness.h"

namespace kiroku::bench {

inline void write_png(const std::string& file, const sim::Picture& picture) {
  std::string bytes("\x89PNG\r\n\x1a\n", 8);
  const auto number = [](std::uint32_t value) {
    return std::string{static_cast<char>(value >> 24U), static_cast<char>(value >> 16U),
                       static_cast<char>(value >> 8U), static_cast<char>(value)};
  };
  const auto chunk = [&](const std::string& kind, const std::string& data) {
    const std::string body = kind + data;
    bytes += number(static_cast<std::uint32_t>(data.size())) + body +
             number(static_cast<std::uint32_t>(
                 crc32(0, reinterpret_cast<const Bytef*>(body.data()), static_cast<uInt>(body.size()))));
  };
  chunk("IHDR", number(static_cast<std::uint32_t>(picture.width)) +
                    number(static_cast<std::uint32_t>(picture.height)) + std::string{8, 2, 0, 0, 0});
  std::string rows;
  for (int y = 0; y < picture.height; ++y)
    rows += '\0' + std::string(reinterpret_cast<const char*>(picture.pixel(0, y)),
                               3 * static_cast<std::size_t>(picture.width));
  uLongf size = compressBound(rows.size());
  std::string packed(size, '\0');
  compress(reinterpret_cast<Bytef*>(packed.data()), &size, reinterpret_cast<const Bytef*>(rows.data()),
           rows.size());
  chunk("IDAT", packed.substr(0, size));
  chunk("IEND", "");
  std::ofstream(file, std::ios::binary) << bytes;
}

/// Of a clock that only runs forward.
inline double seconds() {
  return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count();
}

/// What all threads have used of the processors.
inline double processor_seconds() {
  rusage used{};
  getrusage(RUSAGE_SELF, &used);
  const auto seconds_of = [](const timeval& time) {
    return double(time.tv_sec) + 1e-6 * double(time.tv_usec);
  };
  return seconds_of(used.ru_utime) + seconds_of(used.ru_stime);
}

}  // namespace kiroku::bench

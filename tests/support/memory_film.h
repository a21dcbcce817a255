// A film in memory, opened by libavformat.
#pragma once

extern "C" {
#include <libavformat/avformat.h>
}

#include <algorithm>

#include "base/bytes.h"
#include "media/libav_handles.h"

namespace kiroku::test {

/// `film` must outlive it. Throws kiroku::Error where libavformat finds no film in it. One thread.
class MemoryFilm {
 public:
  explicit MemoryFilm(ByteView film) : film_(film) {
    constexpr int kBuffer = 32768;
    io_.reset(avio_alloc_context(static_cast<unsigned char*>(av_malloc(kBuffer)), kBuffer, 0, this, read,
                                 nullptr, nullptr));
    AVFormatContext* raw = avformat_alloc_context();
    raw->pb = io_.get();
    media::require(avformat_open_input(&raw, nullptr, nullptr, nullptr), "cannot open the film");
    context_.reset(raw);
    media::require(avformat_find_stream_info(raw, nullptr), "cannot read the film");
  }
  MemoryFilm(const MemoryFilm&) = delete;
  MemoryFilm& operator=(const MemoryFilm&) = delete;

  [[nodiscard]] AVFormatContext* get() const { return context_.get(); }
  AVFormatContext* operator->() const { return context_.get(); }

 private:
  static int read(void* self, std::uint8_t* into, int size) {
    auto& film = static_cast<MemoryFilm*>(self)->film_;
    const std::size_t count = std::min(static_cast<std::size_t>(size), film.size());
    if (count == 0) return AVERROR_EOF;
    std::ranges::copy(film.first(count), reinterpret_cast<std::byte*>(into));
    film = film.subspan(count);
    return static_cast<int>(count);
  }

  ByteView film_;  // what has yet to be read
  media::CustomIo io_;
  media::InputContext context_;
};

}  // namespace kiroku::test

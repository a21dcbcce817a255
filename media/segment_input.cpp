#include "media/segment_input.h"

#include <algorithm>
#include <cstdio>
#include <utility>

extern "C" {
#include <libavformat/avformat.h>
#include <libavutil/avstring.h>
#include <libavutil/error.h>
#include <libavutil/mem.h>
}

#include "base/error.h"

namespace kiroku::media {
namespace {

/// Four chunks of age's payload: reads that begin at a chunk's start decrypt no chunk twice.
constexpr int kBufferBytes = 4 * 64 * 1024;

constexpr const char* kCodecs =
    "mpeg1video,mpeg2video,rawvideo,ffv1,mp2,mp2float,mp3,mp3float,aac,flac,pcm_s16le,pcm_s24le,pcm_s32le";

const char* demuxer_of(const std::string& media) {
  if (media == "video/mp2t") {
    return "mpegts";
  }
  if (media == "video/x-matroska") {
    return "matroska";
  }
  throw MediaError("media of type '" + media + "' cannot be read here; it is neither MPEG-TS nor Matroska");
}

}  // namespace

/// Where libav's callbacks land. An exception may not pass through libav's C code, so it waits in `failure`.
struct SegmentInput::Io {
  const crypto::ByteSource* source = nullptr;
  SequentialReader reader;
  std::uint64_t position = 0;
  std::exception_ptr failure;
  CustomIo context;

  static int read(void* opaque, std::uint8_t* into, int size) {
    auto& io = *static_cast<Io*>(opaque);
    if (io.failure) {
      return AVERROR(EIO);
    }
    try {
      const auto buffer = std::as_writable_bytes(std::span(into, static_cast<std::size_t>(size)));
      const std::size_t count =
          io.source != nullptr ? io.source->read_at(io.position, buffer) : io.reader(buffer);
      io.position += count;
      return count == 0 ? AVERROR_EOF : static_cast<int>(count);
    } catch (...) {
      io.failure = std::current_exception();
      return AVERROR(EIO);
    }
  }

  static std::int64_t seek(void* opaque, std::int64_t offset, int whence) {
    auto& io = *static_cast<Io*>(opaque);
    const auto size = static_cast<std::int64_t>(io.source->size());
    switch (whence & ~AVSEEK_FORCE) {
      case AVSEEK_SIZE:
        return size;
      case SEEK_SET:
        break;
      case SEEK_CUR:
        offset += static_cast<std::int64_t>(io.position);
        break;
      case SEEK_END:
        offset += size;
        break;
      default:
        return AVERROR(EINVAL);
    }
    if (offset < 0 || offset > size) {
      return AVERROR(EINVAL);
    }
    io.position = static_cast<std::uint64_t>(offset);
    return offset;
  }
};

SegmentInput::SegmentInput(const crypto::ByteSource& source, const std::string& media, std::string name)
    : name_(std::move(name)), io_(std::make_unique<Io>()) {
  io_->source = &source;
  open(media);
}

SegmentInput::SegmentInput(SequentialReader reader, const std::string& media, std::string name)
    : name_(std::move(name)), io_(std::make_unique<Io>()) {
  io_->reader = std::move(reader);
  open(media);
}

SegmentInput::~SegmentInput() = default;

void SegmentInput::open(const std::string& media) {
  silence_libav();
  const AVInputFormat* const demuxer = av_find_input_format(demuxer_of(media));
  if (demuxer == nullptr) {
    throw Error("this libavformat cannot read " + media + "; install Debian's FFmpeg libraries");
  }
  auto* const buffer = static_cast<unsigned char*>(av_malloc(kBufferBytes));
  if (buffer == nullptr) {
    throw std::bad_alloc();
  }
  io_->context.reset(avio_alloc_context(buffer, kBufferBytes, 0, io_.get(), Io::read, nullptr,
                                        io_->source != nullptr ? Io::seek : nullptr));
  if (!io_->context) {
    av_free(buffer);
    throw std::bad_alloc();
  }
  AVFormatContext* context = avformat_alloc_context();
  if (context == nullptr) {
    throw std::bad_alloc();
  }
  context->pb = io_->context.get();
  context->flags |= AVFMT_FLAG_CUSTOM_IO;
  Options options;
  options.set("codec_whitelist", kCodecs);
  options.set("format_whitelist", demuxer->name);
  options.set("protocol_whitelist", "none");
  const int result = avformat_open_input(&context, nullptr, demuxer, options.address());
  context_.reset(result < 0 ? nullptr : context);  // on failure libav has freed it
  check(result);
  check(avformat_find_stream_info(context_.get(), nullptr));
}

void SegmentInput::check(int result) {
  if (io_->failure) {
    std::rethrow_exception(io_->failure);
  }
  if (result < 0) {
    throw MediaError("cannot read the media of " + name_ + ": " + libav_error_text(result));
  }
}

AVStream* SegmentInput::first_of(int type) {
  const std::span streams(context_->streams, context_->nb_streams);
  const auto found = std::find_if(streams.begin(), streams.end(), [&](const AVStream* stream) {
    return stream->codecpar->codec_type == type;
  });
  return found == streams.end() ? nullptr : *found;
}

AVStream& SegmentInput::video() {
  if (AVStream* const stream = first_of(AVMEDIA_TYPE_VIDEO)) return *stream;
  throw MediaError("the media of " + name_ + " has no pictures");
}

AVStream* SegmentInput::sound() { return first_of(AVMEDIA_TYPE_AUDIO); }

bool SegmentInput::read(AVPacket& packet) {
  const int result = av_read_frame(context_.get(), &packet);
  if (result == AVERROR_EOF && !io_->failure) {
    return false;
  }
  check(result);
  return true;
}

}  // namespace kiroku::media

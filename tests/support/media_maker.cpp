#include "tests/support/media_maker.h"

#include <cmath>
#include <fstream>
#include <iterator>
#include <stdexcept>

extern "C" {
#include <libavcodec/avcodec.h>
#include <libavformat/avformat.h>
#include <libavutil/opt.h>
}

#include "base/error.h"
#include "crypto/encoding.h"
#include "crypto/hash.h"
#include "media/libav_handles.h"

namespace kiroku::test {
namespace {

using media::require;

/// Everything a muxer writes, in memory.
class MemoryOutput {
 public:
  explicit MemoryOutput(const char* format) {
    AVFormatContext* raw = nullptr;
    require(avformat_alloc_output_context2(&raw, nullptr, format, nullptr), "cannot make a test film");
    context_.reset(raw);
    auto* buffer = static_cast<unsigned char*>(av_malloc(kBuffer));
    io_.reset(avio_alloc_context(buffer, kBuffer, 1, this, nullptr, take, nullptr));
    io_->seekable = 0;
    context_->pb = io_.get();
    context_->flags |= AVFMT_FLAG_CUSTOM_IO | AVFMT_FLAG_BITEXACT;
    context_->avoid_negative_ts = AVFMT_AVOID_NEG_TS_DISABLED;
  }
  AVStream& add(const AVCodecContext& encoder) {
    AVStream* stream = avformat_new_stream(context_.get(), nullptr);
    require(avcodec_parameters_from_context(stream->codecpar, &encoder), "cannot make a test film");
    stream->time_base = encoder.time_base;
    return *stream;
  }
  void write(AVPacket* packet, const AVCodecContext& encoder, int stream) {
    packet->stream_index = stream;
    av_packet_rescale_ts(packet, encoder.time_base, context_->streams[stream]->time_base);
    require(av_write_frame(context_.get(), packet), "cannot make a test film");
  }
  Bytes taken() {
    avio_flush(io_.get());
    return std::exchange(bytes_, {});
  }
  AVFormatContext* context() { return context_.get(); }

 private:
  static constexpr int kBuffer = 1 << 16;
  /// For libav; the bytes are const from libavformat 61 on.
  template <typename Byte>
  static int take(void* self, Byte* bytes, int size) {
    append(static_cast<MemoryOutput*>(self)->bytes_,
           std::as_bytes(std::span(bytes, static_cast<std::size_t>(size))));
    return size;
  }
  Bytes bytes_;
  media::CustomIo io_;
  media::OutputContext context_;
};

media::Codec new_encoder(const char* name, const FilmOptions& options) {
  const AVCodec* codec = avcodec_find_encoder_by_name(name);
  if (codec == nullptr) {
    throw std::runtime_error(std::string("no encoder ") + name);
  }
  media::Codec encoder(avcodec_alloc_context3(codec));
  encoder->flags |= AV_CODEC_FLAG_BITEXACT;
  encoder->thread_count = 1;
  if (codec->type == AVMEDIA_TYPE_AUDIO) {
    encoder->sample_rate = 48'000;
    encoder->sample_fmt = AV_SAMPLE_FMT_S16;
    encoder->time_base = {1, 48'000};
    encoder->bit_rate = 64'000;
    av_channel_layout_default(&encoder->ch_layout, 1);
  } else {
    encoder->width = options.width;
    encoder->height = options.height;
    encoder->pix_fmt = AV_PIX_FMT_YUV420P;
    encoder->framerate = {options.rate, 1};
    encoder->time_base = {1, options.rate};
    encoder->gop_size = options.frames_per_segment;
    encoder->bit_rate = 1'000'000;
    encoder->flags |= static_cast<int>(AV_CODEC_FLAG_CLOSED_GOP | AV_CODEC_FLAG_LOW_DELAY);
    encoder->max_b_frames = 0;
    if (codec->id == AV_CODEC_ID_MPEG2VIDEO) {
      av_opt_set(encoder->priv_data, "sc_threshold", "1000000000", 0);
    }
    if (codec->id == AV_CODEC_ID_FFV1) {
      encoder->level = 3;
      encoder->gop_size = 1;
      av_opt_set_int(encoder->priv_data, "slicecrc", 1, 0);
    }
    if (codec->id == AV_CODEC_ID_MJPEG) {
      encoder->pix_fmt = AV_PIX_FMT_YUVJ420P;
      encoder->flags = AV_CODEC_FLAG_BITEXACT;  // a group of pictures is nothing to it
    }
    if (codec->id == AV_CODEC_ID_RAWVIDEO) {
      encoder->codec_tag = avcodec_pix_fmt_to_codec_tag(encoder->pix_fmt);
    }
  }
  require(avcodec_open2(encoder.get(), codec, nullptr), "cannot open a test encoder");
  return encoder;
}

/// Picture `n`: a slope that moves, and a block whose shade tells the number.
media::Frame picture(const AVCodecContext& encoder, int n) {
  media::Frame frame = media::make_frame();
  frame->format = encoder.pix_fmt;
  frame->width = encoder.width;
  frame->height = encoder.height;
  require(av_frame_get_buffer(frame.get(), 0), "cannot make a test picture");
  for (int plane = 0; plane < 3; ++plane) {
    const int width = plane == 0 ? encoder.width : encoder.width / 2;
    const int height = plane == 0 ? encoder.height : encoder.height / 2;
    for (int y = 0; y < height; ++y) {
      for (int x = 0; x < width; ++x) {
        const bool block = x < width / 4 && y < height / 4;
        const int value = block ? n * 5 : plane == 0 ? x * 2 + y + n * 3 : 128 + (x + n) % 16;
        frame->data[plane][y * frame->linesize[plane] + x] = static_cast<std::uint8_t>(value & 0xFF);
      }
    }
  }
  return frame;
}

media::Packet encode(AVCodecContext& encoder, const AVFrame* frame) {
  media::Packet packet = media::make_packet();
  require(avcodec_send_frame(&encoder, frame), "cannot encode a test picture");
  require(avcodec_receive_packet(&encoder, packet.get()), "cannot encode a test picture");
  return packet;
}

int picture_number(const FilmOptions& options, int segment, int i) {
  return segment * (options.frames_per_segment + options.gap_frames) + i;
}

/// One block of MPEG audio, a tone.
void write_sound(MemoryOutput& output, AVCodecContext& encoder, std::int64_t& samples, std::int64_t until) {
  while (samples < until) {
    media::Frame frame = media::make_frame();
    frame->format = encoder.sample_fmt;
    frame->nb_samples = encoder.frame_size;
    frame->sample_rate = encoder.sample_rate;
    av_channel_layout_copy(&frame->ch_layout, &encoder.ch_layout);
    require(av_frame_get_buffer(frame.get(), 0), "cannot make test sound");
    auto* values = reinterpret_cast<std::int16_t*>(frame->data[0]);
    for (int i = 0; i < frame->nb_samples; ++i) {
      values[i] = static_cast<std::int16_t>(8000 * std::sin(0.05 * static_cast<double>(samples + i)));
    }
    frame->pts = samples;
    samples += frame->nb_samples;
    require(avcodec_send_frame(&encoder, frame.get()), "cannot encode test sound");
    const media::Packet packet = media::make_packet();
    while (avcodec_receive_packet(&encoder, packet.get()) == 0) {
      output.write(packet.get(), encoder, 1);
    }
  }
}

}  // namespace

std::vector<Bytes> make_transport_stream(const FilmOptions& options) {
  media::silence_libav();
  const media::Codec encoder = new_encoder("mpeg2video", options);
  const media::Codec sound = options.sound ? new_encoder("mp2", options) : media::Codec();
  MemoryOutput output("mpegts");
  output.context()->max_delay = 250'000;  // keeps the encoder's priming of the sound from going below zero
  output.add(*encoder);
  if (sound) {
    output.add(*sound);
  }
  require(avformat_write_header(output.context(), nullptr), "cannot make a test film");
  std::vector<Bytes> segments;
  std::int64_t samples = 0;
  for (int segment = 0; segment < options.segments; ++segment) {
    if (segment > 0) {
      av_opt_set(output.context()->priv_data, "mpegts_flags", "+resend_headers", 0);
    }
    for (int i = 0; i < options.frames_per_segment; ++i) {
      const int n = picture_number(options, segment, i);
      media::Frame frame = picture(*encoder, n);
      frame->pts = n;
      frame->pict_type = i == 0 ? AV_PICTURE_TYPE_I : AV_PICTURE_TYPE_NONE;
      const media::Packet packet = encode(*encoder, frame.get());
      output.write(packet.get(), *encoder, 0);
      if (sound) {
        write_sound(output, *sound, samples, std::int64_t{n} * 48'000 / options.rate);
      }
    }
    require(av_write_frame(output.context(), nullptr), "cannot make a test film");
    segments.push_back(output.taken());
  }
  return segments;
}

std::vector<Bytes> make_matroska(const FilmOptions& options, const std::string& codec) {
  media::silence_libav();
  const media::Codec encoder = new_encoder(codec.c_str(), options);
  std::vector<Bytes> segments;
  for (int segment = 0; segment < options.segments; ++segment) {
    MemoryOutput output("matroska");
    output.add(*encoder);
    require(avformat_write_header(output.context(), nullptr), "cannot make a test film");
    for (int i = 0; i < options.frames_per_segment; ++i) {
      const int n = picture_number(options, segment, i);
      media::Frame frame = picture(*encoder, n);
      frame->pts = n;
      const media::Packet packet = encode(*encoder, frame.get());
      output.write(packet.get(), *encoder, 0);
    }
    require(av_write_trailer(output.context()), "cannot make a test film");
    segments.push_back(output.taken());
  }
  return segments;
}

Bytes make_jpeg(int width, int height) {
  media::silence_libav();
  const media::Codec encoder = new_encoder("mjpeg", {.width = width, .height = height});
  media::Frame frame = picture(*encoder, 0);
  frame->pts = 0;
  const media::Packet packet = encode(*encoder, frame.get());
  const auto bytes = std::as_bytes(std::span(packet->data, static_cast<std::size_t>(packet->size)));
  return {bytes.begin(), bytes.end()};
}

void write_film_with_matrix(const std::filesystem::path& file, const std::array<std::int32_t, 9>& matrix,
                            const std::vector<int>& orientations) {
  media::silence_libav();
  const Bytes plain = make_jpeg(64, 32);
  AVFormatContext* raw = nullptr;
  require(avformat_alloc_output_context2(&raw, nullptr, "mov", file.c_str()), "make a film");
  require(avio_open(&raw->pb, file.c_str(), AVIO_FLAG_WRITE), "make a film");
  AVStream* const stream = avformat_new_stream(raw, nullptr);
  stream->codecpar->codec_type = AVMEDIA_TYPE_VIDEO;
  stream->codecpar->codec_id = AV_CODEC_ID_MJPEG;
  stream->codecpar->width = 64;
  stream->codecpar->height = 32;
  stream->time_base = stream->avg_frame_rate = {1, 25};
  require(avformat_write_header(raw, nullptr), "make a film");
  for (std::size_t n = 0; n < 10; ++n) {
    Bytes picture = plain;
    if (const int orientation = n < orientations.size() ? orientations[n] : 0; orientation != 0) {
      // APP1 behind the start of the picture: one entry, tag 0112, a short.
      std::string exif(
          "\xFF\xE1\x00\x22"
          "Exif\0\0MM\0\x2A\0\0\0\x08\0\x01\x01\x12\0\x03\0\0\0\x01\0\0\0\0\0\0\0\0",
          36);
      exif[29] = static_cast<char>(orientation);
      const Bytes inserted = to_bytes(exif);
      picture.insert(picture.begin() + 2, inserted.begin(), inserted.end());
    }
    const media::Packet packet = media::make_packet();
    packet->data = reinterpret_cast<std::uint8_t*>(picture.data());
    packet->size = static_cast<int>(picture.size());
    packet->pts = packet->dts = av_rescale_q(static_cast<std::int64_t>(n), {1, 25}, stream->time_base);
    packet->duration = av_rescale_q(1, {1, 25}, stream->time_base);
    packet->flags = AV_PKT_FLAG_KEY;
    require(av_write_frame(raw, packet.get()), "make a film");
  }
  require(av_write_trailer(raw), "make a film");
  avio_closep(&raw->pb);
  avformat_free_context(raw);
  std::string film;
  {
    std::ifstream in(file, std::ios::binary);
    film.assign(std::istreambuf_iterator<char>(in), {});
  }
  // ISO 14496-12, 8.3.2: version 0 has 40 bytes before the matrix.
  const std::size_t header = film.find("tkhd");
  if (header == std::string::npos || film[header + 4] != 0) throw Error("the film has another header");
  for (std::size_t i = 0; i < matrix.size(); ++i) {
    for (std::size_t byte = 0; byte < 4; ++byte)
      film[header + 4 + 40 + 4 * i + byte] =
          static_cast<char>(static_cast<std::uint32_t>(matrix[i]) >> (8 * (3 - byte)) & 0xffU);
  }
  std::ofstream(file, std::ios::binary) << film;
}

std::vector<Picture> decode_file(const std::string& path) {
  AVFormatContext* raw = nullptr;
  require(avformat_open_input(&raw, path.c_str(), nullptr, nullptr), "cannot open " + path);
  const media::InputContext input(raw);
  require(avformat_find_stream_info(input.get(), nullptr), "cannot read " + path);
  const int index =
      require(av_find_best_stream(input.get(), AVMEDIA_TYPE_VIDEO, -1, -1, nullptr, 0), "no video");
  const AVStream& stream = *input->streams[index];
  const media::Codec codec(avcodec_alloc_context3(avcodec_find_decoder(stream.codecpar->codec_id)));
  require(avcodec_parameters_to_context(codec.get(), stream.codecpar), "cannot decode " + path);
  codec->thread_count = 1;
  require(avcodec_open2(codec.get(), codec->codec, nullptr), "cannot decode " + path);
  std::vector<Picture> pictures;
  const media::Frame frame = media::make_frame();
  std::int64_t first_ms = 0;
  const auto receive = [&] {
    while (avcodec_receive_frame(codec.get(), frame.get()) == 0) {
      crypto::Sha256 hash;
      for (int plane = 0; plane < 3; ++plane) {
        const int width = plane == 0 ? frame->width : frame->width / 2;
        const int height = plane == 0 ? frame->height : frame->height / 2;
        for (int y = 0; y < height; ++y) {
          hash.update(std::as_bytes(
              std::span(frame->data[plane] + y * frame->linesize[plane], static_cast<std::size_t>(width))));
        }
      }
      const std::int64_t time_ms = av_rescale_q(frame->best_effort_timestamp, stream.time_base, {1, 1000});
      first_ms = pictures.empty() ? time_ms : first_ms;
      pictures.push_back({time_ms - first_ms, crypto::to_hex(hash.finish())});
    }
  };
  const media::Packet packet = media::make_packet();
  while (av_read_frame(input.get(), packet.get()) == 0) {
    if (packet->stream_index == index) {
      require(avcodec_send_packet(codec.get(), packet.get()), "cannot decode " + path);
      receive();
    }
    av_packet_unref(packet.get());
  }
  require(avcodec_send_packet(codec.get(), nullptr), "cannot decode " + path);
  receive();
  return pictures;
}

}  // namespace kiroku::test

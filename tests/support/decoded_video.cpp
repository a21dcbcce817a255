#include "tests/support/decoded_video.h"

extern "C" {
#include <libavcodec/avcodec.h>
#include <libavutil/imgutils.h>
#include <libavutil/log.h>
#include <libavutil/pixdesc.h>
}

#include <algorithm>
#include <numeric>

#include "crypto/encoding.h"
#include "crypto/hash.h"
#include "media/libav_handles.h"
#include "media/libav_versions.h"
#include "tests/support/memory_film.h"

namespace kiroku::test {
namespace {

DecodedFrame describe(const AVFrame& frame) {
  DecodedFrame described;
  described.pts = frame.pts;
  described.key = media::is_key_frame(frame);
  described.width = frame.width;
  described.height = frame.height;
  const auto format = static_cast<AVPixelFormat>(frame.format);
  described.pixel_format = av_get_pix_fmt_name(format);
  std::vector<std::uint8_t> pixels(
      static_cast<std::size_t>(av_image_get_buffer_size(format, frame.width, frame.height, 1)));
  av_image_copy_to_buffer(pixels.data(), static_cast<int>(pixels.size()), frame.data, frame.linesize, format,
                          frame.width, frame.height, 1);
  described.sha256 = crypto::to_hex(crypto::sha256(std::as_bytes(std::span(pixels))));
  const auto first_plane = std::min(pixels.size(), static_cast<std::size_t>(frame.width * frame.height));
  const auto sum = std::accumulate(pixels.begin(), pixels.begin() + static_cast<std::ptrdiff_t>(first_plane),
                                   std::uint64_t{0});
  described.brightness = static_cast<double>(sum) / static_cast<double>(first_plane);
  return described;
}

media::Codec open_decoder(const AVStream& stream) {
  media::Codec decoder(avcodec_alloc_context3(avcodec_find_decoder(stream.codecpar->codec_id)));
  media::require(avcodec_parameters_to_context(decoder.get(), stream.codecpar), "cannot decode");
  media::require(avcodec_open2(decoder.get(), nullptr, nullptr), "cannot decode");
  return decoder;
}

void decode(AVCodecContext& decoder, const AVPacket* packet, DecodedVideo& video) {
  if (const int sent = avcodec_send_packet(&decoder, packet); sent < 0) {
    video.complaints.push_back("refused packet: " + media::libav_error_text(sent));
  }
  const media::Frame frame = media::make_frame();
  while (avcodec_receive_frame(&decoder, frame.get()) == 0) {
    if (decoder.codec_type == AVMEDIA_TYPE_VIDEO) {
      video.frames.push_back(describe(*frame));
    } else {
      video.sound_samples += frame->nb_samples;
    }
  }
}

}  // namespace

DecodedVideo decode_video(ByteView film, std::size_t at_most) {
  DecodedVideo video;
  media::route_libav_log([&](int level, std::string_view line) {
    if (level <= AV_LOG_WARNING) video.complaints.emplace_back(line);
  });
  const MemoryFilm input(film);
  const int picture = av_find_best_stream(input.get(), AVMEDIA_TYPE_VIDEO, -1, -1, nullptr, 0);
  const int sound = av_find_best_stream(input.get(), AVMEDIA_TYPE_AUDIO, -1, -1, nullptr, 0);
  const media::Codec picture_decoder = open_decoder(*input->streams[picture]);
  media::Codec sound_decoder;
  if (sound >= 0) {
    sound_decoder = open_decoder(*input->streams[sound]);
    video.sound_codec = avcodec_get_name(sound_decoder->codec_id);
  }
  const media::Packet packet = media::make_packet();
  while (video.frames.size() < at_most && av_read_frame(input.get(), packet.get()) >= 0) {
    if (packet->stream_index == picture) decode(*picture_decoder, packet.get(), video);
    if (packet->stream_index == sound) decode(*sound_decoder, packet.get(), video);
    av_packet_unref(packet.get());
  }
  decode(*picture_decoder, nullptr, video);
  if (sound_decoder) decode(*sound_decoder, nullptr, video);
  media::route_libav_log({});
  return video;
}

}  // namespace kiroku::test

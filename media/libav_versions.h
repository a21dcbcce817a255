// What FFmpeg 5 (Debian 12) and FFmpeg 7 (Debian 13) spell differently, under one name each. Which version
// brought what: FFmpeg's doc/APIchanges. It includes libav's headers, so only .cpp files include it. The
// functions are as thread-safe as what they are given.
#pragma once

#include <cstdint>

extern "C" {
#include <libavcodec/avcodec.h>
#include <libavformat/avformat.h>
#include <libavutil/frame.h>
}

namespace kiroku::media {

#ifdef AV_CODEC_FLAG_COPY_OPAQUE  // libavcodec 60; reordered_opaque went with 61
static_assert(sizeof(std::intptr_t) >= sizeof(std::int64_t), "a number must fit into AVPacket::opaque");

/// Before avcodec_open2: a decoder hands the number of each packet to the frames that come of it.
inline void carry_numbers(AVCodecContext& decoder) { decoder.flags |= AV_CODEC_FLAG_COPY_OPAQUE; }
/// Before avcodec_send_packet with the same decoder and packet.
inline void set_number(AVCodecContext& /*decoder*/, AVPacket& packet, std::int64_t number) {
  packet.opaque = reinterpret_cast<void*>(static_cast<std::intptr_t>(number));
}
/// The number of the packet that the frame came of.
inline std::int64_t number_of(const AVFrame& frame) { return reinterpret_cast<std::intptr_t>(frame.opaque); }
#else
inline void carry_numbers(AVCodecContext& /*decoder*/) {}
inline void set_number(AVCodecContext& decoder, AVPacket& /*packet*/, std::int64_t number) {
  decoder.reordered_opaque = number;
}
inline std::int64_t number_of(const AVFrame& frame) { return frame.reordered_opaque; }
#endif

#ifdef AV_FRAME_FLAG_KEY  // libavutil 58.7; key_frame and interlaced_frame are deprecated since
inline bool is_key_frame(const AVFrame& frame) { return (frame.flags & AV_FRAME_FLAG_KEY) != 0; }
inline bool is_interlaced(const AVFrame& frame) { return (frame.flags & AV_FRAME_FLAG_INTERLACED) != 0; }
inline bool is_upper_field_first(const AVFrame& frame) {
  return (frame.flags & AV_FRAME_FLAG_TOP_FIELD_FIRST) != 0;
}
inline void set_interlaced(AVFrame& frame, bool interlaced) {
  frame.flags = interlaced ? frame.flags | AV_FRAME_FLAG_INTERLACED : frame.flags & ~AV_FRAME_FLAG_INTERLACED;
}
#else
inline bool is_key_frame(const AVFrame& frame) { return frame.key_frame != 0; }
inline bool is_interlaced(const AVFrame& frame) { return frame.interlaced_frame != 0; }
inline bool is_upper_field_first(const AVFrame& frame) { return frame.top_field_first != 0; }
inline void set_interlaced(AVFrame& frame, bool interlaced) { frame.interlaced_frame = interlaced ? 1 : 0; }
#endif

/// How the stream says that its pictures are to be shown: nine numbers, null where it says nothing. Its own
/// memory.
inline const std::int32_t* display_matrix_of(const AVStream& stream) {
  constexpr std::size_t kBytes = 9 * sizeof(std::int32_t);
#if LIBAVCODEC_VERSION_INT >= AV_VERSION_INT(60, 31, 102)
  const AVPacketSideData* const said = av_packet_side_data_get(
      stream.codecpar->coded_side_data, stream.codecpar->nb_coded_side_data, AV_PKT_DATA_DISPLAYMATRIX);
  if (said == nullptr || said->size < kBytes) return nullptr;
  return reinterpret_cast<const std::int32_t*>(said->data);
#else
  std::size_t size = 0;
  const std::uint8_t* const said = av_stream_get_side_data(&stream, AV_PKT_DATA_DISPLAYMATRIX, &size);
  return said == nullptr || size < kBytes ? nullptr : reinterpret_cast<const std::int32_t*>(said);
#endif
}

/// In units of the frame's time base, 0 where it is not known.
inline void set_duration(AVFrame& frame, std::int64_t duration) {
#if LIBAVUTIL_VERSION_INT >= AV_VERSION_INT(57, 30, 100)
  frame.duration = duration;
#else
  frame.pkt_duration = duration;
#endif
}

/// What an encoder takes, ended by AV_PIX_FMT_NONE; null where it does not say. libavcodec's own memory.
inline const AVPixelFormat* pixel_formats_of(const AVCodec& encoder) {
#if LIBAVCODEC_VERSION_INT >= AV_VERSION_INT(61, 13, 100)
  const void* formats = nullptr;
  const int found =
      avcodec_get_supported_config(nullptr, &encoder, AV_CODEC_CONFIG_PIX_FORMAT, 0, &formats, nullptr);
  return found < 0 ? nullptr : static_cast<const AVPixelFormat*>(formats);
#else
  return encoder.pix_fmts;
#endif
}

}  // namespace kiroku::media

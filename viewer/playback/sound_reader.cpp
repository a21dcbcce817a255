#include "viewer/playback/sound_reader.h"

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <exception>
#include <limits>
#include <span>
#include <utility>

extern "C" {
#include <libavcodec/avcodec.h>
#include <libavformat/avformat.h>
#include <libavutil/frame.h>
}

#include "base/error.h"
#include "crypto/age_error.h"
#include "viewer/playback/segment_packets.h"

namespace kiroku::playback {
namespace {

using media::require;

constexpr const char* kAction = "cannot decode archived sound";
/// A stream whose device came late begins without sound; one that never spoke has a track and no block.
constexpr std::size_t kMostLookedAt = 12;

std::int64_t floor_divided(std::int64_t value, std::int64_t by) {
  return value / by - (value % by < 0 ? 1 : 0);
}

media::Codec open_decoder(const AVStream& stream) {
  const AVCodec* codec = avcodec_find_decoder(stream.codecpar->codec_id);
  // The one that computes in whole numbers dithers: what it makes of a block depends on all before it.
  if (codec != nullptr && codec->id == AV_CODEC_ID_MP2) codec = avcodec_find_decoder_by_name("mp2float");
  if (codec == nullptr) throw Error("this libavcodec cannot decode sound; install Debian's FFmpeg libraries");
  media::Codec decoder(avcodec_alloc_context3(codec));
  if (!decoder) throw std::bad_alloc();
  require(avcodec_parameters_to_context(decoder.get(), stream.codecpar), kAction);
  decoder->thread_count = 1;
  require(avcodec_open2(decoder.get(), nullptr, nullptr), kAction);
  return decoder;
}

std::int16_t as_16_bit(std::int16_t value) { return value; }
std::int16_t as_16_bit(std::int32_t value) {
  constexpr std::int32_t kHalf = 1 << 15;
  return static_cast<std::int16_t>(
      (std::min(value, std::numeric_limits<std::int32_t>::max() - kHalf) + kHalf) >> 16);
}
std::int16_t as_16_bit(float value) {
  return static_cast<std::int16_t>(std::lrintf(std::clamp(value * 32'768.0F, -32'768.0F, 32'767.0F)));
}

template <typename Sample>
void copy(const AVFrame& sound, int first, int last, std::int16_t* into) {
  const int channels = sound.ch_layout.nb_channels;
  const bool planar = av_sample_fmt_is_planar(static_cast<AVSampleFormat>(sound.format)) != 0;
  for (int channel = 0; channel < channels; ++channel) {
    const auto* const from = reinterpret_cast<const Sample*>(sound.extended_data[planar ? channel : 0]);
    for (int at = first; at < last; ++at) {
      into[(at - first) * channels + channel] = as_16_bit(planar ? from[at] : from[at * channels + channel]);
    }
  }
}

/// What the first block of a segment says; nothing where it has none.
std::optional<SoundForm> form_of(const SegmentOpener& media, const VideoIndex& index,
                                 const IndexedSegment& segment) {
  SegmentPackets packets(media, index, segment, SegmentPackets::Of::kSound);
  const media::Packet packet = packets.next();
  if (!packet) return std::nullopt;
  const media::Codec decoder = open_decoder(*packets.stream());
  require(avcodec_send_packet(decoder.get(), packet.get()), kAction);
  const media::Frame frame = media::make_frame();
  require(avcodec_receive_frame(decoder.get(), frame.get()), kAction);
  SoundForm form{frame->sample_rate, frame->ch_layout.nb_channels, frame->nb_samples, 0};
  const std::int64_t place = av_rescale(packet->pts, form.rate, kTicksPerSecond);
  form.origin = place - floor_divided(place, form.block) * form.block;
  return form;
}

/// What the newest whole segment says; one that was cut off may have ended before its track was told of.
bool has_track(const SegmentOpener& media, const VideoIndex& index) {
  std::exception_ptr failure;
  for (std::size_t i = 0; i < std::min(index.segments.size(), kMostLookedAt); ++i) {
    const IndexedSegment& segment = index.segments[index.segments.size() - 1 - i];
    try {
      const SegmentPackets packets(media, index, segment, SegmentPackets::Of::kSound);
      if (packets.stream() != nullptr || segment.entry.complete) return packets.stream() != nullptr;
    } catch (const crypto::AgeError&) {
      throw;
    } catch (const Error&) {
      if (!failure && segment.entry.complete) failure = std::current_exception();
    }
  }
  if (failure) std::rethrow_exception(failure);
  return false;
}

}  // namespace

std::int64_t SoundForm::place_of(Ticks time) const {
  const std::int64_t stated = av_rescale(time, rate, kTicksPerSecond);
  const std::int64_t on_row = origin + floor_divided(stated - origin + block / 2, block) * block;
  // A millisecond is as exact as a container states it; more is another row, as after a device was changed.
  return std::abs(stated - on_row) <= rate / 1000 ? on_row : stated;
}

std::optional<SoundForm> find_sound(const SegmentOpener& media, const VideoIndex& index) {
  const std::vector<IndexedSegment>& segments = index.segments;
  if (!has_track(media, index)) return std::nullopt;
  const auto look = [&](const IndexedSegment& segment) -> std::optional<SoundForm> {
    try {
      return form_of(media, index, segment);
    } catch (const crypto::AgeError&) {
      throw;
    } catch (const Error&) {
      return std::nullopt;  // told to who asks for its pieces
    }
  };
  const std::size_t count = std::min(segments.size(), kMostLookedAt);
  for (std::size_t i = 0; i < count; ++i) {
    if (auto form = look(segments[i])) return form;
  }
  for (std::size_t i = 0; i < std::min(segments.size() - count, kMostLookedAt); ++i) {
    if (auto form = look(segments[segments.size() - 1 - i])) return form;
  }
  return std::nullopt;
}

SoundReader::SoundReader(const SegmentOpener& media, const VideoIndex& index, const SoundForm& form)
    : media_(media), index_(index), form_(form) {}

std::vector<std::int16_t> SoundReader::read(std::int64_t from, std::int64_t to) {
  from_ = from;
  to_ = to;
  samples_.assign(static_cast<std::size_t>((to - from) * form_.channels), 0);
  decoder_.reset();
  expected_.reset();
  const Ticks begin = av_rescale(from, kTicksPerSecond, form_.rate);
  const Ticks end = av_rescale(to, kTicksPerSecond, form_.rate);
  for (std::size_t i = index_.first_reaching(begin - kSoundReach);
       i < index_.segments.size() && index_.segments[i].start < end + kSoundReach; ++i) {
    const IndexedSegment& segment = index_.segments[i];
    try {
      read_segment(segment);
    } catch (const Error&) {
      if (segment.start < end && segment.end > begin) throw;
    }
    if (expected_ && *expected_ >= to_) break;
  }
  return std::move(samples_);
}

void SoundReader::read_segment(const IndexedSegment& segment) {
  SegmentPackets packets(media_, index_, segment, SegmentPackets::Of::kSound);
  if (packets.stream() == nullptr) return;
  // Another profile has its sound in another form, too.
  if (decoder_ && decoder_->codec_id != packets.stream()->codecpar->codec_id) decoder_.reset();
  // A block of layer II needs the one before: its first samples are what the two make together.
  media::Packet before;
  std::int64_t before_place = 0;
  while (media::Packet packet = packets.next()) {
    const std::int64_t place = form_.place_of(packet->pts);
    if (place >= to_) {
      expected_ = place;
      return;
    }
    if (place + form_.block <= from_) {
      before = std::move(packet);
      before_place = place;
      continue;
    }
    if (!decoder_) decoder_ = open_decoder(*packets.stream());
    if (before) decode(*std::exchange(before, {}), before_place);
    decode(*packet, place);
  }
  if (!before) return;
  // The next segment may go on with it.
  if (!decoder_) decoder_ = open_decoder(*packets.stream());
  decode(*before, before_place);
}

void SoundReader::decode(const AVPacket& packet, std::int64_t place) {
  if (expected_ && std::abs(place - *expected_) <= form_.rate / 1000) place = *expected_;
  if (expected_ && place != *expected_) avcodec_flush_buffers(decoder_.get());
  require(avcodec_send_packet(decoder_.get(), &packet), kAction);
  expected_ = place;
  const media::Frame frame = media::make_frame();
  for (;;) {
    const int result = avcodec_receive_frame(decoder_.get(), frame.get());
    if (result == AVERROR(EAGAIN) || result == AVERROR_EOF) return;
    require(result, kAction);
    keep(*frame, *expected_);
    *expected_ += frame->nb_samples;
  }
}

void SoundReader::keep(const AVFrame& sound, std::int64_t place) {
  if (sound.ch_layout.nb_channels != form_.channels || sound.sample_rate != form_.rate) return;
  const auto first = static_cast<int>(std::clamp<std::int64_t>(from_ - place, 0, sound.nb_samples));
  const auto last = static_cast<int>(std::clamp<std::int64_t>(to_ - place, first, sound.nb_samples));
  if (first == last) return;
  std::int16_t* const into = samples_.data() + (place + first - from_) * form_.channels;
  switch (sound.format) {
    case AV_SAMPLE_FMT_S16:
    case AV_SAMPLE_FMT_S16P:
      return copy<std::int16_t>(sound, first, last, into);
    case AV_SAMPLE_FMT_S32:
    case AV_SAMPLE_FMT_S32P:
      return copy<std::int32_t>(sound, first, last, into);
    case AV_SAMPLE_FMT_FLT:
    case AV_SAMPLE_FMT_FLTP:
      return copy<float>(sound, first, last, into);
    default:
      throw Error("sound in this form cannot be heard here; export the stream instead");
  }
}

}  // namespace kiroku::playback

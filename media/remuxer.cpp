#include "media/remuxer.h"

#include <algorithm>
#include <cerrno>
#include <utility>
#include <vector>

extern "C" {
#include <libavcodec/avcodec.h>
#include <libavformat/avformat.h>
#include <libavutil/pixdesc.h>
}

#include "base/error.h"

namespace kiroku::media {
namespace {

const char* muxer_name(Container container) { return container == Container::kMatroska ? "matroska" : "mp4"; }
const char* container_name(Container container) {
  return container == Container::kMatroska ? "Matroska (.mkv)" : "MP4 (.mp4)";
}

bool is_copied(const AVStream& stream) {
  return stream.codecpar->codec_type == AVMEDIA_TYPE_VIDEO ||
         stream.codecpar->codec_type == AVMEDIA_TYPE_AUDIO;
}

/// Streams of an input that are copied, in order.
std::vector<const AVStream*> copied_streams(SegmentInput& input) {
  std::vector<const AVStream*> streams;
  for (unsigned i = 0; i < input.context().nb_streams; ++i) {
    if (is_copied(*input.context().streams[i])) {
      streams.push_back(input.context().streams[i]);
    }
  }
  return streams;
}

std::string describe(const AVCodecParameters& parameters) {
  std::string text = avcodec_get_name(parameters.codec_id);
  if (parameters.codec_type == AVMEDIA_TYPE_VIDEO) {
    const char* const format = av_get_pix_fmt_name(static_cast<AVPixelFormat>(parameters.format));
    text += " " + std::to_string(parameters.width) + "x" + std::to_string(parameters.height) + " " +
            (format == nullptr ? "unknown" : format);
  }
  return text;
}

bool same_parameters(const AVCodecParameters& a, const AVCodecParameters& b) {
  return a.codec_type == b.codec_type && a.codec_id == b.codec_id && a.format == b.format &&
         a.width == b.width && a.height == b.height && a.sample_rate == b.sample_rate &&
         a.ch_layout.nb_channels == b.ch_layout.nb_channels && a.extradata_size == b.extradata_size &&
         std::equal(a.extradata, a.extradata + a.extradata_size, b.extradata);
}

}  // namespace

Remuxer::Remuxer(OutputBytes& output, Container container, std::string name,
                 std::function<void(Ticks time)> on_picture)
    : name_(std::move(name)), container_(container), io_(output), on_picture_(std::move(on_picture)) {
  silence_libav();
}

void Remuxer::check(int result, const std::string& what) const { io_.check(result, what + " " + name_); }

void Remuxer::open(SegmentInput& input) {
  AVFormatContext* raw = nullptr;
  require(avformat_alloc_output_context2(&raw, nullptr, muxer_name(container_), nullptr),
          "cannot begin " + name_);
  context_.reset(raw);
  context_->pb = io_.context();
  context_->flags |= AVFMT_FLAG_CUSTOM_IO | AVFMT_FLAG_BITEXACT;
  context_->avoid_negative_ts = AVFMT_AVOID_NEG_TS_DISABLED;
  for (const AVStream* from : copied_streams(input)) {
    const AVCodecID codec = from->codecpar->codec_id;
    if (avformat_query_codec(context_->oformat, codec, FF_COMPLIANCE_NORMAL) != 1) {
      throw UsageError(std::string(container_name(container_)) + " cannot hold " + avcodec_get_name(codec) +
                       "; export it as .mkv");
    }
    AVStream* const to = avformat_new_stream(context_.get(), nullptr);
    if (to == nullptr) {
      throw std::bad_alloc();
    }
    require(avcodec_parameters_copy(to->codecpar, from->codecpar), "cannot begin " + name_);
    // A tag is the input container's own; only for uncompressed pictures it says what they are.
    to->codecpar->codec_tag = codec == AV_CODEC_ID_RAWVIDEO ? from->codecpar->codec_tag : 0;
    to->time_base = from->time_base;
    to->avg_frame_rate = from->avg_frame_rate;
    to->sample_aspect_ratio = from->sample_aspect_ratio;
  }
  check(avformat_write_header(context_.get(), nullptr), "cannot begin");
}

std::string Remuxer::change(SegmentInput& input) const {
  if (!context_) return "";
  const std::vector<const AVStream*> streams = copied_streams(input);
  if (streams.size() != context_->nb_streams) {
    return "cannot join the segments of " + name_ + ": sound comes or goes in the middle";
  }
  for (unsigned i = 0; i < context_->nb_streams; ++i) {
    const AVCodecParameters& before = *context_->streams[i]->codecpar;
    const AVCodecParameters& now = *streams[i]->codecpar;
    if (!same_parameters(before, now)) {
      return "cannot join the segments of " + name_ + ": it changes from " + describe(before) + " to " +
             describe(now);
    }
  }
  return "";
}

void Remuxer::copy(SegmentInput& input, Ticks shift, bool tolerate_cut) {
  if (!context_) open(input);
  std::vector<int> output_index(input.context().nb_streams, -1);
  int next_index = 0;
  for (const AVStream* stream : copied_streams(input)) {
    output_index[static_cast<std::size_t>(stream->index)] = next_index++;
  }
  const Packet packet = make_packet();
  for (;;) {
    try {
      if (!input.read(*packet)) {
        break;
      }
    } catch (const MediaError&) {
      if (!tolerate_cut) {
        throw;
      }
      break;
    }
    const auto from_index = static_cast<std::size_t>(packet->stream_index);
    // MPEG-TS may announce a stream later; such a one has no place in what was begun.
    if (from_index >= output_index.size() || output_index[from_index] < 0) {
      av_packet_unref(packet.get());
      continue;
    }
    const AVStream& from = *input.context().streams[from_index];
    const int to_index = output_index[from_index];
    const AVRational ticks{1, int{kTicksPerSecond}};
    const bool is_picture = from.codecpar->codec_type == AVMEDIA_TYPE_VIDEO;
    for (std::int64_t* const stamp : {&packet->pts, &packet->dts}) {
      if (*stamp != AV_NOPTS_VALUE) *stamp = av_rescale_q(*stamp, from.time_base, ticks) + shift;
    }
    if (!is_picture && packet->pts != AV_NOPTS_VALUE && packet->pts < 0) {
      av_packet_unref(packet.get());
      continue;
    }
    if (is_picture) {
      ++frames_;
      if (on_picture_ && packet->pts != AV_NOPTS_VALUE) on_picture_(packet->pts);
    }
    packet->duration = av_rescale_q(packet->duration, from.time_base, ticks);
    packet->stream_index = to_index;
    packet->pos = -1;
    av_packet_rescale_ts(packet.get(), ticks, context_->streams[to_index]->time_base);
    const std::int64_t stamp = packet->dts;
    const int written = av_interleaved_write_frame(context_.get(), packet.get());
    if (written == AVERROR(EINVAL) && goes_back(to_index, stamp)) {
      throw Error("cannot join the segments of " + name_ +
                  ": their time stamps go back, as where one holds what was recorded before it; 'kiroku "
                  "verify --identity' says which does not hold, and --from and --to leave it out");
    }
    check(written, "cannot write");
    if (stamp != AV_NOPTS_VALUE) latest_[to_index] = stamp;
  }
}

bool Remuxer::goes_back(int stream, std::int64_t stamp) const {
  const auto latest = latest_.find(stream);
  return stamp != AV_NOPTS_VALUE && latest != latest_.end() && stamp <= latest->second;
}

void Remuxer::finish() {
  if (!context_) {
    throw Error("cannot write " + name_ + ": there is no media in it");
  }
  check(av_write_trailer(context_.get()), "cannot finish");
  io_.flush("cannot finish " + name_);
}

}  // namespace kiroku::media

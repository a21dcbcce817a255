#include "media/inspection/frame_count_job.h"

#include <optional>

extern "C" {
#include <libavformat/avformat.h>
#include <libavutil/frame.h>
}

#include <nlohmann/json.hpp>

#include "archive/format/segment_media.h"
#include "media/inspection/container_form.h"
#include "media/picture_decoder.h"
#include "media/segment_input.h"
#include "media/stream_clock.h"

namespace kiroku::media {
namespace {

/// The pictures of one segment as they come out of the decoder.
struct Counted {
  std::uint64_t frames = 0;
  std::optional<std::int64_t> first, last, turned;

  void add(const AVFrame& frame, const AVRational& from, int per_second, bool wraps) {
    const std::uint64_t number = frames++;
    std::optional<std::int64_t> stamp;
    if (frame.pts != AV_NOPTS_VALUE) stamp = av_rescale_q(frame.pts, from, {1, per_second});
    const auto since = [&] { return wraps ? unwrapped(*stamp - *last) : *stamp - *last; };
    const bool follows = stamp && (!last || since() > 0);
    if (!follows && !turned) turned = static_cast<std::int64_t>(number);
    if (!stamp) return;
    if (!first) first = *stamp;
    last = last ? *last + since() : *stamp;
  }
};

}  // namespace

nlohmann::json count_frames(const nlohmann::json& with, JobSegments& segments) {
  const std::string name = with.at("name"), media = with.at("media");
  const bool complete = with.at("complete");
  const std::unique_ptr<crypto::ByteSource> segment = segments.open(0);
  const auto per_second = static_cast<int>(archive::unit_of_media(media).per_second);
  const bool wraps = media == "video/mp2t";
  const CarriedNumbers carried = numbers_carried(*segment, media, complete, name);
  Counted counted;
  std::optional<SegmentInput> input;
  try {
    input.emplace(*segment, media, name);
    const AVRational from = input->video().time_base;
    PictureDecoder decoder(*input, name);
    while (decoder.next()) counted.add(decoder.frame(), from, per_second, wraps);
  } catch (const MediaError&) {  // cut off, perhaps before its first picture
    if (complete) throw;
  }
  if (counted.frames > 0 || complete) require_one_film(input->context(), carried, name);
  nlohmann::json answer{{"frames", counted.frames}};
  if (counted.first) answer.update({{"first", *counted.first}, {"last", *counted.last}});
  if (counted.turned) answer["turned"] = *counted.turned;
  return answer;
}

}  // namespace kiroku::media

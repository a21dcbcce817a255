#include "media/inspection/frame_count_job.h"

#include <nlohmann/json.hpp>

#include "media/picture_decoder.h"
#include "media/segment_input.h"

namespace kiroku::media {

nlohmann::json count_frames(const nlohmann::json& with, JobSegments& segments) {
  const std::string name = with.at("name");
  const std::unique_ptr<crypto::ByteSource> segment = segments.open(0);
  std::uint64_t frames = 0;
  try {
    SegmentInput input(*segment, with.at("media"), name);
    PictureDecoder decoder(input, name);
    while (decoder.next()) {
      ++frames;
    }
  } catch (const MediaError&) {  // cut off, perhaps before its first picture
    if (with.at("complete").get<bool>()) {
      throw;
    }
  }
  return {{"frames", frames}};
}

}  // namespace kiroku::media

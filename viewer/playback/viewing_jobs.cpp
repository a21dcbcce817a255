#include "viewer/playback/viewing_jobs.h"

#include <nlohmann/json.hpp>

#include "base/error.h"

namespace kiroku::playback {
namespace {

using nlohmann::json;

constexpr int kLargestSide = 16'384, kLargestPoint = 255, kMostPictures = 1000, kFastestSound = 768'000,
              kMostChannels = 64, kLongestBlock = 1 << 20;

int within(const json& value, int least, int most) {
  const auto number = value.get<std::int64_t>();
  if (number < least || number > most) throw Error("a number is out of range");
  return static_cast<int>(number);
}

}  // namespace

json json_of(const VideoIndex& index) {
  json segments = json::array();
  for (const IndexedSegment& segment : index.segments) {
    segments.push_back({segment.entry.file.file, segment.start, segment.end, segment.begins_run,
                        segment.entry.complete, segment.entry.counted,
                        segment.offset ? json(*segment.offset) : json(nullptr)});
  }
  return {{"name", index.stream.name},
          {"kind", index.stream.kind},
          {"media", index.stream.media},
          {"segments", std::move(segments)}};
}

VideoIndex index_from(const json& stated) {
  VideoIndex index;
  index.stream.name = stated.at("name");
  index.stream.media = stated.at("media");
  index.stream.kind = stated.at("kind");
  for (const json& each : stated.at("segments")) {
    IndexedSegment segment;
    segment.entry.file.file = each.at(0);
    segment.start = each.at(1);
    segment.end = each.at(2);
    segment.begins_run = each.at(3);
    segment.entry.complete = each.at(4);
    segment.entry.counted = each.at(5);
    if (each.at(6).is_number()) segment.offset = each.at(6).get<Ticks>();
    index.segments.push_back(std::move(segment));
  }
  return index;
}

json json_of(const ViewingFormat& format) {
  return {{"size", {format.width, format.height}},
          {"aspect", {format.aspect_numerator, format.aspect_denominator}},
          {"colours", {format.primaries, format.transfer, format.matrix}},
          {"rate", format.rate}};
}

ViewingFormat format_from(const json& stated) {
  ViewingFormat format;
  format.width = within(stated.at("size").at(0), 2, kLargestSide);
  format.height = within(stated.at("size").at(1), 2, kLargestSide);
  format.aspect_numerator = within(stated.at("aspect").at(0), 1, INT32_MAX);
  format.aspect_denominator = within(stated.at("aspect").at(1), 1, INT32_MAX);
  format.primaries = within(stated.at("colours").at(0), 0, kLargestPoint);
  format.transfer = within(stated.at("colours").at(1), 0, kLargestPoint);
  format.matrix = within(stated.at("colours").at(2), 0, kLargestPoint);
  format.rate = within(stated.at("rate"), 1, kMostPictures);
  return format;
}

json json_of(const SoundForm& form) { return {form.rate, form.channels, form.block, form.origin}; }

SoundForm sound_form_from(const json& stated) {
  SoundForm form;
  form.rate = within(stated.at(0), 1, kFastestSound);
  form.channels = within(stated.at(1), 1, kMostChannels);
  form.block = within(stated.at(2), 1, kLongestBlock);
  form.origin = within(stated.at(3), 0, kLongestBlock);
  return form;
}

}  // namespace kiroku::playback

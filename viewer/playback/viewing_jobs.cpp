#include "viewer/playback/viewing_jobs.h"

#include <optional>
#include <string>
#include <utility>

#include <nlohmann/json.hpp>

#include "base/error.h"

namespace kiroku::playback {
namespace {

using nlohmann::json;

constexpr int kLargestSide = 16'384, kLargestPoint = 255, kMostPictures = 1000, kFastestSound = 768'000,
              kMostChannels = 64, kLongestBlock = 1 << 20;
constexpr int kBeginsRun = 1, kComplete = 2, kCounted = 4;

int within(const json& value, int least, int most) {
  const auto number = value.get<std::int64_t>();
  if (number < least || number > most) throw Error("a number is out of range");
  return static_cast<int>(number);
}

}  // namespace

// By columns, and offsets where they change: ten hours have tens of thousands of segments, and each decoder
// that is started is told of all.
json json_of(const VideoIndex& index) {
  json files = json::array(), starts = json::array(), ends = json::array(), offsets = json::array();
  std::string flags;
  const std::optional<Ticks>* before = nullptr;
  for (const IndexedSegment& segment : index.segments) {
    if (before == nullptr || *before != segment.offset)
      offsets.push_back({flags.size(), segment.offset ? json(*segment.offset) : json(nullptr)});
    before = &segment.offset;
    files.push_back(segment.entry.file.file);
    starts.push_back(segment.start);
    ends.push_back(segment.end);
    flags +=
        static_cast<char>('0' + (segment.begins_run ? kBeginsRun : 0) +
                          (segment.entry.complete ? kComplete : 0) + (segment.entry.counted ? kCounted : 0));
  }
  return {{"name", index.stream.name}, {"kind", index.stream.kind},    {"media", index.stream.media},
          {"files", std::move(files)}, {"starts", std::move(starts)},  {"ends", std::move(ends)},
          {"flags", std::move(flags)}, {"offsets", std::move(offsets)}};
}

VideoIndex index_from(const json& stated) {
  VideoIndex index;
  index.stream.name = stated.at("name");
  index.stream.media = stated.at("media");
  index.stream.kind = stated.at("kind");
  const std::string flags = stated.at("flags");
  const json &files = stated.at("files"), &starts = stated.at("starts"), &ends = stated.at("ends");
  auto next = stated.at("offsets").begin();
  const auto last = stated.at("offsets").end();
  std::optional<Ticks> offset;
  index.segments.reserve(flags.size());
  for (std::size_t i = 0; i < flags.size(); ++i) {
    if (next != last && next->at(0) == i) {
      offset = next->at(1).is_null() ? std::nullopt : std::optional(next->at(1).get<Ticks>());
      ++next;
    }
    IndexedSegment segment;
    segment.entry.file.file = files.at(i);
    segment.start = starts.at(i);
    segment.end = ends.at(i);
    const int bits = flags[i] - '0';
    segment.begins_run = (bits & kBeginsRun) != 0;
    segment.entry.complete = (bits & kComplete) != 0;
    segment.entry.counted = (bits & kCounted) != 0;
    segment.offset = offset;
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

#include "viewer/playback/picture_span.h"

#include <chrono>
#include <utility>

#include <nlohmann/json.hpp>

#include "base/error.h"
#include "media/segment_input.h"
#include "viewer/playback/viewing_jobs.h"

namespace kiroku::playback {
namespace {

using nlohmann::json;

/// One picture, whatever decodes it; the first may be far behind a key frame.
constexpr std::chrono::minutes kLongestJob{2};
constexpr int kLargestSide = 16'384, kChannels = 3;
/// No coded picture is smaller.
constexpr std::uint64_t kSmallestPicture = 16;
/// A hundred years: within what nanoseconds hold.
constexpr Ticks kFurthest = Ticks{100} * 366 * 24 * 3600 * kTicksPerSecond;

json or_null(const std::optional<Ticks>& ticks) { return ticks ? json(*ticks) : json(nullptr); }

std::uint64_t most_pictures_of(const VideoIndex& index) {
  std::uint64_t most = 0;
  for (const IndexedSegment& segment : index.segments)
    most += segment.entry.file.bytes / kSmallestPicture + kSmallestPicture;
  return most;
}

}  // namespace

PictureSpan::PictureSpan(const archive::CaseReader& recording, const crypto::AgeIdentities& identities,
                         const std::string& stream, std::int64_t from_ns, std::int64_t to_ns)
    : media_(recording, identities),
      index_(media_.video(stream)),
      ended_(recording.segments(stream, from_ns, to_ns).empty()),
      most_pictures_(most_pictures_of(index_)) {
  if (from_ns > 0) from_ = ticks_of_ns(from_ns);
  if (to_ns < INT64_MAX) stop_ = ticks_of_ns(to_ns) + 1;  // it may have been rounded down
}

void PictureSpan::refuse() const {
  throw media::MediaError("stream '" + index_.stream.name +
                          "' cannot be read: its decoder says what cannot be");
}

json PictureSpan::ask(const char* what, const json& with, const media::BoxedJobs::Taker& take) {
  const media::SegmentDoor door = [this](std::uint64_t segment) {
    if (segment >= index_.segments.size()) throw UsageError("there is no such segment");
    return media_.open_plaintext(index_.segments[segment].entry);
  };
  return box_->ask(what, with, door, "stream '" + index_.stream.name + "'", take, {.whole = kLongestJob});
}

void PictureSpan::open_box() {
  box_ = std::make_unique<media::BoxedJobs>();
  ask(kIndexJob, json_of(index_));
  ask(kSpanJob, {{"from", time_ ? json(nullptr) : or_null(from_)},
                 {"after", or_null(time_)},
                 {"stop", or_null(stop_)}});
}

bool PictureSpan::next() {
  if (ended_) return false;
  if (!box_ || box_->is_spent()) open_box();
  const json told = ask(kSpanNextJob, json::object());
  if (told.empty()) {
    ended_ = true;
    return false;
  }
  const auto number = [&](const char* name, std::int64_t least, std::int64_t most) {
    const auto found = told.find(name);
    if (found == told.end() || !found->is_number_integer() || *found < least || *found > most) refuse();
    return found->get<std::int64_t>();
  };
  // More pictures than there are bytes for would never end.
  if (most_pictures_-- == 0) refuse();
  time_ = number("time", time_ ? *time_ + 1 : -kFurthest, kFurthest);
  width_ = static_cast<int>(number("width", 1, kLargestSide));
  height_ = static_cast<int>(number("height", 1, kLargestSide));
  return true;
}

std::vector<std::uint8_t> PictureSpan::pixels(bool of_before, int width, int height) {
  const std::size_t samples =
      static_cast<std::size_t>(width) * static_cast<std::size_t>(height) * std::size_t{kChannels};
  std::vector<std::uint8_t> rgb;
  rgb.reserve(samples);
  ask(kSpanPixelsJob, {{"before", of_before}, {"width", width}, {"height", height}}, [&](ByteView bytes) {
    if (rgb.size() + bytes.size() > samples) return false;
    for (const std::byte byte : bytes) rgb.push_back(std::to_integer<std::uint8_t>(byte));
    return true;
  });
  if (rgb.size() != samples) refuse();
  return rgb;
}

std::vector<std::uint8_t> PictureSpan::rgb(int width, int height) {
  return pixels(false, width == 0 ? width_ : width, height == 0 ? height_ : height);
}

std::vector<std::uint8_t> PictureSpan::rgb_of_one_before(int width, int height) {
  return pixels(true, width, height);
}

}  // namespace kiroku::playback

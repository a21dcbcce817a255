#include "viewer/playback/viewing_boxes.h"

#include <algorithm>
#include <chrono>
#include <unordered_map>
#include <utility>

#include <nlohmann/json.hpp>

extern "C" {
#include <libavutil/frame.h>
}

#include "base/error.h"
#include "media/rgb_converter.h"
#include "media/segment_input.h"
#include "viewer/playback/picture_reader.h"
#include "viewer/playback/viewing_jobs.h"
#include "viewer/playback/viewing_piece.h"
#include "viewer/playback/viewing_sound.h"

namespace kiroku::playback {
namespace {

using nlohmann::json;

/// Nobody waits longer for what a page shows at once, whatever decodes it.
constexpr std::chrono::minutes kLongestJob{2};
/// Of a picture of 8K without loss; of a piece of some seconds at many times the rate of its kind.
constexpr std::size_t kLargestStill = 128U << 20, kLargestPiece = 32U << 20, kLargestThumbnail = 1U << 20;

/// What the box answered, read by `read`.
template <typename Read>
auto believed(const VideoIndex& index, const Read& read) {
  const auto refuse = [&] {
    return media::MediaError("stream '" + index.stream.name +
                             "' cannot be shown: its decoder says what cannot be");
  };
  try {
    return read();
  } catch (const json::exception&) {
    throw refuse();
  } catch (const Error&) {
    throw refuse();
  }
}

/// Whoever has the case opens its segments.
class AskedSegments : public SegmentOpener {
 public:
  AskedSegments(const VideoIndex& index, media::JobSegments& segments) : segments_(segments) {
    numbers_.reserve(index.segments.size());
    for (std::size_t i = 0; i < index.segments.size(); ++i) numbers_[index.segments[i].entry.file.file] = i;
  }
  [[nodiscard]] std::unique_ptr<crypto::ByteSource> open_plaintext(
      const archive::SegmentEntry& segment) const override {
    return segments_.open(numbers_.at(segment.file.file));
  }

 private:
  media::JobSegments& segments_;
  std::unordered_map<std::string, std::size_t> numbers_;
};

/// The pictures of a part of the stream, in order, of which the newest two are kept.
class SpanReading {
 public:
  SpanReading(const SegmentOpener& segments, const VideoIndex& index, const json& with)
      : reader_(segments, index) {
    if (const json& stop = with.at("stop"); !stop.is_null()) reader_.stop_before(stop.get<Ticks>());
    if (const json& from = with.at("from"); !from.is_null())
      static_cast<void>(reader_.seek(from.get<Ticks>()));
    if (const json& after = with.at("after"); !after.is_null()) pass_over(after.get<Ticks>());
  }

  json next() {
    before_ = std::move(newest_);
    newest_ = ahead_ ? std::exchange(ahead_, std::nullopt) : reader_.next();
    if (!newest_) return json::object();
    return {{"time", newest_->time}, {"width", newest_->frame->width}, {"height", newest_->frame->height}};
  }

  Bytes pixels(bool of_before, int width, int height) {
    const std::optional<ArchivedPicture>& of = of_before ? before_ : newest_;
    if (!of) throw UsageError("there is no such picture");
    const std::vector<std::uint8_t> rgb = converter_.convert(*of->frame, width, height);
    return to_bytes(std::as_bytes(std::span(rgb)));
  }

 private:
  void pass_over(Ticks time) {
    static_cast<void>(reader_.seek(time));
    while ((ahead_ = reader_.next()) && ahead_->time <= time) newest_ = std::move(ahead_);
  }

  PictureReader reader_;
  media::RgbConverter converter_;
  std::optional<ArchivedPicture> before_, newest_, ahead_;
};

/// What a box keeps from one job to the next.
struct Shown {
  Shown(VideoIndex of, media::JobSegments& from)
      : index(std::move(of)), segments(index, from), stepper(segments, index) {}
  const VideoIndex index;
  const AskedSegments segments;
  PictureStepper stepper;
  std::optional<SpanReading> span = {};
};

}  // namespace

// --- outside -----------------------------------------------------------------------------------------------

ViewingBoxes::ViewingBoxes(const CaseMedia& media, const VideoIndex& index)
    : media_(media), index_(index), boxes_([this](media::BoxedJobs& box) { tell_index(box); }) {}

json ViewingBoxes::ask(media::BoxedJobs& box, const char* what, const json& with, const Result& result) {
  return box.ask(what, with,
                 [this](std::uint64_t segment) {
                   if (segment >= index_.segments.size()) throw UsageError("there is no such segment");
                   return media_.open_plaintext(index_.segments[segment].entry);
                 },
                 "stream '" + index_.stream.name + "'", result.bytes,
                 {.whole = kLongestJob, .bytes = result.most});
}

json ViewingBoxes::ask(const char* what, const json& with, const Result& result) {
  return boxes_.with([&](media::BoxedJobs& box) { return ask(box, what, with, result); });
}

void ViewingBoxes::tell_index(media::BoxedJobs& box) { ask(box, kIndexJob, json_of(index_), {}); }

ViewingFormat ViewingBoxes::find_format() {
  const json answer = ask(kFormatJob, json::object(), {});
  return believed(index_, [&] { return format_from(answer.at("format")); });
}

Bytes ViewingBoxes::make_piece(const ViewingFormat& format, std::uint64_t number) {
  Bytes piece;
  ask(kPieceJob, {{"format", json_of(format)}, {"number", number}}, {&piece, kLargestPiece});
  return piece;
}

std::optional<SoundForm> ViewingBoxes::find_sound() {
  const json answer = ask(kSoundJob, json::object(), {});
  if (!answer.contains("form")) return {};
  return believed(index_, [&] { return sound_form_from(answer.at("form")); });
}

Bytes ViewingBoxes::make_sound_piece(const SoundForm& form, std::uint64_t number) {
  Bytes piece;
  ask(kSoundPieceJob, {{"form", json_of(form)}, {"number", number}}, {&piece, kLargestPiece});
  return piece;
}

Bytes ViewingBoxes::make_thumbnail(std::uint64_t number) {
  Bytes picture;
  ask(kThumbnailJob, {{"number", number}}, {&picture, kLargestThumbnail});
  return picture;
}

std::optional<ArchivedStill> ViewingBoxes::archived_picture(std::int64_t at_ns, Step step) {
  const std::lock_guard guard(stepping_);
  if (!stepper_ || stepper_->is_spent()) {
    stepper_ = std::make_unique<media::BoxedJobs>();
    tell_index(*stepper_);
  }
  ArchivedStill still;
  const json answer = ask(*stepper_, kStillJob, {{"at_ns", at_ns}, {"step", static_cast<int>(step)}},
                          {&still.png, kLargestStill});
  if (!answer.contains("time_ns")) return {};
  still.time_ns = believed(index_, [&] { return answer.at("time_ns").get<std::int64_t>(); });
  return still;
}

// --- in the box --------------------------------------------------------------------------------------------

media::Jobs viewing_jobs() {
  // Made by the first job, of which all others are.
  const auto shown = std::make_shared<std::unique_ptr<Shown>>();
  media::Jobs jobs;
  jobs[kIndexJob] = [shown](const json& with, media::JobSegments& segments) {
    *shown = std::make_unique<Shown>(index_from(with), segments);
    return json::object();
  };
  jobs[kFormatJob] = [shown](const json&, media::JobSegments&) {
    const Shown& of = **shown;
    return json{{"format", json_of(find_viewing_format(of.segments, of.index))}};
  };
  jobs[kPieceJob] = [shown](const json& with, media::JobSegments& segments) {
    const Shown& of = **shown;
    segments.give(
        make_viewing_piece(of.segments, of.index, format_from(with.at("format")), with.at("number")));
    return json::object();
  };
  jobs[kSoundJob] = [shown](const json&, media::JobSegments&) {
    const Shown& of = **shown;
    const std::optional<SoundForm> form = find_sound(of.segments, of.index);
    return form ? json{{"form", json_of(*form)}} : json::object();
  };
  jobs[kSoundPieceJob] = [shown](const json& with, media::JobSegments& segments) {
    const Shown& of = **shown;
    segments.give(
        make_sound_piece(of.segments, of.index, sound_form_from(with.at("form")), with.at("number")));
    return json::object();
  };
  jobs[kThumbnailJob] = [shown](const json& with, media::JobSegments& segments) {
    const Shown& of = **shown;
    const Ticks from = with.at("number").get<Ticks>() * kPieceTicks;
    segments.give(make_thumbnail(of.segments, of.index, from, from + kPieceTicks));
    return json::object();
  };
  jobs[kStillJob] = [shown](const json& with, media::JobSegments& segments) {
    const ArchivedPicture* const found = (*shown)->stepper.find(
        ticks_of_ns(with.at("at_ns").get<std::int64_t>()), static_cast<Step>(with.at("step").get<int>()));
    if (found == nullptr) return json::object();
    segments.give(png_of_archived(*found->frame));
    return json{{"time_ns", ns_of_ticks(found->time)}};
  };
  jobs[kSpanJob] = [shown](const json& with, media::JobSegments&) {
    Shown& of = **shown;
    of.span.emplace(of.segments, of.index, with);
    return json::object();
  };
  jobs[kSpanNextJob] = [shown](const json&, media::JobSegments&) { return (*shown)->span.value().next(); };
  jobs[kSpanPixelsJob] = [shown](const json& with, media::JobSegments& segments) {
    segments.give((*shown)->span.value().pixels(with.at("before"), with.at("width"), with.at("height")));
    return json::object();
  };
  return jobs;
}

}  // namespace kiroku::playback

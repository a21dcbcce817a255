// The pictures of a film that somebody else made, one after the other, for measuring. An object belongs to
// one thread.
#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>

#include "media/libav_handles.h"
#include "recorder/source/source.h"

namespace kiroku::recorder {

/// A part of a film, from its first picture on.
struct ClipStretch {
  std::int64_t from_ns = 0;
  std::optional<std::int64_t> duration_ns;
};

/// Demuxed and decoded in a box (source/boxed_source.h); what comes out is copied, so that it stays what it
/// is. Pictures are planar YCbCr of the film's own subsampling and range, of 8 or 10 bits; a film in RGB
/// becomes 4:4:4, by BT.709 and of limited range; one in grey is of limited range, too.
class Clip {
 public:
  /// Throws kiroku::Error: not there, no film, no pictures; kiroku::IoError where there is no box.
  Clip(const std::filesystem::path& file, ClipStretch stretch);
  ~Clip();
  Clip(const Clip&) = delete;
  Clip& operator=(const Clip&) = delete;

  /// The next picture of the stretch; its pts is the time since the stretch's beginning in nanoseconds. Null
  /// at the end. Throws kiroku::Error where the film changes its size or format.
  media::Frame next();
  /// Of the pictures that next() gives.
  [[nodiscard]] const PictureFormat& format() const { return format_; }
  [[nodiscard]] Rational frame_rate() const { return source_->frame_rate(); }
  /// Of a sample.
  [[nodiscard]] int depth() const;
  /// What the film's pictures were coded with before.
  [[nodiscard]] SourceCoding coding() const { return source_->coding(); }
  /// The film's own pictures, for people.
  [[nodiscard]] std::string described() const { return given_.to_string(); }

 private:
  media::Frame converted(media::Frame frame);

  const std::filesystem::path file_;
  const ClipStretch stretch_;
  const CaseClock clock_;
  std::unique_ptr<Source> source_;
  PictureFormat given_, format_;
  std::unique_ptr<class FrameFilter> filter_;  // null where pictures are taken as they come
};

/// `frame` as `wanted`, of the same size; the range is kept or changed with it. The frame's range stands in
/// its color_range, not in its format's name (source/source.h, state_range_apart()). The filter is made when
/// it is needed first and stays with its owner.
media::Frame as_format(media::Frame frame, const PictureFormat& wanted,
                       std::unique_ptr<class FrameFilter>& filter);

/// Whether every sample of both is the same; they are of one size and planar format.
bool same_samples(const AVFrame& one, const AVFrame& other);

}  // namespace kiroku::recorder

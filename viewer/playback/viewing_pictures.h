// Archived pictures made ready for a viewing copy: fields woven into full pictures, size and pixel format the
// copy's. An object belongs to one thread.
#pragma once

#include <deque>
#include <memory>
#include <vector>

#include "media/libav_handles.h"
#include "viewer/playback/case_ticks.h"
#include "viewer/playback/picture_reader.h"
#include "viewer/playback/viewing_format.h"

namespace kiroku::playback {

/// The form of the copy for pictures like this one.
ViewingFormat viewing_format_of(const AVFrame& picture, Ticks usual_duration);

/// One picture out for each one in, with its time.
class ViewingPictures {
 public:
  explicit ViewingPictures(const ViewingFormat& format);
  ~ViewingPictures();
  ViewingPictures(const ViewingPictures&) = delete;
  ViewingPictures& operator=(const ViewingPictures&) = delete;

  /// Those that are ready: none while a picture of two fields waits for the next. Throws kiroku::Error for a
  /// pixel format that cannot be shown.
  std::vector<ArchivedPicture> add(ArchivedPicture picture);
  /// What still waited. Nothing may be added after.
  std::vector<ArchivedPicture> finish();

 private:
  class Deinterlacer;

  media::Frame converted(const AVFrame& frame);

  ViewingFormat format_;
  std::unique_ptr<Deinterlacer> deinterlacer_;
  media::Scaler scaler_;
};

}  // namespace kiroku::playback

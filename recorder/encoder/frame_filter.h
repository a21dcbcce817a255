// Changes pictures on their way to the encoder: pixel format, deinterlacing. One thread.
#pragma once

#include <string>

#include "media/libav_handles.h"
#include "recorder/source/source.h"

struct AVFilterContext;

namespace kiroku::recorder {

/// A libavfilter chain that gives one picture for each.
class FrameFilter {
 public:
  /// `description` as ffmpeg's -vf takes it, e.g. "bwdif=mode=send_frame,format=yuv420p".
  FrameFilter(const PictureFormat& format, const std::string& description);
  /// The changed picture; null while the filter still waits for a later one.
  media::Frame apply(media::Frame frame);
  /// What the filter still held; null when empty.
  media::Frame drain();

 private:
  media::Frame take();

  media::FilterGraph graph_;
  AVFilterContext* source_ = nullptr;
  AVFilterContext* sink_ = nullptr;
};

}  // namespace kiroku::recorder

#include "recorder/encoder/frame_filter.h"

extern "C" {
#include <libavfilter/avfilter.h>
#include <libavfilter/buffersink.h>
#include <libavfilter/buffersrc.h>
#include <libavutil/frame.h>
#include <libavutil/mem.h>
}

#include "base/error.h"

namespace kiroku::recorder {

using media::require;

namespace {

constexpr const char* kAction = "cannot convert pictures for the encoder";
constexpr AVRational kNanoseconds{1, 1'000'000'000};

}  // namespace

FrameFilter::FrameFilter(const PictureFormat& format, const std::string& description)
    : graph_(avfilter_graph_alloc()) {
  if (!graph_) throw std::bad_alloc();
  graph_->nb_threads = 1;
  source_ = avfilter_graph_alloc_filter(graph_.get(), avfilter_get_by_name("buffer"), "in");
  if (source_ == nullptr) throw std::bad_alloc();
  const std::unique_ptr<AVBufferSrcParameters, decltype(&av_free)> parameters(av_buffersrc_parameters_alloc(),
                                                                              av_free);
  if (!parameters) throw std::bad_alloc();
  parameters->format = format.pixel_format;
  parameters->width = format.width;
  parameters->height = format.height;
  parameters->time_base = kNanoseconds;  // pictures carry their case-clock time
  parameters->sample_aspect_ratio = {format.sample_aspect.numerator, format.sample_aspect.denominator};
  require(av_buffersrc_parameters_set(source_, parameters.get()), kAction);
  require(avfilter_init_dict(source_, nullptr), kAction);
  require(avfilter_graph_create_filter(&sink_, avfilter_get_by_name("buffersink"), "out", nullptr, nullptr,
                                       graph_.get()),
          kAction);

  AVFilterInOut* inputs = nullptr;
  AVFilterInOut* outputs = nullptr;
  int result = avfilter_graph_parse2(graph_.get(), description.c_str(), &inputs, &outputs);
  if (result >= 0)
    result = avfilter_link(source_, 0, inputs->filter_ctx, static_cast<unsigned>(inputs->pad_idx));
  if (result >= 0)
    result = avfilter_link(outputs->filter_ctx, static_cast<unsigned>(outputs->pad_idx), sink_, 0);
  avfilter_inout_free(&inputs);
  avfilter_inout_free(&outputs);
  require(result, kAction);
  require(avfilter_graph_config(graph_.get(), nullptr), kAction);
}

media::Frame FrameFilter::take() {
  media::Frame frame = media::make_frame();
  const int result = av_buffersink_get_frame(sink_, frame.get());
  if (result == AVERROR(EAGAIN) || result == AVERROR_EOF) return {};
  require(result, kAction);
  // A deinterlacer counts in half steps.
  frame->pts = av_rescale_q(frame->pts, av_buffersink_get_time_base(sink_), kNanoseconds);
  return frame;
}

media::Frame FrameFilter::apply(media::Frame frame) {
  require(av_buffersrc_add_frame(source_, frame.get()), kAction);
  return take();
}

media::Frame FrameFilter::drain() {
  (void)av_buffersrc_close(source_, 0, 0);
  return take();
}

}  // namespace kiroku::recorder

#include "media/quality/picture_pair_filter.h"

#include <cmath>
#include <cstdlib>

extern "C" {
#include <libavfilter/avfilter.h>
#include <libavfilter/buffersink.h>
#include <libavfilter/buffersrc.h>
#include <libavutil/dict.h>
#include <libavutil/frame.h>
#include <libavutil/mem.h>
}

#include "base/error.h"

namespace kiroku::media {
namespace {

constexpr const char* kAction = "cannot compare pictures";

AVFilterContext* add_input(AVFilterGraph& graph, const char* name, const AVFrame& like) {
  AVFilterContext* const input = avfilter_graph_alloc_filter(&graph, avfilter_get_by_name("buffer"), name);
  const std::unique_ptr<AVBufferSrcParameters, decltype(&av_free)> parameters(av_buffersrc_parameters_alloc(),
                                                                              av_free);
  if (input == nullptr || !parameters) throw std::bad_alloc();
  parameters->format = like.format;
  parameters->width = like.width;
  parameters->height = like.height;
  parameters->time_base = {1, 1};
  require(av_buffersrc_parameters_set(input, parameters.get()), kAction);
  require(avfilter_init_dict(input, nullptr), kAction);
  return input;
}

double stated(const AVFrame& measured, const char* key) {
  const AVDictionaryEntry* const entry = av_dict_get(measured.metadata, key, nullptr, 0);
  if (entry == nullptr) throw Error(std::string("this libavfilter does not say '") + key + "' of a picture");
  return std::strtod(entry->value, nullptr);
}

}  // namespace

PicturePairFilter::Graph PicturePairFilter::make(const std::string& filter, const AVFrame& like) {
  silence_libav();
  const AVFilter* const kind = avfilter_get_by_name(filter.c_str());
  if (kind == nullptr)
    throw Error("this libavfilter has no filter '" + filter + "'; install Debian's FFmpeg libraries");
  Graph made;
  made.graph.reset(avfilter_graph_alloc());
  if (!made.graph) throw std::bad_alloc();
  made.graph->nb_threads = 1;
  made.coded = add_input(*made.graph, "coded", like);
  made.original = add_input(*made.graph, "original", like);
  AVFilterContext* comparing = nullptr;
  require(avfilter_graph_create_filter(&comparing, kind, "comparing", nullptr, nullptr, made.graph.get()),
          kAction);
  require(avfilter_graph_create_filter(&made.sink, avfilter_get_by_name("buffersink"), "out", nullptr,
                                       nullptr, made.graph.get()),
          kAction);
  require(avfilter_link(made.coded, 0, comparing, 0), kAction);
  require(avfilter_link(made.original, 0, comparing, 1), kAction);
  require(avfilter_link(comparing, 0, made.sink, 0), kAction);
  require(avfilter_graph_config(made.graph.get(), nullptr), kAction);
  return made;
}

PicturePairFilter::PicturePairFilter(const AVFrame& like)
    : psnr_(make("psnr", like)), ssim_(make("ssim", like)) {}

Frame PicturePairFilter::run(Graph& graph, const AVFrame& coded, const AVFrame& original) const {
  for (const auto& [input, picture] :
       {std::pair{graph.coded, &coded}, std::pair{graph.original, &original}}) {
    Frame given = reference(*picture);
    given->pts = pairs_;
    // What they are meant to look like is no business of who compares samples.
    given->color_range = AVCOL_RANGE_UNSPECIFIED;
    given->colorspace = AVCOL_SPC_UNSPECIFIED;
    given->sample_aspect_ratio = {0, 1};
    require(av_buffersrc_add_frame(input, given.get()), kAction);
  }
  Frame measured = make_frame();
  require(av_buffersink_get_frame(graph.sink, measured.get()), kAction);
  return measured;
}

PairMeasures PicturePairFilter::measure(const AVFrame& coded, const AVFrame& original) {
  PairMeasures measures;
  measures.mean_square_error = stated(*run(psnr_, coded, original), "lavfi.psnr.mse_avg");
  measures.ssim = stated(*run(ssim_, coded, original), "lavfi.ssim.All");
  ++pairs_;
  return measures;
}

std::optional<double> psnr_of(double mean_square_error, int depth) {
  if (mean_square_error <= 0) return {};
  const double peak = std::pow(2, depth) - 1;
  return 10 * std::log10(peak * peak / mean_square_error);
}

}  // namespace kiroku::media

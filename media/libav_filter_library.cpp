#include "media/libav_filter_library.h"

#include <cstdint>  // libavutil/common.h asks for UINT64_C
#include <dlfcn.h>
#include <string>

extern "C" {
#include <libavfilter/avfilter.h>
#include <libavfilter/buffersink.h>
#include <libavfilter/buffersrc.h>
#include <libavfilter/version.h>
#include <libavutil/macros.h>
}

#include "base/error.h"
#include "media/libav_handles.h"

namespace kiroku::media {
namespace {

/// Of the version whose headers say how it is used.
constexpr const char* kLibrary = "libavfilter.so." AV_STRINGIFY(LIBAVFILTER_VERSION_MAJOR);

[[noreturn]] void refuse() {
  const char* const why = ::dlerror();
  throw Error(
      std::string("nothing can be filtered: ") + (why != nullptr ? why : kLibrary) +
      "; install FFmpeg's libavfilter (Debian: libavfilter" AV_STRINGIFY(LIBAVFILTER_VERSION_MAJOR) ")");
}

void* library() {
  // Where it throws the next call tries again: descriptors may have run out, or an upgrade be under way.
  static void* const loaded = [] {
    void* const opened = ::dlopen(kLibrary, RTLD_LAZY | RTLD_LOCAL);
    if (opened == nullptr) refuse();
    return opened;
  }();
  return loaded;
}

/// The library's own function of the type of `like`.
template <typename Function>
Function* real(Function* /*like*/, const char* name) {
  void* const found = ::dlsym(library(), name);
  if (found == nullptr) refuse();
  return reinterpret_cast<Function*>(found);
}

}  // namespace

void load_filter_library() { (void)library(); }

void LibavDeleter::operator()(AVFilterGraph* object) const noexcept { avfilter_graph_free(&object); }
void LibavDeleter::operator()(AVFilterInOut* object) const noexcept { avfilter_inout_free(&object); }

}  // namespace kiroku::media

// What this project calls of libavfilter, under its own names, so that callers are checked against its
// headers. Hidden, so that the library itself never finds these.
using kiroku::media::real;
#define KIROKU_HERE extern "C" [[gnu::visibility("hidden")]]

KIROKU_HERE const AVFilter* avfilter_get_by_name(const char* name) {
  static auto* const own = real(&avfilter_get_by_name, "avfilter_get_by_name");
  return own(name);
}
KIROKU_HERE AVFilterGraph* avfilter_graph_alloc() {
  static auto* const own = real(&avfilter_graph_alloc, "avfilter_graph_alloc");
  return own();
}
KIROKU_HERE void avfilter_graph_free(AVFilterGraph** graph) {
  static auto* const own = real(&avfilter_graph_free, "avfilter_graph_free");
  return own(graph);
}
KIROKU_HERE AVFilterContext* avfilter_graph_alloc_filter(AVFilterGraph* graph, const AVFilter* filter,
                                                         const char* name) {
  static auto* const own = real(&avfilter_graph_alloc_filter, "avfilter_graph_alloc_filter");
  return own(graph, filter, name);
}
KIROKU_HERE int avfilter_graph_create_filter(AVFilterContext** made, const AVFilter* filter, const char* name,
                                             const char* options, void* opaque, AVFilterGraph* graph) {
  static auto* const own = real(&avfilter_graph_create_filter, "avfilter_graph_create_filter");
  return own(made, filter, name, options, opaque, graph);
}
KIROKU_HERE int avfilter_graph_parse2(AVFilterGraph* graph, const char* filters, AVFilterInOut** inputs,
                                      AVFilterInOut** outputs) {
  static auto* const own = real(&avfilter_graph_parse2, "avfilter_graph_parse2");
  return own(graph, filters, inputs, outputs);
}
KIROKU_HERE int avfilter_graph_config(AVFilterGraph* graph, void* logged) {
  static auto* const own = real(&avfilter_graph_config, "avfilter_graph_config");
  return own(graph, logged);
}
KIROKU_HERE void avfilter_inout_free(AVFilterInOut** pads) {
  static auto* const own = real(&avfilter_inout_free, "avfilter_inout_free");
  return own(pads);
}
KIROKU_HERE int avfilter_init_dict(AVFilterContext* filter, AVDictionary** options) {
  static auto* const own = real(&avfilter_init_dict, "avfilter_init_dict");
  return own(filter, options);
}
KIROKU_HERE int avfilter_link(AVFilterContext* from, unsigned from_pad, AVFilterContext* to,
                              unsigned to_pad) {
  static auto* const own = real(&avfilter_link, "avfilter_link");
  return own(from, from_pad, to, to_pad);
}
KIROKU_HERE AVBufferSrcParameters* av_buffersrc_parameters_alloc() {
  static auto* const own = real(&av_buffersrc_parameters_alloc, "av_buffersrc_parameters_alloc");
  return own();
}
KIROKU_HERE int av_buffersrc_parameters_set(AVFilterContext* source, AVBufferSrcParameters* parameters) {
  static auto* const own = real(&av_buffersrc_parameters_set, "av_buffersrc_parameters_set");
  return own(source, parameters);
}
KIROKU_HERE int av_buffersrc_add_frame(AVFilterContext* source, AVFrame* frame) {
  static auto* const own = real(&av_buffersrc_add_frame, "av_buffersrc_add_frame");
  return own(source, frame);
}
KIROKU_HERE int av_buffersrc_close(AVFilterContext* source, std::int64_t pts, unsigned flags) {
  static auto* const own = real(&av_buffersrc_close, "av_buffersrc_close");
  return own(source, pts, flags);
}
KIROKU_HERE int av_buffersink_get_frame(AVFilterContext* sink, AVFrame* frame) {
  static auto* const own = real(&av_buffersink_get_frame, "av_buffersink_get_frame");
  return own(sink, frame);
}
KIROKU_HERE AVRational av_buffersink_get_time_base(const AVFilterContext* sink) {
  static auto* const own = real(&av_buffersink_get_time_base, "av_buffersink_get_time_base");
  return own(sink);
}
#undef KIROKU_HERE

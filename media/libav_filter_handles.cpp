// Apart from the other deleters: libavfilter loads 33 libraries, and only a program that filters links this
// file.
#include <cstdint>  // libavutil/common.h asks for UINT64_C

extern "C" {
#include <libavfilter/avfilter.h>
}

#include "media/libav_handles.h"

namespace kiroku::media {

void LibavDeleter::operator()(AVFilterGraph* object) const noexcept { avfilter_graph_free(&object); }
void LibavDeleter::operator()(AVFilterInOut* object) const noexcept { avfilter_inout_free(&object); }

}  // namespace kiroku::media

// FFmpeg's own measures of a picture beside its original. An object belongs to one thread.
#pragma once

#include <optional>
#include <string>

#include "media/libav_handles.h"

struct AVFilterContext;

namespace kiroku::media {

/// What libavfilter's "psnr" and "ssim" say of one pair.
struct PairMeasures {
  double mean_square_error = 0;  // over all samples of all planes, as "psnr" weighs them
  double ssim = 0;               // of all planes together ("All")
};

/// Pairs of one size and planar pixel format.
class PicturePairFilter {
 public:
  /// Of that size and format shall all pairs be. Throws kiroku::Error where this libavfilter lacks a filter.
  explicit PicturePairFilter(const AVFrame& like);
  PicturePairFilter(const PicturePairFilter&) = delete;
  PicturePairFilter& operator=(const PicturePairFilter&) = delete;

  PairMeasures measure(const AVFrame& coded, const AVFrame& original);

 private:
  struct Graph {
    FilterGraph graph;
    AVFilterContext* coded = nullptr;
    AVFilterContext* original = nullptr;
    AVFilterContext* sink = nullptr;
  };
  static Graph make(const std::string& filter, const AVFrame& like);
  Frame run(Graph& graph, const AVFrame& coded, const AVFrame& original) const;

  Graph psnr_, ssim_;
  std::int64_t pairs_ = 0;
};

/// Decibels against `depth` bits; nothing where there is no error at all.
std::optional<double> psnr_of(double mean_square_error, int depth);

}  // namespace kiroku::media

// Looking for the organ in a picture of which nothing is known.
#pragma once

#include <memory>
#include <vector>

#include "sim/align/outline_fit.h"
#include "sim/align/search_range.h"

namespace kiroku::sim {

/// Silhouettes of one organ from all directions of the range, drawn once. Searching is thread-safe, and works
/// on as many threads as the machine has cores; what it finds does not depend on their number.
class PoseSearch {
 public:
  /// Keeps a reference to the surface.
  PoseSearch(const OrganSurface& surface, const SearchRange& range);
  ~PoseSearch();
  PoseSearch(const PoseSearch&) = delete;
  PoseSearch& operator=(const PoseSearch&) = delete;

  /// The cameras whose silhouettes part the picture's colours best, each then fitted to the outline that the
  /// picture shows, the best first; those that are the same are there once. Takes a second or so.
  ///
  /// Silhouettes from about a hundred directions, each turned and shifted over the picture at several sizes,
  /// are compared by the mutual information of silhouette and kind of colour (Viola and Wells, "Alignment by
  /// Maximization of Mutual Information", IJCV 1997), which knows no colour beforehand. What is covered
  /// is of no kind.
  ///
  /// `cover` and `cells` are of the picture.
  [[nodiscard]] std::vector<OutlineFit> find(const Picture& picture, const Cover& cover,
                                             const ColourCells& cells, const Pinhole& pinhole) const;

 private:
  struct Bank;
  const OrganSurface& surface_;
  SearchRange range_;
  std::unique_ptr<Bank> bank_;
};

}  // namespace kiroku::sim

// Looking for the organ in a picture of which nothing is known. Functions are pure and thread-safe.
#pragma once

#include <vector>

#include "sim/align/outline_fit.h"

namespace kiroku::sim {

/// From where the organ may be seen, and how near.
struct SearchRange {
  Vector3 from{0, -1, 0};  // from the organ's middle towards the camera, patient coordinates
  double spread_deg = 75;  // how far the camera may be off that direction
  double nearest_m = 0.03, farthest_m = 0.4;  // of the organ's middle
};

/// The cameras whose silhouettes part the picture's colours best, each then fitted to the outline that the
/// picture shows, the best first; those that are the same are there once. Takes a second or so.
///
/// Silhouettes from about a hundred directions, each turned and shifted over the picture at several sizes,
/// are compared by the mutual information of silhouette and kind of colour (Viola and Wells, "Alignment by
/// Maximization of Mutual Information", IJCV 1997), which knows no colour beforehand.
std::vector<OutlineFit> search_pose(const Picture& picture, const OrganSurface& surface,
                                    const Pinhole& pinhole, const SearchRange& range);

}  // namespace kiroku::sim

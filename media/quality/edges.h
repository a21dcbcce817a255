// How well edges stay where they were. Pure, thread-safe.
#pragma once

#include "media/quality/plane.h"

namespace kiroku::media {

/// The edge preservation measure of Sattar, Floreby, Salomonsson and Lövström (IEEE Transactions on Image
/// Processing 6(6), 1997): the correlation of both lumas after a Laplacian of 3x3 pixels. 1 for the same
/// edges, 0 for edges that have nothing in common. 1 where neither has any. Throws kiroku::Error for
/// different sizes and less than 3x3 pixels.
double edges_kept(const Plane& original, const Plane& coded);

}  // namespace kiroku::media

// How alike two pictures are in structure, from coarse to fine. Pure, thread-safe.
#pragma once

#include "media/quality/plane.h"

namespace kiroku::media {

/// A picture's shorter side must have so many pixels: the window of 11 still fits after four halvings.
inline constexpr int kFewestMsSsimPixels = 176;

/// Multi-scale SSIM of two lumas of one size (Wang, Simoncelli and Bovik, Asilomar 2003): 1 for the same
/// picture. Five scales, a Gaussian window of 11 pixels and 1.5 deviation, the paper's constants (0.01, 0.03)
/// and weights. Throws kiroku::Error for pictures of other or of too small sizes.
double ms_ssim(const Plane& one, const Plane& other);

}  // namespace kiroku::media

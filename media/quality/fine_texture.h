// How much of the fine texture of mucosa a coded picture keeps. Functions are pure and thread-safe; objects
// belong to one thread.
//
// Fine texture is what a band-pass lets through: the difference of two Gaussians whose deviations differ by a
// factor of two, an octave wide as the levels of a Laplacian pyramid are (Burt and Adelson, IEEE Transactions
// on Communications 31(4), 1983). What is kept is measured with the original at hand, by the cross power of
// both: a coder's noise and block edges have no phase in common with the texture, so they do not pass for it,
// as they do where two power spectra are compared (Kirk, Herzer, Artmann and Kunz, "Description of texture
// loss using the dead leaves target", Proc. SPIE 9023, 2014). A coder that drops a share of the texture's
// energy, coefficient by coefficient, keeps the rest: that is the number.
#pragma once

#include <cstdint>
#include <vector>

#include "media/png.h"
#include "media/quality/plane.h"

namespace kiroku::media {

/// 1 where a picture shows lit tissue, else 0: not grey, as instruments are, and not within eight pixels of
/// what is dark, as the frame round the picture is, or of a highlight (bright and without colour, as in Oh et
/// al., Medical Image Analysis 11(2), 2007). Rows from the top.
std::vector<std::uint8_t> tissue_mask(const PictureView& picture);
/// The mask's share of the picture, from 0 to 1.
double share_of(const std::vector<std::uint8_t>& mask);

/// One band of one picture, by the period that passes best, in pixels. Throws kiroku::Error for one below 2.
Plane band_of(const Plane& luma, double period);

/// Sums over the masked pixels of pictures, original and coded, of one band.
class TextureKept {
 public:
  /// Both bands and the mask are of one size.
  void add(const Plane& original, const Plane& coded, const std::vector<std::uint8_t>& mask);
  /// The share of the original's energy that comes back in phase: 1 all, 0 none. 1 where there is none.
  [[nodiscard]] double kept() const;
  /// Energy in the band that is not the original's, as a share of the original's.
  [[nodiscard]] double foreign() const;
  /// The original's energy: the mean square of its band.
  [[nodiscard]] double energy() const;

 private:
  double original_ = 0, coded_ = 0, cross_ = 0;
  std::uint64_t pixels_ = 0;
};

}  // namespace kiroku::media

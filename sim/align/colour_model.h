// Which colours are the organ's and which its surroundings'. Plain data; functions are pure and thread-safe.
//
// Source: histograms of colours within and around a silhouette as PWP3D has them (Prisacariu and Reid,
// "PWP3D: Real-time Segmentation and Tracking of 3D Objects", IJCV 2012).
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "sim/align/cover.h"
#include "sim/align/silhouette.h"
#include "sim/render/picture.h"

namespace kiroku::sim {

/// Colours are told by red's and green's share of the light, and coarsely by how much light there is. Light
/// falls off, and tissue has lighter and darker spots: both leave the shares as they are. A model knows its
/// colours in light of one cell more or less: a third more in bright pictures, at least, and by a larger
/// factor in the shade. Beyond that they are unknown to it (evidence 0), not the other's.
inline constexpr std::size_t kRedCells = 32, kGreenCells = 32, kLightCells = 8,
                             kColours = kRedCells * kGreenCells * kLightCells;

/// For each pixel the number of its colour's cell.
struct ColourCells {
  static constexpr std::uint16_t kCovered = 0xffff;  // nothing is known of what is below
  int width = 0, height = 0;
  std::vector<std::uint16_t> cell;  // (height x width)
  [[nodiscard]] std::uint16_t at(int x, int y) const {
    return cell[static_cast<std::size_t>(y) * static_cast<std::size_t>(width) + static_cast<std::size_t>(x)];
  }
};
/// After a median over 5 x 5 pixels, which takes noise and the blocks of a codec, and leaves borders in
/// place.
ColourCells colour_cells(const Picture& picture, const Cover& cover);

struct ColourModel {
  std::array<float, kColours> within{}, around{};  // shares, each of sum 1
  std::array<float, kColours> evidence{};          // log(within / around), bounded; 0 for what was not seen
};

/// Of the pixels within the silhouette and of those around it, a ring of `ring_px`; both without a seam along
/// the outline and without what is covered. Without colours where one of the two is not in the picture.
ColourModel colours_of(const ColourCells& cells, const Silhouette& silhouette, double ring_px);
/// `share` of the newer.
ColourModel mixed(const ColourModel& old, const ColourModel& newer, double share);

/// A picture of few kinds of colour, found without knowing what is shown: for looking for an organ.
struct KindsOfColour {
  static constexpr int kKinds = 8;
  static constexpr std::uint8_t kCovered = 255;  // of none of them
  int width = 0, height = 0;
  std::vector<std::uint8_t> kind;  // (height x width)
};
/// The same picture gives the same kinds.
KindsOfColour kinds_of_colour(const Picture& picture, const Cover& cover, int shrink);

}  // namespace kiroku::sim

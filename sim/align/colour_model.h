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

inline constexpr std::size_t kColours = 16 * 16 * 16;

/// The number of a colour's cell.
inline std::size_t colour_cell(const std::uint8_t* rgb) {
  constexpr unsigned kDropped = 4, kBits = 4;
  return (static_cast<std::size_t>(rgb[0] >> kDropped) << (2 * kBits)) |
         (static_cast<std::size_t>(rgb[1] >> kDropped) << kBits) |
         static_cast<std::size_t>(rgb[2] >> kDropped);
}

struct ColourModel {
  std::array<float, kColours> within{}, around{};  // shares, each of sum 1
  std::array<float, kColours> evidence{};          // log(within / around), bounded; 0 for what was not seen

  [[nodiscard]] double evidence_of(const std::uint8_t* rgb) const { return evidence[colour_cell(rgb)]; }
};

/// Of the pixels within the silhouette and of those around it, a ring of `ring_px`; both without a seam along
/// the outline and without what is covered. Without colours where one of the two is not in the picture.
ColourModel colours_of(const Picture& picture, const Cover& cover, const Silhouette& silhouette,
                       double ring_px);
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

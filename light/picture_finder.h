// Finds and reads codes in pictures (light_code.h). What it is given may come from an attacker: time and
// memory are bounded by the picture's size. The finder uses no library for pictures: it runs where foreign
// video is decoded (media/box/), and whatever is loaded there is within reach of the video.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

namespace kiroku::light {

/// Luma that somebody else holds; `stride` bytes from one row to the next.
struct GreyView {
  const std::uint8_t* samples = nullptr;
  int width = 0, height = 0;
  std::ptrdiff_t stride = 0;
};

struct Point {
  double x = 0, y = 0;  // pixels; the centre of the first one is (0, 0)
};
/// Outer corners of a code's bright frame: top left, top right, bottom right, bottom left, as the code lies.
using Place = std::array<Point, 4>;

/// Which cells a reading is made of: all, or those on one side of a line through the centre.
inline constexpr int kViews = 9;

/// One place in one picture.
struct Sighting {
  std::size_t place = 0;  // its number among the reader's places
  /// What the cells say: first of both cells of each pair, then of the half that lies towards east,
  /// south-east, south and on around. Bits as in light_code().
  std::array<std::uint64_t, kViews> words{};
  int opposite = 0;     // pairs of which one cell is bright and the other dark, of kCodeBits
  double contrast = 0;  // between bright and dark cells, in samples
  /// How well bright and dark are apart: of the cells that are nearest to the middle between the two, how far
  /// they are from it, as a share of all cells' mean. Some 0.15 of noise, 0.8 of a sharp picture.
  double clarity = 0;
};

/// Places where pictures of a stream show a code. Not thread-safe.
class PictureFinder {
 public:
  static constexpr std::size_t kMostPlaces = 8;
  /// Codes are looked for that are at least so high, without their dark margin, and at most a half of the
  /// picture.
  static constexpr int kLeastHeight = 12;

  /// Goes on with places that were found before, of which at most kMostPlaces are used.
  explicit PictureFinder(std::span<const Place> known = {});
  /// Looks over the whole picture for places that are not known yet. The oldest one that was not seen again
  /// makes room.
  void search(const GreyView& picture);
  /// What the known places show.
  [[nodiscard]] std::vector<Sighting> read(const GreyView& picture) const;
  [[nodiscard]] const std::vector<Place>& places() const { return places_; }

 private:
  /// Something that is like a code's frame from afar and is none: a lamp, a window. To find that out costs a
  /// hundred times what it costs to see that it still looks the same.
  struct Refused {
    Place about;
    std::vector<float> cells;
    float frame = 0, margin = 0;
  };
  [[nodiscard]] bool looks_as_refused(const Refused& now) const;

  std::vector<Place> places_;
  std::vector<Refused> refused_;  // in the picture that was searched last
};

}  // namespace kiroku::light

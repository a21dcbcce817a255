// Whether what lies around an organ is where it was in an earlier picture: then the endoscope stood still,
// and what changed its outline since is the organ itself. An object is immutable once made; functions are
// thread-safe.
//
// The grey of the surroundings is compared with that of the earlier picture. An affine motion, a gain and an
// offset of the light are fitted to the difference by least squares, linear about no motion (Lucas and
// Kanade, "An Iterative Image Registration Technique", IJCAI 1981), with Tukey's weights, so that what the
// organ or a tool newly hides counts for nothing.
#pragma once

#include <memory>

#include "sim/align/cover.h"
#include "sim/align/silhouette.h"
#include "sim/render/picture.h"

namespace kiroku::sim {

enum class Stillness {
  kStill,
  kMoved,   // the endoscope moved, or everything else did
  kUnseen,  // too little is seen of the surroundings, or nothing in them tells one place from another
};

struct SurroundingsLook {
  Stillness stillness = Stillness::kUnseen;
  double moved_px = 0;  // root of the mean square over the surroundings, in the picture
  double error_px = 0;  // its standard error
  double alike = 0;     // share of the earlier grey's variance that the motion explains
};

class Surroundings {
 public:
  /// Of a picture with the organ's silhouette in it. What lies close to the organ is left out.
  Surroundings(const Picture& picture, const Cover& cover, const Silhouette& organ);
  ~Surroundings();
  Surroundings(const Surroundings&) = delete;
  Surroundings& operator=(const Surroundings&) = delete;

  /// Of a picture of the same size.
  [[nodiscard]] SurroundingsLook look(const Picture& picture, const Cover& cover) const;

  /// More is a motion.
  static constexpr double kStillPx = 1;

 private:
  struct Kept;
  std::unique_ptr<Kept> kept_;
};

}  // namespace kiroku::sim

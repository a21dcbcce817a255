// Where an organ is in the pictures of an endoscope, found and followed without anybody's help, and where
// that cannot be said. An object belongs to one thread.
//
// The organ is found by its outline (pose_search.h), then followed by its outline (outline_fit.h) and by
// points of its surface (surface_points.h). A picture's place has a standard error; where the organ does not
// show enough, or what it shows is contradictory, the picture is lost, and the reason is told.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>

#include "sim/align/pose_search.h"
#include "sim/mesh/tet_mesh.h"

namespace kiroku::sim {

enum class WhyLost {
  kNotLost,
  kNoOrgan,        // nothing in the picture has the organ's outline
  kAlike,          // two places explain the outline alike
  kMirrored,       // the organ's mirror image explains it nearly as well or better
  kHidden,         // too little of the outline and of the surface is seen to follow it
  kUncertain,      // what is seen leaves a standard error above OrganTrack::kLargestErrorM
  kContradictory,  // outline and surface say different things
  kNotLooked,      // lost before, and not searched for all over this picture: that takes a second
};
/// A word for documents: "no-organ".
const char* name_of(WhyLost why);

struct AlignedMoment {
  std::int64_t time_ns = 0;
  WhyLost why = WhyLost::kNoOrgan;
  Camera camera;                // of a moment that is not lost
  double standard_error_m = 0;  // of the place of a point of the organ before the camera, likewise
  // Pixels of the picture that was given.
  double misfit_px = 0;  // between outline and border; of a search that failed, of the best it found
  double supported = 0;  // share of the outline in the picture along which there is a border
  double rival_px = 0;   // of a search: the misfit of the best other place, 0 for none
  [[nodiscard]] bool held() const { return why == WhyLost::kNotLost; }
};

class OrganTrack {
 public:
  /// `field_deg`: what the picture's lesser side covers; square pixels, no distortion. kiroku::UsageError for
  /// an angle that is none of an endoscope, and as organ_surface().
  OrganTrack(const TetMesh& mesh, double field_deg, const SearchRange& range = {});
  ~OrganTrack();
  OrganTrack(const OrganTrack&) = delete;
  OrganTrack& operator=(const OrganTrack&) = delete;

  /// The next picture, in order of time; some tenths of a second apart at most, so that it can be followed.
  /// A picture takes some hundredths of a second, a search a second or two: who wants to end does so between
  /// two. In a picture of another size than the one before the organ is sought anew.
  AlignedMoment take(std::int64_t time_ns, const Picture& picture);

  /// What take() made of the picture that it took last, for whoever goes on with it. Valid until the next
  /// one.
  struct Taken {
    const Picture& picture;  // scaled down as below
    double scale = 1;        // so many pixels of the given picture are one of it
    const Cover& cover;
    const ColourCells& cells;
    Pinhole pinhole;
    const Expected* place;  // with what it leaves open; nullptr where the organ was not held
  };
  [[nodiscard]] Taken taken() const;

  /// Larger pictures are scaled down to that many pixels of their lesser side.
  static constexpr int kLesserSidePx = 480;
  static constexpr double kLargestErrorM = 0.006;
  static constexpr double kLeastFieldDeg = 10, kGreatestFieldDeg = 120;

 private:
  class Following;
  std::unique_ptr<Following> following_;
};

}  // namespace kiroku::sim

// An organ deformed to fit picture after picture, where that says more than a rigid one does. An object
// belongs to one thread.
//
// It goes on with what an OrganTrack finds. A picture that the rigid organ explains is taken to show it at
// rest: displacements count from there. While what is around the organ stays where it was in that picture,
// the endoscope stands still, and each picture is fitted from there (deformed_fit.h), with the tissue that
// flow followed since. A fit counts where its displacement is beyond its own standard error, and where it
// explains the picture better than the rigid organ. Else the rigid organ stands, and the reason is told.
#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "sim/align/deformed_fit.h"
#include "sim/align/organ_track.h"

namespace kiroku::sim {

enum class WhyRigid {
  kDeformed,     // it is not rigid
  kAtRest,       // displacements are counted from this picture
  kNoRest,       // no picture since the endoscope moved last, or the size changed, showed the organ at rest
  kMoved,        // the endoscope moved since, or all around the organ did
  kUnseen,       // whether it moved cannot be said: too little is seen around the organ
  kUnfitted,     // no deformation explains the picture; DeformedMoment::unfitted says why
  kWithinError,  // the displacement is nowhere beyond its own standard error
  kNotBetter,    // it explains neither outline nor tissue better than the rigid organ
  kNotKept,      // for whoever keeps moments: there was no room
};
/// A word for documents: "endoscope-moved".
const char* name_of(WhyRigid why);

struct DeformedMoment {
  WhyRigid why = WhyRigid::kNoRest;
  WhyUnfitted unfitted = WhyUnfitted::kFitted;  // of kUnfitted
  [[nodiscard]] bool deformed() const { return why == WhyRigid::kDeformed; }

  // All below is of a fit that was not refused; it only counts where deformed().
  std::int64_t rest_ns = 0;             // the picture from which displacements count
  Camera camera;                        // before which the organ then is
  std::vector<Vector3> displacement_m;  // (|S|), of the surface's nodes
  std::vector<float> error_m;           // (|S|), standard error of each displacement
  std::vector<bool> told;               // (|S|), whether that is at most DeformedFit::kLargestErrorM
  double standard_error_m = 0;          // root of the mean square over the told nodes
  double largest_m = 0;                 // displacement of a told node
  double beyond = 0;       // share of the nodes that are seen and told, displaced by over kBeyond errors
  double misfit_px = 0;    // between outline and border, as AlignedMoment has it
  double supported = 0;    // likewise
  std::size_t points = 0;  // of tissue that was followed
  double points_agree = 0,
         rigid_points_agree = 0;  // share of them that the fit explains, and the rigid organ
};

class DeformedTrack {
 public:
  /// `organ` must outlive the object.
  explicit DeformedTrack(const DeformableOrgan& organ);
  ~DeformedTrack();
  DeformedTrack(const DeformedTrack&) = delete;
  DeformedTrack& operator=(const DeformedTrack&) = delete;

  /// The picture that `rigid` took last, and what it said of it.
  DeformedMoment take(const OrganTrack::Taken& taken, const AlignedMoment& rigid);

  /// A displacement of so many standard errors is one.
  static constexpr double kBeyond = 2;
  /// So many of the nodes that are seen must be displaced by that for a deformation to count.
  static constexpr double kLeastBeyond = 0.05;

 private:
  class Following;
  std::unique_ptr<Following> following_;
};

}  // namespace kiroku::sim

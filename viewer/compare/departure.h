// Where the recording departs from the plan: where a picture shows the organ's surface, against where the
// plan has it at that moment. Objects belong to one thread; functions are pure.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "sim/align/deformed_track.h"
#include "sim/align/drawn_surface.h"
#include "sim/plan/plan_frames.h"
#include "viewer/compare/time_map.h"

namespace kiroku::compare {

enum class WhyNoDeparture {
  kCompared,
  kNoShape,   // the picture says nothing of the organ's shape; WhyRigid or WhyLost say why
  kNoMoment,  // the plan has no moment for this picture: no step is done
  kCut,       // the plan has cut the organ by then
  kUntold,    // no place of the organ is known well enough
  kUnsure,    // the picture does not tell the organ at rest from what is planned
};
/// A word for documents: "no-plan-moment".
const char* name_of(WhyNoDeparture why);
/// For people: "no moment of the plan".
std::string sentence_of(WhyNoDeparture why);

/// How the plan has the organ's surface at moments of the recording.
class PlannedShapes {
 public:
  /// What is given must outlive the object. `map`: nothing where no step was found.
  PlannedShapes(const std::optional<TimeMap>& map, const sim::PlanFrames& frames)
      : map_(map), frames_(frames) {}

  struct Shape {
    WhyNoDeparture why = WhyNoDeparture::kNoMoment;  // of the plan: kNoMoment, kCut or kCompared
    PlanMoment moment;                               // but of kNoMoment
    std::vector<sim::Vector3> displacement_m;        // of the surface's nodes, where it is kCompared
  };
  /// Between two of the plan's frames evenly. In a pause the plan stands; between two steps it has no moment.
  [[nodiscard]] Shape at(std::int64_t case_ns, const sim::OrganSurface& surface) const;

 private:
  const std::optional<TimeMap>& map_;
  const sim::PlanFrames& frames_;
};

/// What one picture says of it.
struct Departure {
  WhyNoDeparture why = WhyNoDeparture::kNoShape;
  std::optional<PlanMoment> moment;  // of the plan, where it has one
  // Of kCompared:
  std::vector<float> beyond_m;  // (drawn nodes), how far; 0 within kBeyond standard errors, or not told
  double told = 0, beyond = 0;  // share of the nodes that are told, and of these, of the ones that are beyond
  double standard_error_m = 0;  // root of the mean square over those that are told
  double largest_m = 0, largest_error_m = 0;  // the farthest of those beyond, and the standard error there
  [[nodiscard]] bool compared() const { return why == WhyNoDeparture::kCompared; }
  /// A few nodes are beyond two standard errors by chance.
  [[nodiscard]] bool departed() const { return compared() && beyond >= sim::DeformedTrack::kLeastBeyond; }
};

/// Of a fit that was not refused, and is better than the rigid organ or is rest within its error. Rest within
/// its error may agree with the plan, but tells no departure: a fit leans towards rest where it sees little.
Departure departure_of(const sim::DeformedMoment& moment, const PlannedShapes::Shape& planned,
                       const sim::DrawnSurface& drawn);

/// What the pictures of a step come to.
struct StepDeparture {
  std::size_t step = 0;
  std::size_t pictures = 0, compared = 0, departed = 0;
  double largest_m = 0, largest_error_m = 0;  // of those that departed
  std::int64_t at_ns = 0;                     // the picture of that
};

}  // namespace kiroku::compare

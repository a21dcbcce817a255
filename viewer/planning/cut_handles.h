// Cuts that are drawn on the picture of an organ and changed there by their handles
// (docs/reference/viewer.md, "Planning"). Not thread-safe, but for pure functions.
//
// Source: Figures 4c and 5c of "Interactive Volume Manipulation for Supporting Preoperative Planning", whose
// incisions can be changed on the picture after they were made.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "sim/mesh/mesh_topology.h"
#include "sim/plan/plan_session.h"
#include "sim/render/camera.h"
#include "viewer/planning/planning_deeds.h"

namespace kiroku::viewer {

/// The organ as a picture shows it at one moment.
class SeenOrgan {
 public:
  SeenOrgan(const sim::PlanSession& session, const sim::Camera& camera);
  /// As above, with the surface of the session's mesh, which is known already and outlives this.
  SeenOrgan(const sim::PlanSession& session, const sim::Camera& camera, std::span<const sim::Face> surface);
  SeenOrgan(const SeenOrgan&) = delete;
  SeenOrgan& operator=(const SeenOrgan&) = delete;

  struct Place {
    sim::Vector3 there_m;  // where it is
    sim::Vector3 rest_m;   // where it is in the rest shape
  };
  /// Where the picture's line, x and y as PlanPointer's, first meets the organ; nothing beside it.
  [[nodiscard]] std::optional<Place> at(double x, double y) const;
  /// How far before `there_m` the picture's line meets the organ, m; 0 where it does not.
  [[nodiscard]] double before_m(const sim::Vector3& there_m) const;
  /// A point of a face, by weights of its corners.
  [[nodiscard]] sim::Vector3 there_m(const sim::Face& face, const sim::Vector3& weights) const;

 private:
  const sim::TetMesh& mesh_;
  sim::Camera camera_;
  std::vector<sim::Face> own_surface_;  // where none was given
  std::span<const sim::Face> surface_;
  std::vector<sim::Vector3> places_m_, seen_m_;  // (|V|) as they lie, and in depth
};

/// A handle on the picture: x and y as PlanPointer's.
struct ShownHandle {
  double x = 0, y = 0, depth_m = 0;
  bool hidden = false;  // behind the organ, as it is seen now
};
struct ShownCut {
  std::size_t step = 0;  // of the plan
  bool smooth = true;
  std::vector<ShownHandle> handles;
};
/// All cuts of the plan that were drawn along curves, for one picture after the other: what did not change
/// since the picture before is not computed again. For one session.
class DrawnCuts {
 public:
  /// The mean edge of the surface before any cut, m.
  explicit DrawnCuts(double edge_m) : edge_m_(edge_m) {}
  /// Valid until the next call.
  const std::vector<ShownCut>& shown(const sim::PlanSession& session, const sim::Camera& camera);
  /// The camera is another one.
  void look_anew() { time_s_.reset(); }

 private:
  /// The point of the surface that is nearest to a handle in the rest shape.
  struct OnFace {
    sim::Face face;
    sim::Vector3 weights;
  };
  void find_handles(const sim::PlanSession& session);

  double edge_m_;
  std::optional<std::uint64_t> revision_;  // of which the handles were found
  std::optional<double> time_s_;           // at which they were shown
  std::vector<sim::Face> surface_;
  std::vector<OnFace> handles_;  // of all cuts, one after the other
  std::vector<ShownCut> cuts_;
};

/// A curve through places of the rest shape that are met one after the other; its handles lie evenly along
/// it, on the surface of the organ before any cut, about one and a half edges of its mesh apart. Nothing
/// where the places do not follow one surface: two neighbours lie more than three edges apart, or a handle
/// more than one edge below the surface. kiroku::Error where the places are all in one.
std::optional<sim::CutCurve> curve_through(const std::vector<sim::Vector3>& rest_m, double depth_m,
                                           const sim::TetMesh& mesh);

/// The cut's curve with its handle where the picture shows that place, and as deep as asked for.
/// kiroku::Error, which counts handles from 1 as the page does, where the step has no such handle, and where
/// the place is beside the organ, inside a cut, or at another handle.
sim::CutCurve changed_curve(const sim::PlanSession& session, const sim::Camera& camera,
                            const HandleDeed& deed);

}  // namespace kiroku::viewer

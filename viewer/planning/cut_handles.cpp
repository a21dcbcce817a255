#include "viewer/planning/cut_handles.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <string>
#include <utility>

#include "base/error.h"
#include "base/number_text.h"
#include "sim/cutting/closest_point.h"
#include "sim/mesh/length_unit.h"
#include "sim/render/picking.h"

namespace kiroku::viewer {
namespace {

using sim::Vector3;

/// Of handles along a line, in mean edges of the surface: nearer ones would bend the curve more finely than
/// the mesh can follow.
constexpr double kApartInEdges = 1.5, kLeastLineInEdges = 0.25, kNearestInEdges = 0.25;
constexpr std::size_t kMostDrawnHandles = 9;
/// Places of a line are seen about an edge apart. Farther apart in the organ they lie on both sides of a
/// fold.
constexpr double kFarthestNeighboursInEdges = 3;
/// A handle lies so deep in a cut at most, and so far behind what is seen, in mean edges of the surface.
constexpr double kInsideInEdges = 1, kBehindInEdges = 1;

std::string in_mm(double length_m) { return number_text(length_m * sim::kMmPerM, 2); }
/// As the page counts them.
std::string counted(std::size_t handle) { return std::to_string(handle + 1); }

Vector3 weighted(const sim::Face& face, const Vector3& weights, const std::vector<Vector3>& of_nodes) {
  return weights[0] * of_nodes[face.nodes[0]] + weights[1] * of_nodes[face.nodes[1]] +
         weights[2] * of_nodes[face.nodes[2]];
}

}  // namespace

SeenOrgan::SeenOrgan(const sim::PlanSession& session, const sim::Camera& camera)
    : SeenOrgan(session, camera, {}) {
  own_surface_ = sim::faces_of(mesh_).surface;
  surface_ = own_surface_;
}

SeenOrgan::SeenOrgan(const sim::PlanSession& session, const sim::Camera& camera,
                     std::span<const sim::Face> surface)
    : mesh_(session.mesh()), camera_(camera), surface_(surface) {
  const Eigen::VectorXd& moved_m = session.frame().displacement_m;
  places_m_.reserve(mesh_.nodes.size());
  seen_m_.reserve(mesh_.nodes.size());
  for (std::size_t node = 0; node < mesh_.nodes.size(); ++node) {
    places_m_.emplace_back(mesh_.nodes[node] + moved_m.segment<3>(static_cast<Eigen::Index>(3 * node)));
    seen_m_.push_back(sim::in_depth_m(camera_, places_m_.back()));
  }
}

std::optional<SeenOrgan::Place> SeenOrgan::at(double x, double y) const {
  const auto met = sim::first_met(surface_, seen_m_, sim::slope_of(camera_, x, y));
  if (!met) return {};
  const sim::Face& face = surface_[met->face];
  return Place{weighted(face, met->weights, places_m_), weighted(face, met->weights, mesh_.nodes)};
}

double SeenOrgan::before_m(const Vector3& there_m) const {
  const Vector3 seen_m = sim::in_depth_m(camera_, there_m);
  const auto depth_m = sim::depth_along(surface_, seen_m_, seen_m.head<2>() / seen_m.z());
  return depth_m ? std::max(0.0, seen_m.z() - *depth_m) : 0;
}

Vector3 SeenOrgan::there_m(const sim::Face& face, const Vector3& weights) const {
  return weighted(face, weights, places_m_);
}

void DrawnCuts::find_handles(const sim::PlanSession& session) {
  cuts_.clear();
  handles_.clear();
  const std::vector<sim::PlanStep>& steps = session.plan().steps;
  const std::vector<Vector3>& nodes_m = session.mesh().nodes;
  for (std::size_t step = 0; step < steps.size(); ++step) {
    if (!steps[step].curve) continue;
    const sim::CutCurve& curve = *steps[step].curve;
    if (cuts_.empty()) surface_ = sim::faces_of(session.mesh()).surface;
    ShownCut& cut = cuts_.emplace_back(ShownCut{step, curve.smooth, {}});
    for (std::size_t i = 0; i < curve.handles_m.size(); ++i) {
      OnFace nearest{};
      double least_m2 = std::numeric_limits<double>::infinity();
      for (const sim::Face& face : surface_) {
        const Vector3 weights = sim::closest_weights(
            curve.handles_m[i], {nodes_m[face.nodes[0]], nodes_m[face.nodes[1]], nodes_m[face.nodes[2]]});
        const double distance_m2 = (weighted(face, weights, nodes_m) - curve.handles_m[i]).squaredNorm();
        if (distance_m2 >= least_m2) continue;
        least_m2 = distance_m2;
        nearest = {face, weights};
      }
      handles_.push_back(nearest);
      cut.handles.push_back({0, 0, curve.depth_m[curve.depth_m.size() == 1 ? 0 : i], false});
    }
  }
}

const std::vector<ShownCut>& DrawnCuts::shown(const sim::PlanSession& session, const sim::Camera& camera) {
  const double now_s = session.frame().time_s;
  const bool changed = revision_ != session.revision();
  if (changed) find_handles(session);
  revision_ = session.revision();
  if (cuts_.empty() || (!changed && time_s_ == now_s)) return cuts_;
  time_s_ = now_s;
  const SeenOrgan organ(session, camera, surface_);
  auto on_face = handles_.begin();
  for (ShownCut& cut : cuts_) {
    for (ShownHandle& handle : cut.handles) {
      const Vector3 there_m = organ.there_m(on_face->face, on_face->weights);
      ++on_face;
      const Eigen::Vector2d at = sim::on_picture(camera, there_m);
      handle.x = at.x();
      handle.y = at.y();
      handle.hidden = organ.before_m(there_m) > kBehindInEdges * edge_m_;
    }
  }
  return cuts_;
}

std::optional<sim::CutCurve> curve_through(const std::vector<Vector3>& rest_m, double depth_m,
                                           const sim::TetMesh& mesh) {
  const double edge_m = sim::mean_surface_edge_m(mesh);
  std::vector<double> along_m{0};
  for (std::size_t i = 1; i < rest_m.size(); ++i) {
    const double apart_m = (rest_m[i] - rest_m[i - 1]).norm();
    if (apart_m > kFarthestNeighboursInEdges * edge_m) return {};
    along_m.push_back(along_m.back() + apart_m);
  }
  if (along_m.back() < kLeastLineInEdges * edge_m)
    throw Error("the line is too short to be cut: draw it longer");
  const double wanted = std::round(along_m.back() / (kApartInEdges * edge_m)) + 1;
  const auto count =
      static_cast<std::size_t>(std::clamp(wanted, 2.0, static_cast<double>(kMostDrawnHandles)));
  std::vector<Vector3> handles_m;
  std::size_t place = 0;
  for (std::size_t i = 0; i < count; ++i) {
    const double at_m = along_m.back() * static_cast<double>(i) / static_cast<double>(count - 1);
    while (place + 1 < along_m.size() && along_m[place + 1] <= at_m) ++place;
    if (place + 1 == along_m.size()) {
      handles_m.push_back(rest_m.back());
      continue;
    }
    const double part = (at_m - along_m[place]) / (along_m[place + 1] - along_m[place]);
    handles_m.emplace_back(rest_m[place] + part * (rest_m[place + 1] - rest_m[place]));
  }
  std::vector<Vector3> on_surface_m = sim::on_surface(mesh, handles_m);
  for (std::size_t i = 0; i < count; ++i)
    if ((on_surface_m[i] - handles_m[i]).norm() > kInsideInEdges * edge_m) return {};
  return sim::CutCurve{std::move(on_surface_m), true, {depth_m}, {}};
}

sim::CutCurve changed_curve(const sim::PlanSession& session, const sim::Camera& camera,
                            const HandleDeed& deed) {
  const std::vector<sim::PlanStep>& steps = session.plan().steps;
  if (deed.step >= steps.size() || !steps[deed.step].curve ||
      deed.handle >= steps[deed.step].curve->handles_m.size())
    throw Error("that handle is gone: take one that the picture shows");
  sim::CutCurve curve = *steps[deed.step].curve;
  if (deed.depth_m) {
    if (curve.depth_m.size() == 1) curve.depth_m.resize(curve.handles_m.size(), curve.depth_m.front());
    curve.depth_m[deed.handle] = *deed.depth_m;
  }
  if (!deed.at) return curve;
  const std::string named = counted(deed.handle);
  const auto place = SeenOrgan(session, camera).at(deed.at->x(), deed.at->y());
  if (!place) throw Error("handle " + named + " would leave the organ: drag it to a place on its surface");
  const sim::TetMesh& mesh = session.plan().body.mesh;
  const double edge_m = sim::mean_surface_edge_m(mesh);
  const Vector3 handle_m = sim::on_surface(mesh, {place->rest_m}).front();
  const double inside_m = (handle_m - place->rest_m).norm();
  if (inside_m > kInsideInEdges * edge_m) {
    throw Error("handle " + named + " would lie " + in_mm(inside_m) +
                " mm deep in a cut: drag it to a place on the organ's surface");
  }
  for (std::size_t other = 0; other < curve.handles_m.size(); ++other) {
    const double apart_m = (curve.handles_m[other] - handle_m).norm();
    if (other == deed.handle || apart_m >= kNearestInEdges * edge_m) continue;
    throw Error("handle " + named + " would lie at handle " + counted(other) + ": leave at least " +
                in_mm(kNearestInEdges * edge_m) + " mm between them");
  }
  curve.handles_m[deed.handle] = handle_m;
  return curve;
}

}  // namespace kiroku::viewer

#include "sim/cutting/vertex_preserving_cut.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <memory>
#include <numbers>
#include <string>
#include <utility>

#include <Eigen/Geometry>

#include "base/error.h"
#include "sim/mesh/disjoint_sets.h"
#include "sim/mesh/mesh_check.h"

namespace kiroku::sim {
namespace {

constexpr std::array<std::array<std::size_t, 2>, 6> kEdges{{{0, 1}, {0, 2}, {0, 3}, {1, 2}, {1, 3}, {2, 3}}};
/// A cut whose plane differs by less than 30 degrees goes on with an earlier one.
constexpr double kSameDirection = 0.5 * std::numbers::sqrt3;
constexpr double kBeside = 1e-6;  // of a node's distance: how far its foot may be off the perpendicular
constexpr int kFractions = 8;     // of a move
constexpr int kPasses = 3;        // a move may be possible once its neighbours have been moved
/// A sliding node comes to where S meets the surface by going to either in turn.
constexpr int kMostSlides = 16;

double quality_of(const std::array<Vector3, 4>& corners) {
  double squares = 0;
  for (const auto& [i, j] : kEdges) squares += (corners[i] - corners[j]).squaredNorm();
  const double mean = squares / 6;
  const double six_volumes =
      (corners[1] - corners[0]).cross(corners[2] - corners[0]).dot(corners[3] - corners[0]);
  return std::numbers::sqrt2 * six_volumes / (mean * std::sqrt(mean));
}

TetMesh checked(TetMesh mesh, const Faces& faces) {
  const std::vector<MeshFinding> unsound = check_for_solving(mesh, faces);
  if (!unsound.empty()) throw Error("the mesh is not sound: " + unsound.front().text);
  return mesh;
}

double mean_edge_m(const TetMesh& mesh) {
  double sum_m = 0;
  for (const Tetrahedron& corners : mesh.tetrahedra) {
    for (const auto& [i, j] : kEdges) sum_m += (mesh.nodes[corners[i]] - mesh.nodes[corners[j]]).norm();
  }
  return mesh.tetrahedra.empty() ? 0 : sum_m / static_cast<double>(6 * mesh.tetrahedra.size());
}

void sort_once(std::vector<std::uint32_t>& numbers) {
  std::ranges::sort(numbers);
  numbers.erase(std::unique(numbers.begin(), numbers.end()), numbers.end());
}

}  // namespace

/// What is known of a step while it is worked out.
struct VertexPreservingCut::Step {
  struct Crossed {
    std::array<std::uint32_t, 2> nodes;  // ascending
    int crossing;                        // from the first to the second
  };
  struct End {
    std::uint32_t node;
    int side;                                   // 1 before the sweep, -1 behind it
    std::shared_ptr<const SweepSurface> sweep;  // it is to move to
    Vector3 target_m = Vector3::Zero();
  };

  std::shared_ptr<const SweepSurface> sweep;
  std::vector<Crossed> crossed;      // edges, ascending
  std::vector<std::uint32_t> going;  // tetrahedra, ascending
  std::vector<End> ends;             // of these edges, ascending
  CutStep result;

  [[nodiscard]] const End* end_at(std::uint32_t node) const {
    const auto found = std::ranges::lower_bound(ends, node, {}, &End::node);
    return found != ends.end() && found->node == node ? &*found : nullptr;
  }
  [[nodiscard]] int side_of(std::uint32_t node) const {
    const End* const end = end_at(node);
    return end == nullptr ? 0 : end->side;
  }
  [[nodiscard]] bool is_crossed(std::uint32_t a, std::uint32_t b) const {
    const std::array<std::uint32_t, 2> nodes{std::min(a, b), std::max(a, b)};
    const auto found = std::ranges::lower_bound(crossed, nodes, {}, &Crossed::nodes);
    return found != crossed.end() && found->nodes == nodes;
  }
};

VertexPreservingCut::VertexPreservingCut(TetMesh mesh)
    : VertexPreservingCut(faces_of(mesh), std::move(mesh)) {}

VertexPreservingCut::VertexPreservingCut(const Faces& faces, TetMesh&& mesh)
    : mesh_(checked(std::move(mesh), faces)),
      neighbours_(neighbours_of(mesh_, faces)),
      shape_(mesh_, faces),
      clearance_m_(kClearance * mean_edge_m(mesh_)),
      present_(mesh_.tetrahedra.size(), 1),
      begin_(mesh_.nodes.size() + 1),
      cut_planes_(mesh_.nodes.size()) {
  for (const Tetrahedron& corners : mesh_.tetrahedra) {
    for (const std::uint32_t node : corners) ++begin_[node + 1];
  }
  for (std::size_t node = 1; node < begin_.size(); ++node) begin_[node] += begin_[node - 1];
  around_.resize(begin_.back());
  std::vector<std::size_t> next(begin_.begin(), begin_.end() - 1);
  for (std::uint32_t t = 0; t < mesh_.tetrahedra.size(); ++t) {
    for (const std::uint32_t node : mesh_.tetrahedra[t]) around_[next[node]++] = t;
  }
}

TetMesh VertexPreservingCut::remaining() const {
  TetMesh mesh;
  mesh.nodes = mesh_.nodes;
  for (std::uint32_t t = 0; t < mesh_.tetrahedra.size(); ++t) {
    if (!present(t)) continue;
    mesh.tetrahedra.push_back(mesh_.tetrahedra[t]);
    mesh.regions.push_back(mesh_.regions[t]);
  }
  return mesh;
}

Face VertexPreservingCut::face(std::uint32_t tetrahedron, std::size_t opposite) const {
  Face face{{}, tetrahedron};
  for (std::size_t i = 0; i < 3; ++i)
    face.nodes[i] = mesh_.tetrahedra[tetrahedron][kFaceCorners[opposite][i]];
  return face;
}

std::vector<Face> VertexPreservingCut::surface() const {
  std::vector<Face> faces;
  for (std::uint32_t t = 0; t < mesh_.tetrahedra.size(); ++t) {
    if (!present(t)) continue;
    for (std::size_t corner = 0; corner < 4; ++corner) {
      const std::uint32_t beyond = neighbours_[t][corner];
      if (beyond == t || !present(beyond)) faces.push_back(face(t, corner));
    }
  }
  return faces;
}

Parts VertexPreservingCut::parts() const {
  Parts parts;
  parts.of_tetrahedron.assign(mesh_.tetrahedra.size(), kGone);
  std::vector<std::uint32_t> reached;
  for (std::uint32_t first = 0; first < mesh_.tetrahedra.size(); ++first) {
    if (!present(first) || parts.of_tetrahedron[first] != kGone) continue;
    const auto part = static_cast<std::uint32_t>(parts.count++);
    parts.of_tetrahedron[first] = part;
    reached.assign(1, first);
    while (!reached.empty()) {
      const std::uint32_t t = reached.back();
      reached.pop_back();
      for (const std::uint32_t beyond : neighbours_[t]) {
        if (!present(beyond) || parts.of_tetrahedron[beyond] != kGone) continue;
        parts.of_tetrahedron[beyond] = part;
        reached.push_back(beyond);
      }
    }
  }
  return parts;
}

double VertexPreservingCut::quality(std::uint32_t tetrahedron) const {
  const Tetrahedron& corners = mesh_.tetrahedra[tetrahedron];
  return quality_of(
      {mesh_.nodes[corners[0]], mesh_.nodes[corners[1]], mesh_.nodes[corners[2]], mesh_.nodes[corners[3]]});
}

CutStep VertexPreservingCut::cut(const SweepSurface& sweep) {
  Step step{std::make_shared<const SweepSurface>(sweep), {}, {}, {}, {}};
  if (sweep.from().tip != last_edge_.tip || sweep.from().heel != last_edge_.heel) unfinished_.clear();
  last_edge_ = sweep.to();
  find_crossings(step);
  if (step.going.empty() && unfinished_.empty()) return {};
  take_sides(step);
  for (const std::uint32_t t : step.going) remove(t, step);
  remove_hinges(step);
  find_targets(step);
  remove_pressed(step);
  note_ahead(step);
  move_nodes(step);

  CutStep& result = step.result;
  std::ranges::sort(result.change.removed);
  std::vector<std::uint32_t> nodes;
  for (const std::uint32_t t : result.change.removed) {
    for (std::size_t corner = 0; corner < 4; ++corner) {
      nodes.push_back(mesh_.tetrahedra[t][corner]);
      const std::uint32_t beyond = neighbours_[t][corner];
      if (beyond == t || !present(beyond)) continue;
      const auto back = std::ranges::find(neighbours_[beyond], t) - neighbours_[beyond].begin();
      result.opened.push_back(face(beyond, static_cast<std::size_t>(back)));
    }
  }
  sort_once(nodes);
  result.left_alone = static_cast<std::size_t>(std::ranges::count_if(nodes, [this](std::uint32_t node) {
    return std::ranges::none_of(around(node), [this](std::uint32_t t) { return present(t); });
  }));
  return std::move(step.result);
}

void VertexPreservingCut::find_crossings(Step& step) const {
  const Extent& extent = step.sweep->extent();
  for (std::uint32_t t = 0; t < mesh_.tetrahedra.size(); ++t) {
    if (!present(t)) continue;
    const Tetrahedron& corners = mesh_.tetrahedra[t];
    Vector3 least = mesh_.nodes[corners[0]], greatest = least;
    for (std::size_t i = 1; i < 4; ++i) {
      least = least.cwiseMin(mesh_.nodes[corners[i]]);
      greatest = greatest.cwiseMax(mesh_.nodes[corners[i]]);
    }
    // What touches the box within rounding is looked at too.
    const double slack_m = SweepSurface::kTouch * (greatest - least).sum();
    if ((least.array() > extent.greatest.array() + slack_m).any() ||
        (greatest.array() < extent.least.array() - slack_m).any())
      continue;
    bool goes = false;
    for (const auto& [i, j] : kEdges) {
      const auto [first, second] = std::minmax(corners[i], corners[j]);
      const int crossing = step.sweep->crossing(mesh_.nodes[first], mesh_.nodes[second]);
      if (crossing == 0) continue;
      goes = true;
      step.crossed.push_back({{first, second}, crossing});
    }
    if (goes) step.going.push_back(t);
  }
  std::ranges::sort(step.crossed, {}, &Step::Crossed::nodes);
  step.crossed.erase(std::unique(step.crossed.begin(), step.crossed.end(),
                                 [](const auto& a, const auto& b) { return a.nodes == b.nodes; }),
                     step.crossed.end());
}

void VertexPreservingCut::take_sides(Step& step) const {
  std::vector<std::uint32_t> nodes;
  for (const Step::Crossed& edge : step.crossed) {
    for (const std::uint32_t node : edge.nodes) nodes.push_back(node);
  }
  sort_once(nodes);
  for (const std::uint32_t node : nodes) step.ends.push_back({node, 0, step.sweep});
  // Where the two triangles of a sweep make a fold, its edges may differ about a node: most of them decide.
  const auto end_at = [&](std::uint32_t node) -> Step::End& {
    return *std::ranges::lower_bound(step.ends, node, {}, &Step::End::node);
  };
  for (const Step::Crossed& edge : step.crossed) {
    end_at(edge.nodes[0]).side += edge.crossing;
    end_at(edge.nodes[1]).side -= edge.crossing;
  }
  for (Step::End& end : step.ends) end.side = end.side >= 0 ? 1 : -1;

  std::vector<std::uint8_t> going(mesh_.tetrahedra.size());
  for (const std::uint32_t t : step.going) going[t] = 1;
  // Whether a tetrahedron can stay once the node at this end has gone over: no other edge of it is parted and
  // no other node is on the side the node has left.
  const auto can_stay = [&](std::uint32_t t, const Step::End& end) {
    const Tetrahedron& corners = mesh_.tetrahedra[t];
    return std::ranges::none_of(
               corners,
               [&](std::uint32_t node) { return node != end.node && step.side_of(node) == end.side; }) &&
           std::ranges::none_of(kEdges, [&](const auto& edge) {
             const std::uint32_t a = corners[edge[0]], b = corners[edge[1]];
             return a != end.node && b != end.node && step.is_crossed(a, b);
           });
  };
  // One node that goes over may make it possible for another; each goes over once.
  std::vector<bool> went_over(step.ends.size());
  for (bool again = true; again;) {
    again = false;
    for (std::size_t i = 0; i < step.ends.size(); ++i) {
      Step::End& end = step.ends[i];
      const auto own = around(end.node);
      if (went_over[i] || std::ranges::any_of(own, [&](std::uint32_t t) { return present(t) && !going[t]; }))
        continue;
      bool kept = false;
      for (const std::uint32_t t : own) {
        if (!present(t) || !can_stay(t, end)) continue;
        going[t] = 0;
        kept = true;
      }
      if (!kept) continue;
      end.side = -end.side;
      std::erase_if(step.crossed, [&](const Step::Crossed& edge) {
        return (edge.nodes[0] == end.node && step.side_of(edge.nodes[1]) == end.side) ||
               (edge.nodes[1] == end.node && step.side_of(edge.nodes[0]) == end.side);
      });
      went_over[i] = again = true;
    }
  }
  std::erase_if(step.going, [&](std::uint32_t t) { return going[t] == 0; });
}

/// Which nodes move where: the ends of this step's edges, and those that an earlier step of the path could
/// not bring to its sweep, where the blade has come nearer to them since or a tetrahedron around them has
/// gone.
void VertexPreservingCut::find_targets(Step& step) {
  std::vector<std::uint32_t> loosened;
  for (const std::uint32_t t : step.result.change.removed)
    loosened.insert(loosened.end(), mesh_.tetrahedra[t].begin(), mesh_.tetrahedra[t].end());
  sort_once(loosened);
  for (auto& [node, earlier] : unfinished_) {
    const Vector3& at_m = mesh_.nodes[node];
    const SweepSurface::Nearest here = step.sweep->nearest(at_m);
    const Vector3 arm = at_m - here.point;
    const bool nearer = arm.norm() <= (earlier.sweep->nearest(at_m).point - at_m).norm();
    // What is ahead of the blade waits until its foot is on the sweep, lest it is dragged along.
    if (earlier.ahead && (!nearer || arm.cross(here.normal).norm() > kBeside * arm.norm())) continue;
    if (nearer) earlier.sweep = step.sweep;
    if (!nearer && !std::ranges::binary_search(loosened, node)) continue;
    const auto found = std::ranges::lower_bound(step.ends, node, {}, &Step::End::node);
    if (found == step.ends.end() || found->node != node) {
      step.ends.insert(found, {node, earlier.side, earlier.sweep});
    } else {
      found->sweep = earlier.sweep;
    }
  }
  for (Step::End& end : step.ends) end.target_m = target(end.node, end.side, *end.sweep);
}

/// Nodes of tetrahedra that went before the blade came to all of their edges.
void VertexPreservingCut::note_ahead(const Step& step) {
  for (const std::uint32_t t : step.going) {
    const Tetrahedron& corners = mesh_.tetrahedra[t];
    std::array<int, 4> sides{};
    for (std::size_t i = 0; i < 4; ++i) {
      const SweepSurface::Nearest nearest = step.sweep->nearest(mesh_.nodes[corners[i]]);
      sides[i] = nearest.normal.dot(mesh_.nodes[corners[i]] - nearest.point) >= 0 ? 1 : -1;
    }
    if (std::ranges::count(sides, sides[0]) == 4) continue;
    for (std::size_t i = 0; i < 4; ++i) {
      if (step.end_at(corners[i]) == nullptr)
        unfinished_.try_emplace(corners[i], Unfinished{step.sweep, sides[i], true});
    }
  }
}

Vector3 VertexPreservingCut::target(std::uint32_t node, int side, const SweepSurface& sweep) const {
  Vector3 at_m = mesh_.nodes[node];
  const bool slides = shape_.kind(node) != NodeKind::kInner || !cut_planes_[node].empty();
  for (int slide = 0; slide < (slides ? kMostSlides : 1); ++slide) {
    const SweepSurface::Nearest nearest = sweep.nearest(at_m);
    Vector3 next_m = nearest.point + side * clearance_m_ * nearest.normal;
    for (const Plane& plane : cut_planes_[node]) {
      if (std::abs(plane.normal.dot(nearest.normal)) < kSameDirection)
        next_m -= plane.normal.dot(next_m - plane.point) * plane.normal;
    }
    next_m = shape_.nearest(node, next_m);
    const double moved_m = (next_m - at_m).norm();
    at_m = next_m;
    if (moved_m < kClearance * clearance_m_) break;
  }
  return at_m;
}

void VertexPreservingCut::remove(std::uint32_t tetrahedron, Step& step) {
  present_[tetrahedron] = 0;
  step.result.change.removed.push_back(tetrahedron);
  step.result.volume_lost_m3 += signed_volume_m3(mesh_, tetrahedron);
}

/// The groups that hang together by faces around them of the tetrahedra around a node or (two nodes) an edge.
std::vector<std::vector<std::uint32_t>> VertexPreservingCut::groups_of(std::uint32_t one,
                                                                       std::uint32_t other) const {
  std::vector<std::uint32_t> members;
  for (const std::uint32_t t : around(one)) {
    if (present(t) && std::ranges::find(mesh_.tetrahedra[t], other) != mesh_.tetrahedra[t].end())
      members.push_back(t);
  }
  DisjointSets sets(members.size());
  for (std::uint32_t i = 0; i < members.size(); ++i) {
    for (std::size_t corner = 0; corner < 4; ++corner) {
      const std::uint32_t apex = mesh_.tetrahedra[members[i]][corner];
      if (apex == one || apex == other) continue;  // the face opposite does not touch the node
      const auto beyond = std::ranges::lower_bound(members, neighbours_[members[i]][corner]);
      if (beyond == members.end() || *beyond != neighbours_[members[i]][corner]) continue;
      sets.join(i, static_cast<std::uint32_t>(beyond - members.begin()));
    }
  }
  std::vector<std::vector<std::uint32_t>> groups;
  std::vector<std::size_t> group_of(members.size());
  for (std::uint32_t i = 0; i < members.size(); ++i) {
    const std::uint32_t first = sets.find(i);
    if (first == i) {
      group_of[i] = groups.size();
      groups.emplace_back();
    }
    groups[group_of[first]].push_back(members[i]);
  }
  return groups;
}

/// Where tetrahedra are left around a node or an edge in several groups, only the largest stays.
void VertexPreservingCut::remove_hinge(std::uint32_t one, std::uint32_t other, Step& step) {
  const std::vector<std::vector<std::uint32_t>> groups = groups_of(one, other);
  if (groups.size() < 2) return;
  const auto largest = std::ranges::max_element(groups, {}, &std::vector<std::uint32_t>::size);
  for (auto group = groups.begin(); group != groups.end(); ++group) {
    if (group == largest) continue;
    for (const std::uint32_t t : *group) remove(t, step);
  }
}

void VertexPreservingCut::remove_hinges(Step& step) {
  // What goes may make another hinge: the list of what has gone grows as it is walked.
  std::vector<std::uint32_t>& removed = step.result.change.removed;
  for (std::size_t i = 0; i < removed.size(); ++i) {
    const Tetrahedron& corners = mesh_.tetrahedra[removed[i]];
    for (const std::uint32_t node : corners) remove_hinge(node, node, step);
    for (const auto& [a, b] : kEdges) remove_hinge(corners[a], corners[b], step);
  }
}

void VertexPreservingCut::remove_pressed(Step& step) {
  std::vector<std::uint32_t> candidates;
  for (const Step::End& end : step.ends) {
    for (const std::uint32_t t : around(end.node)) {
      if (present(t)) candidates.push_back(t);
    }
  }
  sort_once(candidates);
  for (const std::uint32_t t : candidates) {
    const Tetrahedron& corners = mesh_.tetrahedra[t];
    std::array<Vector3, 4> targets_m;
    bool on_sweep = true;
    for (std::size_t i = 0; i < 4 && on_sweep; ++i) {
      const Step::End* const end = step.end_at(corners[i]);
      targets_m[i] = end != nullptr ? end->target_m : mesh_.nodes[corners[i]];
      const SweepSurface::Nearest nearest = step.sweep->nearest(targets_m[i]);
      on_sweep = std::abs(nearest.normal.dot(targets_m[i] - nearest.point)) <= 2 * clearance_m_;
    }
    if (!on_sweep || quality_of(targets_m) >= kLeastQuality) continue;
    present_[t] = 0;
    const bool leaves_all_whole =
        std::ranges::all_of(corners, [&](std::uint32_t node) { return groups_of(node, node).size() == 1; }) &&
        std::ranges::all_of(kEdges, [&](const auto& edge) {
          return groups_of(corners[edge[0]], corners[edge[1]]).size() <= 1;
        });
    present_[t] = 1;
    if (leaves_all_whole) remove(t, step);
  }
}

/// How many tetrahedra around a node have an edge there that goes through the sweep.
std::size_t VertexPreservingCut::crossing_around(std::uint32_t node, const SweepSurface& sweep) const {
  const auto own = around(node);
  return static_cast<std::size_t>(std::ranges::count_if(own, [&](std::uint32_t t) {
    return present(t) && std::ranges::any_of(mesh_.tetrahedra[t], [&](std::uint32_t other) {
             return other != node && sweep.crossing(mesh_.nodes[node], mesh_.nodes[other]) != 0;
           });
  }));
}

void VertexPreservingCut::move_nodes(Step& step) {
  std::vector<std::uint32_t> reshaped;
  std::vector<Vector3> before_m;
  for (const Step::End& end : step.ends) {
    before_m.push_back(mesh_.nodes[end.node]);
    for (const std::uint32_t t : around(end.node)) {
      if (present(t)) reshaped.push_back(t);
    }
  }
  sort_once(reshaped);
  for (const std::uint32_t t : reshaped) step.result.volume_lost_m3 += signed_volume_m3(mesh_, t);

  const double near_m = kClearance * clearance_m_;
  std::vector<double> least_quality;
  for (int pass = 0; pass < kPasses; ++pass) {
    for (const Step::End& end : step.ends) {
      Vector3& at_m = mesh_.nodes[end.node];
      const Vector3 from_m = at_m;
      if ((end.target_m - from_m).norm() <= near_m) continue;
      least_quality.clear();
      for (const std::uint32_t t : around(end.node))
        least_quality.push_back(present(t) ? std::min(quality(t), kLeastQuality) : 0);
      const std::size_t crossing_before = crossing_around(end.node, *end.sweep);
      const auto spoils = [&] {
        const auto own = around(end.node);
        for (std::size_t i = 0; i < own.size(); ++i) {
          if (present(own[i]) && !(quality(own[i]) >= least_quality[i])) return true;
        }
        return crossing_around(end.node, *end.sweep) > crossing_before;
      };
      int eighths = kFractions;
      do {
        at_m = from_m + (end.target_m - from_m) * eighths / kFractions;
        if (eighths < kFractions) at_m = shape_.nearest(end.node, at_m);
      } while (spoils() && --eighths > 0);
      if (eighths == 0) at_m = from_m;
    }
  }
  for (std::size_t i = 0; i < step.ends.size(); ++i) {
    const Step::End& end = step.ends[i];
    const Vector3& at_m = mesh_.nodes[end.node];
    if ((at_m - end.target_m).norm() > near_m) {
      ++step.result.shortened;
      unfinished_.insert_or_assign(end.node, Unfinished{end.sweep, end.side, false});
    } else {
      unfinished_.erase(end.node);
    }
    const SweepSurface::Nearest nearest = end.sweep->nearest(at_m);
    if ((at_m - nearest.point).norm() <= 2 * clearance_m_) {
      // One plane a direction: that of the latest cut.
      std::vector<Plane>& planes = cut_planes_[end.node];
      std::erase_if(planes, [&](const Plane& plane) {
        return std::abs(plane.normal.dot(nearest.normal)) >= kSameDirection;
      });
      planes.push_back({at_m, nearest.normal});
    }
    if (at_m == before_m[i]) continue;
    step.result.change.moved.push_back(end.node);
    step.result.change.positions_m.push_back(at_m);
  }
  for (const std::uint32_t t : reshaped) step.result.volume_lost_m3 -= signed_volume_m3(mesh_, t);
}

}  // namespace kiroku::sim

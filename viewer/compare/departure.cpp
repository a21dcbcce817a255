#include "viewer/compare/departure.h"

#include <algorithm>
#include <cmath>

namespace kiroku::compare {

const char* name_of(WhyNoDeparture why) {
  switch (why) {
    case WhyNoDeparture::kCompared:
      return "compared";
    case WhyNoDeparture::kNoShape:
      return "no-shape";
    case WhyNoDeparture::kNoMoment:
      return "no-plan-moment";
    case WhyNoDeparture::kCut:
      return "plan-cut";
    case WhyNoDeparture::kUntold:
      return "untold";
    case WhyNoDeparture::kUnsure:
      return "unsure";
  }
  return "no-shape";
}

std::string sentence_of(WhyNoDeparture why) {
  switch (why) {
    case WhyNoDeparture::kCompared:
      return "it was compared";
    case WhyNoDeparture::kNoShape:
      return "the picture says nothing of the organ's shape";
    case WhyNoDeparture::kNoMoment:
      return "no moment of the plan";
    case WhyNoDeparture::kCut:
      return "the plan has cut the organ by then";
    case WhyNoDeparture::kUntold:
      return "no place of the organ is known to 6 mm";
    case WhyNoDeparture::kUnsure:
      return "whether the organ rests or does what is planned cannot be told";
  }
  return "nothing is known";
}

PlannedShapes::Shape PlannedShapes::at(std::int64_t case_ns, const sim::OrganSurface& surface) const {
  Shape shape;
  const std::optional<PlanMoment> moment = map_ ? map_->during(case_ns) : std::nullopt;
  if (!moment) return shape;
  shape.moment = *moment;
  const auto& all = frames_.all();
  const sim::PlanFrames::Kept& before = frames_.at(moment->step, moment->plan_s);
  const auto number = static_cast<std::size_t>(&before - all.data());
  const sim::PlanFrames::Kept* after = &before;
  double share = 0;
  if (number + 1 < all.size() && all[number + 1].frame.step == moment->step &&
      all[number + 1].frame.time_s > before.frame.time_s) {
    after = &all[number + 1];
    share = std::clamp((moment->plan_s - before.frame.time_s) / (after->frame.time_s - before.frame.time_s),
                       0.0, 1.0);
  }
  // A cut makes other nodes and other tetrahedra: what was one place may be two then.
  if (before.mesh != all.front().mesh || after->mesh != all.front().mesh) {
    shape.why = WhyNoDeparture::kCut;
    return shape;
  }
  shape.why = WhyNoDeparture::kCompared;
  shape.displacement_m.reserve(surface.mesh_nodes.size());
  for (const std::uint32_t node : surface.mesh_nodes) {
    const auto at = 3 * Eigen::Index{node};
    const sim::Vector3 from = before.frame.displacement_m.segment<3>(at),
                       to = after->frame.displacement_m.segment<3>(at);
    shape.displacement_m.emplace_back(from + share * (to - from));
  }
  return shape;
}

Departure departure_of(const sim::DeformedMoment& moment, const PlannedShapes::Shape& planned,
                       const sim::DrawnSurface& drawn) {
  Departure departure;
  if (planned.why != WhyNoDeparture::kNoMoment) departure.moment = planned.moment;
  // What explains the picture no better than the rigid organ is no measurement.
  if (moment.why != sim::WhyRigid::kDeformed && moment.why != sim::WhyRigid::kWithinError) return departure;
  if (planned.why != WhyNoDeparture::kCompared) {
    departure.why = planned.why;
    return departure;
  }
  // A node that stands for several departs as they do on average, and is told as well as the worst of them.
  const std::size_t nodes = drawn.nodes.size();
  std::vector<sim::Vector3> way_m(nodes, sim::Vector3::Zero());
  std::vector<double> members(nodes, 0), error_m(nodes, 0);
  std::vector<bool> told(nodes, true);
  for (std::size_t node = 0; node < drawn.of_node.size(); ++node) {
    const std::uint32_t into = drawn.of_node[node];
    way_m[into] += moment.displacement_m[node] - planned.displacement_m[node];
    members[into] += 1;
    error_m[into] = std::max(error_m[into], double(moment.error_m[node]));
    if (!moment.told[node]) told[into] = false;
  }
  departure.beyond_m.assign(nodes, 0);
  double count = 0, beyond = 0, square = 0;
  for (std::size_t node = 0; node < nodes; ++node) {
    if (!told[node] || members[node] == 0) continue;
    count += 1;
    square += error_m[node] * error_m[node];
    const double far_m = way_m[node].norm() / members[node];
    if (far_m <= sim::DeformedTrack::kBeyond * error_m[node]) continue;
    beyond += 1;
    departure.beyond_m[node] = static_cast<float>(far_m);
    if (far_m <= departure.largest_m) continue;
    departure.largest_m = far_m;
    departure.largest_error_m = error_m[node];
  }
  if (count == 0) {
    departure.beyond_m.clear();
    departure.why = WhyNoDeparture::kUntold;
    return departure;
  }
  departure.why = WhyNoDeparture::kCompared;
  departure.told = count / double(nodes);
  departure.beyond = beyond / count;
  departure.standard_error_m = std::sqrt(square / count);
  if (moment.why != sim::WhyRigid::kWithinError) return departure;
  departure.beyond_m.assign(departure.departed() ? 0 : nodes, 0);
  departure.largest_m = departure.largest_error_m = 0;
  if (departure.departed()) departure.why = WhyNoDeparture::kUnsure;
  return departure;
}

}  // namespace kiroku::compare

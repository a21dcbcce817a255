#include "viewer/compare/time_map.h"

#include <algorithm>
#include <cmath>

#include "base/error.h"

namespace kiroku::compare {
namespace {

/// Both clocks run evenly but for the pauses, in which the plan stands.
std::vector<Knot> even_knots(const PlannedStep& step, const StepMatch& match) {
  std::int64_t active_ns = match.span.end_ns - match.span.start_ns;
  for (const archive::Span& pause : match.pauses) active_ns -= pause.end_ns - pause.start_ns;
  std::vector<Knot> knots{{step.start_s, match.span.start_ns}};
  std::int64_t done_ns = 0, from_ns = match.span.start_ns;
  for (const archive::Span& pause : match.pauses) {
    if (pause.end_ns == pause.start_ns) continue;
    done_ns += pause.start_ns - from_ns;
    const double share = active_ns > 0 ? double(done_ns) / double(active_ns) : 0;
    const double plan_s = step.start_s + share * step.duration_s;
    if (pause.start_ns > knots.back().case_ns) knots.push_back({plan_s, pause.start_ns});
    knots.push_back({plan_s, pause.end_ns});
    from_ns = pause.end_ns;
  }
  if (match.span.end_ns > knots.back().case_ns) {
    knots.push_back({step.end_s(), match.span.end_ns});
  } else {
    knots.back().plan_s = step.end_s();
  }
  return knots;
}

std::string at(const Knot& point) {
  constexpr double kNsPerSecond = 1e9;
  return "the point at " + std::to_string(double(point.case_ns) / kNsPerSecond) + " s of the case (" +
         std::to_string(point.plan_s) + " s of the plan)";
}

}  // namespace

TimeMap::TimeMap(std::span<const PlannedStep> steps, const StepMatching& matching,
                 std::span<const Knot> points) {
  std::vector<Knot> left(points.begin(), points.end());
  std::ranges::stable_sort(left, {}, &Knot::case_ns);
  for (const StepMatch& match : matching.matches) {
    const PlannedStep& step = steps[match.step];
    std::vector<Knot> inside;
    std::erase_if(left, [&](const Knot& point) {
      const bool here = point.case_ns > match.span.start_ns && point.case_ns < match.span.end_ns &&
                        point.plan_s >= step.start_s && point.plan_s <= step.end_s();
      if (here) inside.push_back(point);
      return here;
    });
    if (match.span.end_ns <= match.span.start_ns) continue;
    if (!inside.empty() && !match.pauses.empty()) {
      throw UsageError(at(inside.front()) +
                       " lies in a step with pauses: give points at the beginning and end of each pause "
                       "instead of the pauses");
    }
    MapPiece& piece = pieces_.emplace_back(MapPiece{match.step, even_knots(step, match)});
    piece.knots.insert(piece.knots.begin() + 1, inside.begin(), inside.end());
    if (inside.empty()) continue;
    for (std::size_t i = 1; i < piece.knots.size(); ++i) {
      if (piece.knots[i].plan_s < piece.knots[i - 1].plan_s ||
          piece.knots[i].case_ns <= piece.knots[i - 1].case_ns)
        throw UsageError(at(piece.knots[i]) + " is not after the one before it on both clocks");
    }
  }
  if (!left.empty())
    throw UsageError(at(left.front()) + " lies in no step on both clocks; match the steps first");
  if (pieces_.empty()) {
    throw Error(
        "no step of the plan was found in the recording: mark steps by their names while recording, or match "
        "them by hand");
  }
  monotone_ = std::ranges::is_sorted(pieces_, {}, &MapPiece::step);
}

PlanMoment TimeMap::plan_at(std::int64_t case_ns) const {
  const auto after = std::ranges::upper_bound(
      pieces_, case_ns, {}, [](const MapPiece& piece) { return piece.knots.front().case_ns; });
  if (after == pieces_.begin()) return {pieces_.front().step, pieces_.front().knots.front().plan_s, true};
  const MapPiece& piece = *std::prev(after);
  if (case_ns >= piece.knots.back().case_ns) return {piece.step, piece.knots.back().plan_s, true};
  const auto next = std::ranges::upper_bound(piece.knots, case_ns, {}, &Knot::case_ns);
  const Knot &a = *std::prev(next), &b = *next;
  const double share = double(case_ns - a.case_ns) / double(b.case_ns - a.case_ns);
  // A step without duration in the plan is done while the plan stands.
  const bool interrupted = a.plan_s == b.plan_s && piece.knots.size() > 2;
  return {piece.step, a.plan_s + share * (b.plan_s - a.plan_s), interrupted};
}

std::optional<PlanMoment> TimeMap::during(std::int64_t case_ns) const {
  const bool any = std::ranges::any_of(pieces_, [&](const MapPiece& piece) {
    return case_ns >= piece.knots.front().case_ns && case_ns < piece.knots.back().case_ns;
  });
  return any ? std::optional(plan_at(case_ns)) : std::nullopt;
}

std::optional<std::int64_t> TimeMap::case_at(std::size_t step, double plan_s) const {
  const auto piece = std::ranges::find(pieces_, step, &MapPiece::step);
  if (piece == pieces_.end()) return {};
  const std::vector<Knot>& knots = piece->knots;
  if (plan_s < knots.front().plan_s || plan_s > knots.back().plan_s) return {};
  const auto next = std::ranges::lower_bound(knots, plan_s, {}, &Knot::plan_s);
  if (next == knots.begin()) return knots.front().case_ns;
  const Knot &a = *std::prev(next), &b = *next;
  const double share = (plan_s - a.plan_s) / (b.plan_s - a.plan_s);
  return a.case_ns + std::llround(share * double(b.case_ns - a.case_ns));
}

}  // namespace kiroku::compare

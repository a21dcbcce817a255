#include "viewer/compare/organ_alignment.h"

#include <algorithm>
#include <map>

#include <Eigen/Geometry>

#include "base/error.h"
#include "sim/align/lens_pictures.h"
#include "viewer/playback/picture_span.h"

namespace kiroku::compare {

std::size_t Alignment::held() const {
  return static_cast<std::size_t>(std::ranges::count_if(moments, &sim::AlignedMoment::held));
}

namespace {

void move_evenly(sim::Camera& from, const sim::Camera& to, double share) {
  from.eye_m += share * (to.eye_m - from.eye_m);
  from.to_view = Eigen::Quaterniond(from.to_view)
                     .slerp(share, Eigen::Quaterniond(to.to_view))
                     .normalized()
                     .toRotationMatrix();
}

}  // namespace

std::optional<sim::AlignedMoment> Alignment::at(std::int64_t case_ns) const {
  const auto after = std::ranges::upper_bound(moments, case_ns, {}, &sim::AlignedMoment::time_ns);
  if (after == moments.begin()) return std::nullopt;
  const sim::AlignedMoment& before = *std::prev(after);
  if (before.time_ns == case_ns) return before;
  if (after == moments.end() || after->time_ns - before.time_ns > kAlignedMostNs ||
      after->camera.half_extent != before.camera.half_extent)
    return std::nullopt;
  if (!before.held()) return before;
  if (!after->held()) return *after;
  const double share = double(case_ns - before.time_ns) / double(after->time_ns - before.time_ns);
  sim::AlignedMoment between = before;
  between.time_ns = case_ns;
  move_evenly(between.camera, after->camera, share);
  between.standard_error_m = std::max(before.standard_error_m, after->standard_error_m);
  return between;
}

std::optional<ShownDeformation> Alignment::deformed_at(std::int64_t case_ns) const {
  if (!deformed) return {};
  const auto next = std::ranges::upper_bound(moments, case_ns, {}, &sim::AlignedMoment::time_ns);
  if (next == moments.begin()) return {};
  const auto number = static_cast<std::size_t>(next - moments.begin()) - 1;
  const Deformation& before = deformed->moments[number];
  if (!before.deformed()) return {};
  const std::int64_t before_ns = moments[number].time_ns;
  if (before_ns == case_ns) return deformed->shown(before);
  if (next == moments.end() || next->time_ns - before_ns > kAlignedMostNs) return {};
  const Deformation& after = deformed->moments[number + 1];
  if (!after.deformed() || after.rest_ns != before.rest_ns) return {};
  const double share = double(case_ns - before_ns) / double(next->time_ns - before_ns);
  ShownDeformation between = deformed->shown(before);
  const ShownDeformation to = deformed->shown(after);
  move_evenly(between.camera, to.camera, share);
  for (std::size_t i = 0; i < between.displacement_m.size(); ++i) {
    between.displacement_m[i] += share * (to.displacement_m[i] - between.displacement_m[i]);
    between.told[i] = between.told[i] && to.told[i];
  }
  between.standard_error_m = std::max(between.standard_error_m, to.standard_error_m);
  between.largest_m = std::max(between.largest_m, to.largest_m);
  return between;
}

std::optional<sim::WhyRigid> Alignment::rigid_at(std::int64_t case_ns) const {
  if (!deformed || !at(case_ns) || deformed_at(case_ns)) return {};
  const auto next = std::ranges::upper_bound(moments, case_ns, {}, &sim::AlignedMoment::time_ns);
  const auto number = static_cast<std::size_t>(next - moments.begin()) - 1;
  const Deformation& before = deformed->moments[number];
  if (!before.deformed() || next == moments.end()) return before.why;
  const Deformation& after = deformed->moments[number + 1];
  return after.deformed() ? sim::WhyRigid::kNoRest : after.why;
}

const Departure* Alignment::departure_at(std::int64_t case_ns) const {
  if (!deformed || deformed->departures.empty()) return nullptr;
  const auto next = std::ranges::upper_bound(moments, case_ns, {}, &sim::AlignedMoment::time_ns);
  if (next == moments.begin() || case_ns - std::prev(next)->time_ns > kAlignedMostNs) return nullptr;
  const auto number = static_cast<std::size_t>(next - moments.begin()) - 1;
  const std::optional<sim::AlignedMoment> place = at(case_ns);
  const bool is_at_rest =
      place && place->held() && deformed->moments[number].deformed() && !deformed_at(case_ns);
  if (!is_at_rest) return &deformed->departures[number];
  // Between two deformed shapes that nothing connects nobody looked at any.
  return deformed->moments[number + 1].deformed() ? nullptr : &deformed->departures[number + 1];
}

std::optional<ShownDeformation> Alignment::shape_at(std::int64_t case_ns) const {
  if (auto shown = deformed_at(case_ns)) return shown;
  const std::optional<sim::AlignedMoment> place = at(case_ns);
  if (!place || !place->held()) return {};
  const std::size_t nodes = surface.nodes.size();
  return ShownDeformation{place->camera, std::vector<sim::Vector3>(nodes, sim::Vector3::Zero()),
                          std::vector<bool>(nodes, true), place->standard_error_m, 0};
}

std::vector<StepDeparture> Alignment::step_departures() const {
  std::map<std::size_t, StepDeparture> steps;
  for (std::size_t i = 0; deformed && i < deformed->departures.size(); ++i) {
    const Departure& one = deformed->departures[i];
    if (!one.moment) continue;
    StepDeparture& step = steps[one.moment->step];
    step.step = one.moment->step;
    ++step.pictures;
    if (one.compared()) ++step.compared;
    if (!one.departed()) continue;
    ++step.departed;
    if (one.largest_m <= step.largest_m) continue;
    step.largest_m = one.largest_m;
    step.largest_error_m = one.largest_error_m;
    step.at_ns = moments[i].time_ns;
  }
  std::vector<StepDeparture> all;
  for (const auto& [number, step] : steps) all.push_back(step);
  return all;
}

std::vector<Alignment::Lost> Alignment::lost() const {
  std::vector<Lost> all;
  const sim::AlignedMoment* before = nullptr;
  for (const sim::AlignedMoment& moment : moments) {
    if (before != nullptr && !before->held()) all.back().span.end_ns = moment.time_ns;
    if (!moment.held() && (before == nullptr || before->why != moment.why))
      all.push_back({{moment.time_ns, moment.time_ns}, moment.why});
    before = &moment;
  }
  if (before != nullptr && !before->held()) all.back().span.end_ns = std::max(span.end_ns, before->time_ns);
  return all;
}

std::string sentence_of(sim::WhyLost why) {
  switch (why) {
    case sim::WhyLost::kNotLost:
      return "it was found";
    case sim::WhyLost::kNoOrgan:
      return "nothing in the picture has the organ's outline";
    case sim::WhyLost::kAlike:
      return "two places of the organ explain its outline alike";
    case sim::WhyLost::kMirrored:
      return "the organ's mirror image explains the outline nearly as well or better";
    case sim::WhyLost::kHidden:
      return "too little of the organ is seen";
    case sim::WhyLost::kUncertain:
      return "what is seen leaves its place open by more than 6 mm";
    case sim::WhyLost::kContradictory:
      return "its outline and its texture say different things";
    case sim::WhyLost::kNotLooked:
      return "it was lost before, and this picture was not searched all over";
  }
  return "nothing is known";
}

void require_alignable(const archive::Span& span, bool deformed) {
  if (deformed && span.end_ns - span.start_ns > kLongestDeformedNs) {
    throw UsageError(
        "the organ is deformed to fit ten minutes of a recording at most: say which with --from and --to");
  }
  if (span.end_ns - span.start_ns > kLongestAlignedNs) {
    throw UsageError(
        "the plan is aligned with an hour of a recording at most: say which with --from and --to");
  }
}

Alignment align_organ(const archive::CaseReader& recording, const crypto::AgeIdentities& identities,
                      const std::string& stream, const sim::BodyModel& body, const AlignmentRequest& request,
                      const std::function<void(double share)>& share) {
  require_alignable(request.span, request.deformed);
  const sim::TetMesh& mesh = body.mesh;
  const double field_deg = request.lens ? request.lens->lens.field_deg() : request.field_deg;
  std::optional<sim::StraightPictures> straight;
  if (request.lens) straight.emplace(request.lens->lens);
  std::optional<sim::DeformableOrgan> organ;
  std::optional<sim::DeformedTrack> deformed;
  if (request.deformed) {
    organ.emplace(sim::ElasticBody(mesh, body.materials, body.constraints));
    deformed.emplace(*organ);
  }
  sim::OrganTrack track(mesh, field_deg, request.range);
  playback::PictureSpan frames(recording, identities, stream, request.span.start_ns, request.span.end_ns);
  Alignment alignment{request.span, field_deg, {}, {}, {}, {}, request.lens};
  alignment.surface =
      sim::drawn_surface(sim::organ_surface(mesh), deformed ? kMostDeformedNodes : kMostDrawnNodes);
  if (deformed) alignment.deformed.emplace(alignment.surface.nodes.size());
  const double all_ns = double(std::max<std::int64_t>(1, request.span.end_ns - request.span.start_ns));
  while (frames.next() && frames.time_ns() < request.span.end_ns) {
    const std::int64_t time_ns = frames.time_ns();
    if (time_ns < request.span.start_ns) continue;
    // A tenth of a second is short enough to follow an endoscope, and keeps the work within bounds.
    constexpr std::int64_t kJitterNs = 5'000'000;
    if (!alignment.moments.empty() &&
        time_ns < alignment.moments.back().time_ns + kAlignedEveryNs - kJitterNs)
      continue;
    sim::Picture picture;
    picture.width = frames.width();
    picture.height = frames.height();
    picture.rgb = frames.rgb();
    std::vector<Alignment::PictureSize>& sizes = alignment.sizes;
    if (sizes.empty() || sizes.back().width != picture.width || sizes.back().height != picture.height)
      sizes.push_back({time_ns, picture.width, picture.height});
    if (straight) picture = straight->straight(picture);
    alignment.moments.push_back(track.take(time_ns, picture));
    if (deformed) {
      const sim::DeformedMoment moment = deformed->take(track.taken(), alignment.moments.back());
      alignment.deformed->take(moment, alignment.surface);
      if (request.planned != nullptr) {
        alignment.deformed->departures.push_back(
            departure_of(moment, request.planned->at(time_ns, organ->surface()), alignment.surface));
      }
    }
    if (share) share(double(time_ns - request.span.start_ns) / all_ns);
  }
  if (alignment.moments.empty())
    throw UsageError("stream '" + stream + "' holds no picture in that stretch, so nothing can be aligned");
  return alignment;
}

}  // namespace kiroku::compare

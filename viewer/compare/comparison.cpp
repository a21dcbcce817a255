#include "viewer/compare/comparison.h"

#include <algorithm>

#include "base/error.h"
#include "viewer/playback/picture_span.h"

namespace kiroku::compare {
namespace {

std::int64_t end_of(const archive::CaseReader& recording, const std::string& stream) {
  const std::vector<archive::SegmentEntry> segments = recording.segments(stream, INT64_MIN, INT64_MAX);
  if (segments.empty())
    throw UsageError("stream '" + stream + "' holds no pictures, so there is nothing to compare with");
  return segments.back().span.end_ns;
}

/// Cameras and tool paths, from the recorded pictures in one pass.
class Tracking {
 public:
  Tracking(const archive::CaseReader& recording, const crypto::AgeIdentities& identities,
           const ByHand& by_hand, Comparison& comparison)
      : comparison_(comparison), by_hand_(by_hand) {
    from_ns_ = by_hand.registration->time_ns;
    for (const auto& [tool, clicks] : by_hand.tools) {
      tools_.push_back(tool);
      recorders_.emplace_back(clicks);
      for (const ToolClick& click : clicks) from_ns_ = std::min(from_ns_, click.time_ns);
    }
    frames_ = std::make_unique<playback::PictureSpan>(recording, identities, comparison.stream, from_ns_,
                                                      comparison.recording_end_ns);
  }

  void run(const ComparisonProgress& progress) {
    if (progress.step) progress.step("following picked points");
    while (frames_->next()) {
      const std::vector<std::uint8_t> rgb = frames_->rgb();
      const media::PictureView picture{frames_->width(), frames_->height(), 3, rgb};
      if (!comparison_.camera) {
        width_ = picture.width;
        height_ = picture.height;
        comparison_.camera.emplace(*by_hand_.registration, width_, height_);
      }
      comparison_.camera->take(frames_->time_ns(), picture);
      for (ToolPathRecorder& recorder : recorders_) recorder.take(frames_->time_ns(), picture);
      const double all = double(comparison_.recording_end_ns - from_ns_);
      if (progress.share && all > 0)
        progress.share(std::clamp(double(frames_->time_ns() - from_ns_) / all, 0.0, 1.0));
    }
    if (!comparison_.camera) throw UsageError("no picture was recorded from the registration's time on");
    comparison_.camera->finish();
  }

  void measure(const sim::PlanFrames& frames) {
    for (std::size_t i = 0; i < tools_.size(); ++i) {
      const RecordedPath path = recorders_[i].finish();
      ToolDistance& distance = comparison_.tools.emplace_back();
      distance.tool = tools_[i];
      distance.lost = path.lost;
      distance.largest_drift_px = path.largest_drift_px;
      distance.of_steps.resize(comparison_.steps.size());
      for (const PathPoint& point : path.points) {
        if (!comparison_.camera->held_at(point.time_ns)) continue;
        const PlanMoment moment = comparison_.map->plan_at(point.time_ns);
        if (moment.stands) continue;
        const auto planned = tool_at(frames, tools_[i], moment);
        if (!planned) continue;
        const auto pixel = pixel_of(comparison_.camera->camera_at(point.time_ns), *planned, width_, height_);
        if (!pixel) continue;
        const double px = (*pixel - point.pixel).norm();
        distance.all.add(px);
        distance.of_steps[moment.step].add(px);
      }
    }
  }

 private:
  Comparison& comparison_;
  const ByHand& by_hand_;
  std::vector<std::size_t> tools_;
  std::vector<ToolPathRecorder> recorders_;
  std::unique_ptr<playback::PictureSpan> frames_;
  std::int64_t from_ns_ = 0;
  int width_ = 0, height_ = 0;
};

}  // namespace

std::vector<PlannedStep> planned_steps(const sim::Plan& plan) {
  std::vector<PlannedStep> steps;
  double start_s = 0;
  for (const sim::PlanStep& step : plan.steps) {
    steps.push_back({sim::title_of(plan, step), start_s, step.duration_s});
    start_s += step.duration_s;
  }
  return steps;
}

std::optional<sim::Vector3> tool_at(const sim::PlanFrames& frames, std::size_t tool,
                                    const PlanMoment& moment) {
  const sim::PlanFrames::Kept& before = frames.at(moment.step, moment.plan_s);
  const auto& pose = before.frame.poses[tool];
  const std::size_t next = static_cast<std::size_t>(&before - frames.all().data()) + 1;
  if (next < frames.all().size() && frames.all()[next].frame.step == moment.step) {
    const sim::PlanFrame& after = frames.all()[next].frame;
    if (after.poses[tool] && after.time_s > before.frame.time_s) {
      const auto& from = pose ? pose : after.poses[tool];
      const double share =
          std::clamp((moment.plan_s - before.frame.time_s) / (after.time_s - before.frame.time_s), 0.0, 1.0);
      return sim::Vector3(from->position_m + share * (after.poses[tool]->position_m - from->position_m));
    }
  }
  if (!pose) return {};
  return pose->position_m;
}

std::string pictures_of(const archive::CaseReader& recording, const std::optional<std::string>& asked) {
  std::vector<std::string> names;
  for (const archive::StreamInfo& stream : recording.opening().streams) {
    if (stream.kind == "video") names.push_back(stream.name);
  }
  if (asked) {
    if (recording.stream(*asked).kind != "video")
      throw UsageError("stream '" + *asked + "' has no pictures; choose a video stream");
    return *asked;
  }
  if (names.empty()) throw UsageError("the case has no stream of pictures to compare with");
  if (std::ranges::find(names, "endoscope") != names.end()) return "endoscope";
  if (names.size() > 1) {
    std::string all;
    for (const std::string& name : names) all += (all.empty() ? "" : ", ") + name;
    throw UsageError("the case has several streams of pictures (" + all + "): say which with --stream");
  }
  return names.front();
}

Comparison compare(const archive::CaseReader& recording, const crypto::AgeIdentities& identities,
                   const std::string& stream, const sim::Plan& plan, const ByHand& by_hand,
                   const std::function<const sim::PlanFrames&()>& frames,
                   const ComparisonProgress& progress) {
  Comparison comparison;
  comparison.stream = stream;
  comparison.case_begins_ns = recording.opening().begins_ns;
  comparison.recording_end_ns = end_of(recording, stream);
  comparison.steps = planned_steps(plan);
  comparison.limits = by_hand.limits;
  if (!by_hand.tools.empty() && !by_hand.registration) {
    throw UsageError(
        "tools were clicked, and no camera is registered by which the plan's tools could be seen beside "
        "them: "
        "pick points of the organ under \"registration\"");
  }
  if (progress.step) progress.step("reading marks and vital signs");
  comparison.record = read_case_record(recording, identities);
  comparison.matching =
      by_hand.steps ? match_by_hand(comparison.steps, *by_hand.steps, comparison.recording_end_ns)
                    : match_by_marks(comparison.steps, comparison.record.marks, comparison.recording_end_ns);
  const bool any = std::ranges::any_of(comparison.matching.matches, [](const StepMatch& match) {
    return match.span.end_ns > match.span.start_ns;
  });
  if (any || !by_hand.points.empty())
    comparison.map.emplace(comparison.steps, comparison.matching, by_hand.points);
  comparison.figures =
      figures_of(comparison.steps, comparison.matching, comparison.record, comparison.limits);
  if (by_hand.registration) {
    if (!comparison.map) {
      throw UsageError(
          "no step was found in the recording, so that the plan's time is not known: match steps by hand");
    }
    Tracking tracking(recording, identities, by_hand, comparison);
    tracking.run(progress);
    if (!by_hand.tools.empty()) tracking.measure(frames());
  }
  return comparison;
}

}  // namespace kiroku::compare

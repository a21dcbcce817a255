// A plan beside the recording of the operation: what was matched, when and how each step was done, where the
// tools went. Objects belong to one thread.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "archive/reading/case_reader.h"
#include "crypto/age_recipient.h"
#include "sim/plan/plan.h"
#include "sim/plan/plan_frames.h"
#include "viewer/compare/by_hand.h"
#include "viewer/compare/camera_track.h"
#include "viewer/compare/case_record.h"
#include "viewer/compare/figures.h"
#include "viewer/compare/fluoroscopy.h"
#include "viewer/compare/organ_alignment.h"
#include "viewer/compare/time_map.h"
#include "viewer/compare/tool_path.h"

namespace kiroku::compare {

std::vector<PlannedStep> planned_steps(const sim::Plan& plan);

/// How far a recorded tool was from where the plan had it, in pixels of the recording. Only pictures count in
/// which a step is done and the plan has the tool at the organ.
struct ToolDistance {
  std::size_t tool = 0;
  Distance all;
  std::vector<Distance> of_steps;   // for each planned step
  std::vector<archive::Span> lost;  // where flow lost the tip
  double largest_drift_px = 0;
};

/// What a comparison found, without any picture.
struct Comparison {
  std::vector<PlannedStep> steps;
  StepMatching matching;
  std::optional<TimeMap> map;  // nothing where no step was found
  std::vector<StepFigures> figures;
  PressureLimits limits;
  CaseRecord record;
  std::string stream;  // the recorded pictures
  std::int64_t case_begins_ns = 0, recording_end_ns = 0;
  // Where a person picked points and clicked tools.
  std::optional<CameraTrack> camera;
  std::vector<ToolDistance> tools;
  std::optional<Fluoroscopy> fluoroscopy;  // where it was asked for
  std::optional<Alignment> alignment;      // likewise
};

struct ComparisonProgress {
  std::function<void(const std::string& doing)> step;
  std::function<void(double share)> share;  // of that
};

/// Where the plan has a tool: between two of its frames evenly. Nothing where it is not at the organ.
std::optional<sim::Vector3> tool_at(const sim::PlanFrames& frames, std::size_t tool,
                                    const PlanMoment& moment);

/// The stream asked for; without, "endoscope", or the only one with pictures. kiroku::UsageError where there
/// is none, or it must be said which.
std::string pictures_of(const archive::CaseReader& recording, const std::optional<std::string>& asked);

/// Reads the case and compares. `frames` is only called for where tools were clicked. kiroku::Error in a
/// sentence for what `by_hand` says and cannot be, for tools without a registration, and for a case that
/// cannot be read.
Comparison compare(const archive::CaseReader& recording, const crypto::AgeIdentities& identities,
                   const std::string& stream, const sim::Plan& plan, const ByHand& by_hand,
                   const std::function<const sim::PlanFrames&()>& frames,
                   const ComparisonProgress& progress = {});

}  // namespace kiroku::compare

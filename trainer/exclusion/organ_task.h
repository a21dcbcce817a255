// Where an organ of a patient is held, what lies hidden behind it and from where one looks, by rules that a
// person can check (docs/explanation/training.md, "Organs of a CT"). Pure functions, thread-safe.
#pragma once

#include <array>
#include <optional>
#include <string>

#include "trainer/exclusion/exclusion_body.h"
#include "trainer/exclusion/hand_forces.h"

namespace kiroku::trainer {

/// Unit vectors at right angles: the way the organ is lifted, and from the trainee on into the body.
struct Approach {
  sim::Vector3 lifts, away;
};
/// In patient coordinates (left, back, head): from the front, lifted towards the head, and from the feet,
/// lifted towards the front; first the one that lifts the way the organ is thinner.
std::array<Approach, 2> usual_approaches(const sim::TetMesh& mesh);

/// What a person may decide; what is left out follows the rules. The mesh's frame, m.
struct OrganTaskRequest {
  std::optional<sim::Vector3> eye_m;
  std::optional<std::array<sim::Vector3, 2>> line_m;
};

/// The nodes in the last quarter of the organ's extent along `away`: held where nothing else says so.
std::vector<std::size_t> held_by_rule(const sim::TetMesh& mesh, const sim::Vector3& away);

/// A line of a fifth of the organ's width, 3 cm to 4.4 cm long and across the view, lies 1 cm below the
/// organ's underside, a third, a half or two thirds of the organ's depth (4, 6 or 8 cm at most) behind its
/// border. The eye looks down at it by 34, 48 or 62 degrees from 46 cm, nearer or farther for organs narrower
/// or wider than 20 cm (half to one and a half times). Of these the first that is hidden and can be brought
/// into sight: flat views before steep ones, near the border before deep, the organ's middle before its
/// sides.
///
/// Not where the line can be seen at rest, is outside the picture, or stays hidden even with all that is not
/// held moved out of the way by kReachMetres, nor where no place of the rule does.
struct OrganTask {
  std::optional<ExclusionTask> task;
  std::string why_not;  // the rest of a sentence about the organ
};
OrganTask organ_task(const sim::TetMesh& mesh, const sim::Constraints& constraints, const Approach& approach,
                     const OrganTaskRequest& request);

inline constexpr double kReachMetres = 0.06;

/// Fingers or instruments at the border that lift it by 2 cm: how often a second their forces can be renewed
/// here, by the time that 99 of 100 steps keep. Takes half a second.
double measured_force_rate_hz(const ExclusionBody& body, std::size_t fingers,
                              Touch touch = Touch::kFingertips, const InstrumentOptions& instruments = {});

}  // namespace kiroku::trainer

// A plan as a template of a procedure, and the template on another patient's organ.
//
// Source: the "adaptive template of a surgical procedure" that "Interactive Volume Manipulation for
// Supporting Preoperative Planning" wishes for in its section 5. Landmarks that both organs have tell a
// thin-plate spline (thin_plate_spline.h). It takes tools along; where a tool comes to the organ, it comes as
// far from the surface of the other organ as it did from that of its own. Pure but for reading landmarks;
// thread-safe.
//
// {"format": "kiroku-plan-template/1", "name": "...", "length_unit": "mm", "time_step_s": 0.05,
//  "corotational": false, "gravity_m_s2": [0, 0, -9.81],
//  "landmarks": {"hilum": [1, 2, 3], ...}, "tools": {...}, "steps": [...]}
//
// Steps are those of the plan. 'corotational' is the adapted plan's, too, unless the patient's document says
// otherwise. Gravity is in the frame of the plan's own patient, zeros where it had none: it serves for a
// warning alone. The pose with which a tool comes to the organ also has "from_surface": how far its origin is
// from the organ at rest, negative inside.
#pragma once

#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include <nlohmann/json_fwd.hpp>

#include "sim/model/body_model.h"
#include "sim/plan/plan.h"

namespace kiroku::sim {

using PlanLandmarks = std::map<std::string, Vector3>;  // by name, m

/// {"length_unit": "mm", "landmarks": {"hilum": [1, 2, 3], ...}}. kiroku::Error with the JSON path.
PlanLandmarks read_plan_landmarks(const std::filesystem::path& file);

/// Of a plan and its document. kiroku::Error for landmarks that could not carry a template.
nlohmann::ordered_json plan_template(const nlohmann::ordered_json& document, const Plan& plan,
                                     const PlanLandmarks& landmarks);

struct LandmarkFit {
  std::string name;
  double affine_m = 0;  // how far the best affine mapping leaves it from the patient's
  /// How far the others' spline misses it; nothing where these are too few or tell no mapping.
  std::optional<double> left_out_m;
};
struct AdaptedPlan {
  nlohmann::ordered_json document;
  std::vector<LandmarkFit> fits;      // by name
  std::vector<std::string> unused;    // landmarks that one of the two does not have
  std::vector<std::string> warnings;  // where it is computed otherwise than the template's plan
  double furthest_to_surface_m = 0;   // how far a tool was moved, beside the spline, to suit the surface
};
/// The template's text on a patient's body, of which `patient` is the document: a plan, of which tools and
/// steps are left out, or the body alone. kiroku::Error in a sentence: for a template that is none (with
/// `file` and JSON path), for another unit of length, and what ThinPlateSpline throws.
AdaptedPlan adapt_template(const std::string& text, const std::string& file,
                           const nlohmann::ordered_json& patient, const BodyModel& body,
                           const PlanLandmarks& landmarks);

}  // namespace kiroku::sim

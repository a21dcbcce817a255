#include "sim/plan/plan_template.h"

#include <algorithm>
#include <limits>
#include <set>
#include <utility>

#include <Eigen/LU>
#include <nlohmann/json.hpp>

#include "base/error.h"
#include "sim/cutting/closest_point.h"
#include "sim/mesh/mesh_topology.h"
#include "sim/model/json_field.h"
#include "sim/plan/thin_plate_spline.h"
#include "sim/plan/written_pose.h"

namespace kiroku::sim {
namespace {

using nlohmann::ordered_json;

constexpr const char* kTemplateFormat = "kiroku-plan-template/1";
constexpr const char* kFromSurface = "from_surface";
constexpr const char* kCorotational = "corotational";
constexpr const char* kGravity = "gravity_m_s2";
constexpr double kOnSurface = 1e-9;  // m

const char* unit_text(LengthUnit unit) { return unit == LengthUnit::kMetre ? "m" : "mm"; }

LengthUnit unit_of(const JsonField& field) {
  const std::string text = field.text();
  if (text != "m" && text != "mm") field.fail("is '" + text + "': it must be 'm' or 'mm'");
  return text == "m" ? LengthUnit::kMetre : LengthUnit::kMillimetre;
}

ordered_json numbers_of(const Vector3& vector) { return {vector.x(), vector.y(), vector.z()}; }

PlanLandmarks landmarks_of(const JsonField& field, LengthUnit unit) {
  PlanLandmarks landmarks;
  for (const auto& [name, place] : field.members()) landmarks[name] = place.vector() / units_per_metre(unit);
  return landmarks;
}

/// The surface of an organ at rest.
class OrganSurface {
 public:
  explicit OrganSurface(const TetMesh& mesh) : mesh_(mesh), faces_(faces_of(mesh).surface) {}

  [[nodiscard]] Vector3 nearest_m(const Vector3& place_m) const {
    Vector3 nearest_m = place_m;
    double least_m = std::numeric_limits<double>::infinity();
    for (const Face& face : faces_) {
      const Vector3 there_m = closest_on_triangle(place_m, corners(face));
      const double away_m = (there_m - place_m).norm();
      if (away_m >= least_m) continue;
      least_m = away_m;
      nearest_m = there_m;
    }
    return nearest_m;
  }
  /// Negative inside.
  [[nodiscard]] double distance_m(const Vector3& place_m) const {
    const double away_m = (nearest_m(place_m) - place_m).norm();
    return inside(place_m) ? -away_m : away_m;
  }
  /// The place straight above or below the surface's nearest to this one that is so far from there.
  [[nodiscard]] Vector3 at_distance_m(const Vector3& place_m, double distance_m) const {
    const Vector3 foot_m = nearest_m(place_m);
    Vector3 out = place_m - foot_m;
    if (out.norm() <= kOnSurface) {
      out.setZero();
      for (const Face& face : faces_) {
        const std::array<Vector3, 3> at_m = corners(face);
        if ((closest_on_triangle(foot_m, at_m) - foot_m).norm() <= kOnSurface)
          out += (at_m[1] - at_m[0]).cross(at_m[2] - at_m[0]).normalized();
      }
    } else if (inside(place_m)) {
      out = -out;
    }
    return foot_m + distance_m * out.normalized();
  }

 private:
  [[nodiscard]] std::array<Vector3, 3> corners(const Face& face) const {
    return {mesh_.nodes[face.nodes[0]], mesh_.nodes[face.nodes[1]], mesh_.nodes[face.nodes[2]]};
  }
  [[nodiscard]] bool inside(const Vector3& place_m) const {
    return std::ranges::any_of(mesh_.tetrahedra, [&](const Tetrahedron& nodes) {
      Eigen::Matrix3d sides;
      for (Eigen::Index i = 0; i < 3; ++i)
        sides.col(i) = mesh_.nodes[nodes[static_cast<std::size_t>(i) + 1]] - mesh_.nodes[nodes[0]];
      const Vector3 weights = sides.inverse() * (place_m - mesh_.nodes[nodes[0]]);
      return weights.minCoeff() >= 0 && weights.sum() <= 1;
    });
  }

  const TetMesh& mesh_;
  std::vector<Face> faces_;
};

/// Calls `comes(pose, tool)` for each pose of the steps with which a tool comes to the organ, `moves` for the
/// others and `cuts` for curves; each with the value to read and the one to change.
template <typename Comes, typename Moves, typename Cuts>
void visit_poses(const JsonField& steps, ordered_json& changed, Comes comes, Moves moves, Cuts cuts) {
  std::set<std::string> there;
  const auto visit_path = [&](const std::string& tool, const JsonField& path, ordered_json& into) {
    std::size_t number = 0;
    for (const JsonField& frame : path.elements()) {
      ordered_json& out = into.at(number++);
      if (there.insert(tool).second) {
        comes(frame, out, tool);
      } else {
        moves(frame, out, tool);
      }
    }
  };
  std::size_t number = 0;
  for (const JsonField& step : steps.elements()) {
    ordered_json& out = changed.at(number++);
    const std::string action = step.member("do").text();
    if (step.has("at")) {
      const std::string tool = step.member("tool").text();
      there.insert(tool);
      comes(step.member("at"), out["at"], tool);
    } else if (step.has("curve")) {
      cuts(step.member("curve"), out["curve"]);
    } else if (step.has("path")) {
      const std::string tool = step.member("tool").text();
      visit_path(tool, step.member("path"), out["path"]);
      if (action == "cut") there.erase(tool);
    } else if (step.has("tools")) {
      for (const auto& [tool, path] : step.member("tools").members())
        visit_path(tool, path, out["tools"][tool]);
    } else if (action == "release") {
      there.erase(step.member("tool").text());
    }
  }
}

Eigen::Quaterniond rotation_of(const JsonField& pose) {
  const auto rotation = pose.optional_member("rotation");
  if (!rotation) return Eigen::Quaterniond::Identity();
  const Vector3 axis = rotation->member("axis").vector();
  if (!(axis.norm() > 0)) rotation->member("axis").fail("has no direction");
  return orientation_of({axis, rotation->member("degrees").number()});
}

ordered_json rotation_json(const Eigen::Quaterniond& orientation) {
  const WrittenRotation written = written_rotation(orientation);
  return {{"axis", numbers_of(written.axis)}, {"degrees", written.degrees}};
}

/// Brings the steps of a template to a patient's organ.
class Adapter {
 public:
  Adapter(const ThinPlateSpline& spline, const TetMesh& mesh, LengthUnit unit)
      : spline_(spline), surface_(mesh), unit_(unit) {}

  void come(const JsonField& from, ordered_json& to, const std::string& tool) {
    const Vector3 place_m = from.member("position").vector() / units_per_metre(unit_);
    const double distance_m = from.member(kFromSurface).number() / units_per_metre(unit_);
    const Vector3 mapped_m = spline_.at(place_m);
    const Vector3 there_m = surface_.at_distance_m(mapped_m, distance_m);
    Moved& moved = moved_[tool];
    moved = {Eigen::Quaterniond(spline_.turn(place_m)), there_m - mapped_m};
    furthest_m_ = std::max(furthest_m_, moved.shift_m.norm());
    to.erase(kFromSurface);
    to["position"] = numbers_of(written_position(there_m, unit_));
    to["rotation"] = rotation_json(moved.turn * rotation_of(from));
  }
  void move(const JsonField& from, ordered_json& to, const std::string& tool) const {
    const Moved& moved = moved_.at(tool);
    if (from.has("position")) {
      const Vector3 place_m = from.member("position").vector() / units_per_metre(unit_);
      to["position"] = numbers_of(written_position(spline_.at(place_m) + moved.shift_m, unit_));
    }
    if (from.has("rotation")) to["rotation"] = rotation_json(moved.turn * rotation_of(from));
  }
  void cut(const JsonField& from, ordered_json& to) {
    std::size_t number = 0;
    Vector3 middle_m = Vector3::Zero();
    for (const JsonField& handle : from.member("through").elements()) {
      const Vector3 place_m = handle.vector() / units_per_metre(unit_);
      const Vector3 mapped_m = spline_.at(place_m);
      const Vector3 there_m = surface_.nearest_m(mapped_m);
      furthest_m_ = std::max(furthest_m_, (there_m - mapped_m).norm());
      to["through"].at(number++) = numbers_of(written_position(there_m, unit_));
      middle_m += place_m;
    }
    if (number > 0 && from.has("direction")) {
      const Eigen::Matrix3d turn = spline_.turn(middle_m / static_cast<double>(number));
      to["direction"] = numbers_of(turn * from.member("direction").vector());
    }
  }
  [[nodiscard]] double furthest_m() const { return furthest_m_; }

 private:
  /// How a tool was turned, and moved beside the spline, where it came to the organ.
  struct Moved {
    Eigen::Quaterniond turn = Eigen::Quaterniond::Identity();
    Vector3 shift_m = Vector3::Zero();
  };
  const ThinPlateSpline& spline_;
  OrganSurface surface_;
  LengthUnit unit_;
  std::map<std::string, Moved> moved_;
  double furthest_m_ = 0;
};

/// Has the adapted plan computed as the template's plan was. The patient's document goes first, and what then
/// differs is told.
std::vector<std::string> take_physics(const JsonField& from, const ordered_json& patient,
                                      const BodyModel& body, ordered_json& made) {
  std::vector<std::string> warnings;
  if (const auto corotational = from.optional_member(kCorotational)) {
    const bool turns = corotational->boolean();
    if (!patient.contains(kCorotational)) {
      made[kCorotational] = turns;
    } else if (patient[kCorotational] != turns) {
      warnings.emplace_back(std::string("the template's plan was computed ") +
                            (turns ? "with 'corotational', for large rotations, and the patient's document "
                                     "says false: where tissue turns far, its stress and forces come out "
                                     "too high"
                                   : "without 'corotational', and the patient's document says true: stress "
                                     "and forces are not those of the template's plan"));
    }
  }
  if (const auto gravity = from.optional_member(kGravity)) {
    const bool weighed = !gravity->vector().isZero(0), weighs = !body.gravity_m_s2.isZero(0);
    if (weighed && !weighs) {
      warnings.emplace_back(
          "the template's plan was computed with gravity, and the patient's document has none: write "
          "'gravity_m_s2' there, in the direction in which this patient lies");
    } else if (!weighed && weighs) {
      warnings.emplace_back(
          "the template's plan was computed without gravity, and the patient's document has it: the organ "
          "sags here under its weight, and forces are not those of the template's plan");
    }
  }
  return warnings;
}

/// What the others' spline misses each landmark by.
std::optional<double> left_out_m(const std::vector<Vector3>& from_m, const std::vector<Vector3>& to_m,
                                 std::size_t which) {
  std::vector<Vector3> other_from_m = from_m, other_to_m = to_m;
  other_from_m.erase(other_from_m.begin() + static_cast<std::ptrdiff_t>(which));
  other_to_m.erase(other_to_m.begin() + static_cast<std::ptrdiff_t>(which));
  try {
    return (ThinPlateSpline(other_from_m, other_to_m).at(from_m[which]) - to_m[which]).norm();
  } catch (const Error&) {
    return std::nullopt;
  }
}

}  // namespace

PlanLandmarks read_plan_landmarks(const std::filesystem::path& file) {
  const nlohmann::json document = JsonField::parse(read_document(file), file.string());
  const JsonField field(document, file.string());
  field.expect_object({"length_unit", "landmarks"});
  return landmarks_of(field.member("landmarks"), unit_of(field.member("length_unit")));
}

ordered_json plan_template(const ordered_json& document, const Plan& plan, const PlanLandmarks& landmarks) {
  std::vector<Vector3> places_m;
  for (const auto& [name, place_m] : landmarks) places_m.push_back(place_m);
  check_landmarks(places_m, "the template");
  const LengthUnit unit = plan.body.unit;
  const double units = units_per_metre(unit);
  ordered_json made{{"format", kTemplateFormat}, {"name", plan.name}, {"length_unit", unit_text(unit)}};
  if (document.contains("time_step_s")) made["time_step_s"] = document["time_step_s"];
  made[kCorotational] = plan.corotational;
  made[kGravity] = numbers_of(plan.body.gravity_m_s2);
  for (const auto& [name, place_m] : landmarks)
    made["landmarks"][name] = numbers_of(written_position(place_m, unit));
  made["tools"] = document.at("tools");
  made["steps"] = document.at("steps");
  const auto read = nlohmann::json::parse(document.dump());
  const OrganSurface surface(plan.body.mesh);
  visit_poses(
      JsonField(read, "the plan").member("steps"), made["steps"],
      [&](const JsonField& from, ordered_json& to, const std::string& /*tool*/) {
        const double distance_m = surface.distance_m(from.member("position").vector() / units);
        to[kFromSurface] = written_position({distance_m, 0, 0}, unit).x();
      },
      [](const JsonField& /*from*/, ordered_json& /*to*/, const std::string& /*tool*/) {},
      [](const JsonField& /*from*/, ordered_json& /*to*/) {});
  return made;
}

AdaptedPlan adapt_template(const std::string& text, const std::string& file, const ordered_json& patient,
                           const BodyModel& body, const PlanLandmarks& landmarks) {
  const nlohmann::json document = JsonField::parse(text, file);
  const JsonField field(document, file);
  if (!field.is_object() || !field.has("format") || field.member("format").text() != kTemplateFormat)
    throw Error("cannot use " + file + ": it is no template of a plan, as 'kiroku plan template' saves it");
  field.expect_object({"format", "name", "length_unit", "time_step_s", kCorotational, kGravity, "landmarks",
                       "tools", "steps"});
  const LengthUnit unit = unit_of(field.member("length_unit"));
  if (unit != body.unit) {
    throw Error("the template is in " + std::string(unit_text(unit)) + " and the patient's organ in " +
                unit_text(body.unit) + ": write the patient's document in the template's unit");
  }
  const PlanLandmarks own = landmarks_of(field.member("landmarks"), unit);
  AdaptedPlan adapted;
  std::vector<Vector3> from_m, to_m;
  for (const auto& [name, place_m] : own) {
    const auto there = landmarks.find(name);
    if (there == landmarks.end()) {
      adapted.unused.push_back(name);
      continue;
    }
    adapted.fits.push_back({name, 0, {}});
    from_m.push_back(place_m);
    to_m.push_back(there->second);
  }
  for (const auto& [name, place_m] : landmarks) {
    if (!own.contains(name)) adapted.unused.push_back(name);
  }
  const ThinPlateSpline spline(from_m, to_m);
  const std::vector<double> affine_m = affine_residuals_m(from_m, to_m);
  for (std::size_t i = 0; i < adapted.fits.size(); ++i) {
    adapted.fits[i].affine_m = affine_m[i];
    adapted.fits[i].left_out_m = left_out_m(from_m, to_m, i);
  }
  const ordered_json ordered = ordered_json::parse(text);
  ordered_json& made = adapted.document;
  made["name"] = field.member("name").text();
  for (const auto& [key, value] : patient.items()) {
    if (key != "name" && key != "tools" && key != "steps" && key != "time_step_s") made[key] = value;
  }
  if (ordered.contains("time_step_s")) made["time_step_s"] = ordered["time_step_s"];
  adapted.warnings = take_physics(field, patient, body, made);
  (void)field.member("tools").members();
  made["tools"] = ordered.at("tools");
  made["steps"] = ordered.at("steps");
  Adapter adapter(spline, body.mesh, unit);
  visit_poses(
      field.member("steps"), made["steps"],
      [&](const JsonField& from, ordered_json& to, const std::string& tool) { adapter.come(from, to, tool); },
      [&](const JsonField& from, ordered_json& to, const std::string& tool) { adapter.move(from, to, tool); },
      [&](const JsonField& from, ordered_json& to) { adapter.cut(from, to); });
  adapted.furthest_to_surface_m = adapter.furthest_m();
  return adapted;
}

}  // namespace kiroku::sim

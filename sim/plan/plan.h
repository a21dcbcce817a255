// A planned operation as one JSON document: the organ, the tools, and what they do when. Plain data, made by
// read_plan(); docs/reference/simulation.md says what each key means.
//
// {"name": "Liver: grasp and retraction",
//  "mesh": "liver.msh", "length_unit": "mm", "materials": [...], "fixed": [...], "gravity_m_s2": [0, 0, 0],
//  "corotational": false,
//  "tools": {"forceps": {"kind": "forceps", "jaws": [12, 8, 6]}},
//  "steps": [{"do": "grasp", "tool": "forceps", "at": {"position": [10, 20, 30]}},
//            {"do": "retract", "tool": "forceps", "path": [{"at_s": 1, "position": [10, 20, 45]}]},
//            {"do": "hold", "duration_s": 0.5},
//            {"do": "release", "tool": "forceps"}]}
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "sim/cutting/cut_curve.h"
#include "sim/manipulation/jaws.h"
#include "sim/manipulation/tool.h"
#include "sim/model/body_model.h"
#include "sim/plan/tool_path.h"

namespace kiroku::sim {

enum class ToolKind {
  kForceps,    // binds the surface between its jaws, and holds it in all directions
  kPin,        // binds the surface around its point
  kGrasper,    // two jaws that close, and hold by friction
  kRetractor,  // a flat plate that pushes
  kHook,       // a rod that pushes
  kFinger,     // a fingertip that pushes
  kScalpel,    // cuts along its edge
  kClip,       // closes as a grasper does, and stays on the tissue when its applier leaves
};
const char* name_of(ToolKind kind);
/// Whether it binds what it grasps, closes its jaws, or touches, and pushes where it does; a scalpel does
/// none.
bool binds(ToolKind kind);
bool closes(ToolKind kind);
/// Of those that close: whether what it holds stays held when it is released.
bool stays(ToolKind kind);
bool touches(ToolKind kind);

struct PlanTool {
  ToolKind kind = ToolKind::kFinger;
  Tool tool;  // of a scalpel only the name; of a grasper or a clip its name, and shape and friction of a jaw
  double edge_m = 0;     // of a scalpel: from its origin along its z axis
  double opening_m = 0;  // of one that closes: between the faces of its jaws when they come

  /// Of one that closes.
  [[nodiscard]] const Vector3& jaw_half_extent_m() const { return std::get<Box>(tool.shape).half_extent_m; }
};

/// What a step moves.
struct PlanMotion {
  std::size_t tool = 0;
  ToolPath path;
};

enum class PlanAction { kGrasp, kClose, kRetract, kPress, kHold, kCut, kRelease };
const char* name_of(PlanAction action);

struct PlanStep {
  PlanAction action = PlanAction::kHold;
  std::string where;  // its JSON path: "steps[3]"
  std::string name;   // "clip the artery"; empty where the plan gives none
  std::vector<PlanMotion>
      motions;  // of all but hold and release; the paths of grasp and close have one frame
  std::vector<std::size_t> released;
  /// Of a cut that is drawn on the organ at rest: the scalpel's motion is what cut_along() makes of it, in
  /// the rest shape, however the organ lies meanwhile.
  std::optional<CutCurve> curve;
  double opening_m = 0;  // of a close: between the jaws at its end
  double duration_s = 0;
};

struct Plan {
  std::string name;
  std::filesystem::path volume;  // what pictures show; empty for none
  BodyModel body;
  bool corotational = false;  // for large rotations
  std::vector<PlanTool> tools;
  std::vector<PlanStep> steps;
  double time_step_s = 0.05;
};

/// Of a scalpel whose edge is there; how it is turned about its edge does not matter.
Pose pose_of_blade(const BladePose& blade);
/// Of a cut that is drawn, one time step from each pose to the next; about one edge of the surface between
/// two. kiroku::Error as blade_along() throws it, and where the tool is no scalpel.
PlanMotion cut_along(const Plan& plan, std::size_t scalpel, const CutCurve& curve);

/// What a step is called: its name, or what it does with which tools ("retract forceps").
std::string title_of(const Plan& plan, const PlanStep& step);
/// When a step begins, since the plan began; of the number of steps, when the plan ends.
double begins_s(const Plan& plan, std::size_t step);

/// Either a plan or all that is wrong with the document, each a sentence with its JSON path.
struct PlanReading {
  std::optional<Plan> plan;
  std::vector<std::string> errors;
};
/// kiroku::IoError for a file that cannot be read; all else is told in the result.
/// `maker` makes the mesh where the plan has a recipe for it; without, it must name a file.
PlanReading read_plan(const std::filesystem::path& file, const MeshMaker& maker = {});
/// The same for a document's text that is not, or not so, in the file: that only says where it belongs.
PlanReading read_plan_text(const std::string& text, const std::filesystem::path& file,
                           const MeshMaker& maker = {});

/// Of the edges of the mesh's surface; 0 for none.
double mean_surface_edge_m(const TetMesh& mesh);

}  // namespace kiroku::sim

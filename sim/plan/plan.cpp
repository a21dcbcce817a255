#include "sim/plan/plan.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <utility>

#include "base/error.h"
#include "base/number_text.h"
#include "sim/mesh/mesh_topology.h"
#include "sim/model/json_field.h"
#include "sim/plan/written_pose.h"

namespace kiroku::sim {
namespace {

constexpr double kLongestStepS = 600, kShortestTimeStepS = 0.001;
constexpr double kLeastFriction = 0.01, kMostFriction = 10;

constexpr std::array<std::pair<const char*, ToolKind>, 8> kKinds{{{"forceps", ToolKind::kForceps},
                                                                  {"pin", ToolKind::kPin},
                                                                  {"grasper", ToolKind::kGrasper},
                                                                  {"clip", ToolKind::kClip},
                                                                  {"retractor", ToolKind::kRetractor},
                                                                  {"hook", ToolKind::kHook},
                                                                  {"finger", ToolKind::kFinger},
                                                                  {"scalpel", ToolKind::kScalpel}}};
constexpr std::array<std::pair<const char*, PlanAction>, 7> kActions{{{"grasp", PlanAction::kGrasp},
                                                                      {"close", PlanAction::kClose},
                                                                      {"retract", PlanAction::kRetract},
                                                                      {"press", PlanAction::kPress},
                                                                      {"hold", PlanAction::kHold},
                                                                      {"cut", PlanAction::kCut},
                                                                      {"release", PlanAction::kRelease}}};

constexpr std::array<std::pair<const char*, bool>, 2> kCurveShapes{{{"spline", true}, {"polyline", false}}};

/// The value of a word of such a table; refused with all words.
template <typename Value, std::size_t kSize>
Value word_of(const JsonField& field, const std::array<std::pair<const char*, Value>, kSize>& words) {
  const std::string text = field.text();
  std::string all;
  for (const auto& [word, value] : words) {
    if (text == word) return value;
    all += std::string(all.empty() ? "" : ", ") + word;
  }
  field.fail("is '" + text + "': it must be one of " + all);
}

template <typename Value, std::size_t kSize>
const char* word_for(Value value, const std::array<std::pair<const char*, Value>, kSize>& words) {
  return std::ranges::find(words, value, &std::pair<const char*, Value>::second)->first;
}

class PlanReader {
 public:
  PlanReader(const JsonField& document, const std::filesystem::path& folder, const MeshMaker& maker,
             std::vector<std::string>& errors)
      : errors_(errors) {
    attempt([&] {
      if (const auto volume = document.optional_member("volume"))
        plan_.volume = volume->existing_path(folder);
      return true;
    });
    const auto body = attempt([&] { return BodyReader(document, folder, maker).take(); });
    attempt([&] {
      document.expect_object({"name", "volume", "mesh", "length_unit", "materials", "fixed", "gravity_m_s2",
                              "corotational", "time_step_s", "tools", "steps"});
      return true;
    });
    if (body) plan_.body = *body;
    attempt([&] {
      if (const auto name = document.optional_member("name")) plan_.name = name->text();
      return true;
    });
    attempt([&] {
      if (const auto corotational = document.optional_member("corotational"))
        plan_.corotational = corotational->boolean();
      return true;
    });
    attempt([&] {
      if (const auto step = document.optional_member("time_step_s"))
        plan_.time_step_s = within(*step, kShortestTimeStepS, 1);
      return true;
    });
    // Lengths mean nothing without a unit, which the body has.
    if (!body) return;
    attempt([&] {
      for (const auto& [name, tool] : document.member("tools").members())
        attempt([&, &name = name, &tool = tool] { return read_tool(name, tool); });
      return true;
    });
    attempt([&] {
      refuse_names_of_jaws();
      warn_of_small_tools();
      const std::vector<JsonField> steps = document.member("steps").elements();
      if (steps.empty()) document.member("steps").fail("has no step");
      for (const JsonField& step : steps) {
        attempt([&] {
          read_step(step);
          return true;
        });
      }
      return true;
    });
  }

  Plan take() { return std::move(plan_); }

 private:
  /// How far a tool is, as the steps read so far leave it.
  struct ToolState {
    std::optional<Pose> pose;  // absent: not at the organ
    std::string since;         // the step that brought it there
    double opening_m = 0;      // of one that closes
    std::string left;          // the step that left a clip at the organ
  };

  /// One error does not hide the next.
  template <typename Read>
  auto attempt(Read read) -> std::optional<decltype(read())> {
    try {
      return read();
    } catch (const Error& error) {
      // A volume that is not there is missed by the mesh made of it, too.
      if (std::ranges::count(errors_, error.what()) == 0) errors_.emplace_back(error.what());
      return std::nullopt;
    }
  }

  static double within(const JsonField& field, double least, double most) {
    const double number = field.number();
    if (!(number >= least && number <= most)) {
      field.fail("is " + number_text(number) + ": it must be between " + number_text(least) + " and " +
                 number_text(most));
    }
    return number;
  }

  [[nodiscard]] double metres(const JsonField& field) const {
    const double number = field.number();
    if (!(number > 0)) field.fail("is " + number_text(number) + ": it must be greater than 0");
    return number / units_per_metre(plan_.body.unit);
  }
  [[nodiscard]] Vector3 place_m(const JsonField& field) const {
    return field.vector() / units_per_metre(plan_.body.unit);
  }

  bool read_tool(const std::string& name, const JsonField& tool) {
    // Named in any case, so that steps that use it are not refused as well.
    tool_named_[name] = plan_.tools.size();
    state_.emplace_back();
    PlanTool& into = plan_.tools.emplace_back();
    into.tool.name = name;
    if (name.empty()) tool.fail("has no name");
    into.kind = word_of(tool.member("kind"), kKinds);
    const auto sticks = [&] {
      const auto told = tool.optional_member("sticks");
      return told && told->boolean();
    };
    switch (into.kind) {
      case ToolKind::kForceps:
        tool.expect_object({"kind", "jaws"});
        into.tool = forceps(name, size_m(tool.member("jaws")) / 2);
        break;
      case ToolKind::kPin:
        tool.expect_object({"kind", "radius"});
        into.tool = pin(name, metres(tool.member("radius")));
        break;
      case ToolKind::kClip:
        if (plan_.corotational) {
          tool.member("kind").fail(
              "is 'clip': a clip that was left holds tissue of linear elements alone; leave out "
              "'corotational', or take a grasper");
        }
        [[fallthrough]];
      case ToolKind::kGrasper:
        tool.expect_object({"kind", "jaw", "opening", "friction"});
        into.opening_m = metres(tool.member("opening"));
        into.tool = jaw(name, 0, size_m(tool.member("jaw")) / 2,
                        within(tool.member("friction"), kLeastFriction, kMostFriction));
        into.tool.name = name;
        break;
      case ToolKind::kRetractor:
        tool.expect_object({"kind", "size", "sticks"});
        into.tool = flat_retractor(name, size_m(tool.member("size")) / 2, sticks());
        break;
      case ToolKind::kHook:
        tool.expect_object({"kind", "radius", "length", "sticks"});
        into.tool = hook(name, metres(tool.member("radius")), metres(tool.member("length")) / 2, sticks());
        break;
      case ToolKind::kFinger:
        tool.expect_object({"kind", "radius", "sticks"});
        into.tool = finger(name, metres(tool.member("radius")), sticks());
        break;
      case ToolKind::kScalpel:
        tool.expect_object({"kind", "edge"});
        into.edge_m = metres(tool.member("edge"));
        break;
    }
    return true;
  }

  /// Jaws have names of their own in what a plan tells.
  void refuse_names_of_jaws() const {
    for (const PlanTool& tool : plan_.tools) {
      for (std::size_t which = 0; closes(tool.kind) && which < kJaws; ++which) {
        const std::string name = jaw_name(tool.tool.name, which);
        if (tool_named_.contains(name))
          throw Error("tools: '" + name + "' is what a jaw of '" + tool.tool.name +
                      "' is called: give the other tool another name");
      }
    }
  }

  /// Tissue is touched at its nodes.
  void warn_of_small_tools() {
    const double edge_m = mean_surface_edge_m(plan_.body.mesh);
    const double units = units_per_metre(plan_.body.unit);
    for (const PlanTool& tool : plan_.tools) {
      const auto* const sphere = std::get_if<Sphere>(&tool.tool.shape);
      const auto* const capsule = std::get_if<Capsule>(&tool.tool.shape);
      const double radius_m = sphere != nullptr    ? sphere->radius_m
                              : capsule != nullptr ? capsule->radius_m
                                                   : 0;
      if (!touches(tool.kind) || radius_m == 0 || radius_m >= edge_m) continue;
      plan_.body.warnings.push_back(
          std::string("the ") + name_of(tool.kind) + " '" + tool.tool.name + "' is thinner (radius " +
          number_text(radius_m * units, 3) + ") than the mesh is fine (its edges are " +
          number_text(edge_m * units, 3) +
          " long at the surface), so that it can slip in between nodes: take a mesh "
          "of more vertices");
    }
  }

  [[nodiscard]] Vector3 size_m(const JsonField& field) const {
    Vector3 size;
    const std::vector<JsonField> sides = field.elements(3);
    std::ranges::transform(sides, size.begin(), [this](const JsonField& side) { return metres(side); });
    return size;
  }

  [[nodiscard]] std::size_t tool_of(const JsonField& field) const {
    const auto found = tool_named_.find(field.text());
    if (found != tool_named_.end()) {
      refuse_left(field, found->first, found->second);
      return found->second;
    }
    std::string all;
    for (const PlanTool& tool : plan_.tools) all += (all.empty() ? "" : ", ") + tool.tool.name;
    field.fail("is '" + field.text() + "', which 'tools' does not have" +
               (all.empty() ? "" : "; it has " + all));
  }

  void refuse_left(const JsonField& field, const std::string& name, std::size_t tool) const {
    if (state_[tool].left.empty()) return;
    field.fail("is '" + name + "', a clip that was left at the organ in " + state_[tool].left +
               ": a clip is used once; give the plan another");
  }

  /// "position" and "rotation"; what is absent stays as it was.
  [[nodiscard]] Pose pose_of(const JsonField& field, const std::optional<Pose>& before) const {
    Pose pose = before.value_or(Pose());
    if (const auto position = field.optional_member("position")) {
      pose.position_m = place_m(*position);
    } else if (!before) {
      field.fail("has no 'position', and the tool has none yet");
    }
    if (const auto rotation = field.optional_member("rotation")) {
      rotation->expect_object({"axis", "degrees"});
      const JsonField axis = rotation->member("axis");
      const Vector3 direction = axis.vector();
      if (!(direction.norm() > 0)) axis.fail("has no direction");
      pose.orientation = orientation_of({direction, rotation->member("degrees").number()});
    }
    return pose;
  }

  /// Key frames; where the tool is not at the organ yet, the first is at 0 s and places it.
  [[nodiscard]] ToolPath path_of(const JsonField& field, const std::optional<Pose>& now) const {
    std::vector<KeyFrame> frames;
    std::optional<Pose> pose = now;
    if (now) frames.push_back({0, *now});
    for (const JsonField& frame : field.elements()) {
      frame.expect_object({"at_s", "position", "rotation"});
      const double at_s = within(frame.member("at_s"), 0, kLongestStepS);
      if (frames.empty() && at_s != 0) {
        frame.member("at_s").fail("is " + number_text(at_s) +
                                  ": the tool is not at the organ yet, so that its first pose is at 0");
      }
      if (!frames.empty() && !(at_s > frames.back().at_s)) {
        frame.member("at_s").fail("is " + number_text(at_s) + ", not after the pose before it (" +
                                  number_text(frames.back().at_s) + " s)");
      }
      pose = pose_of(frame, pose);
      frames.push_back({at_s, *pose});
    }
    if (frames.size() < 2) field.fail("goes nowhere: give a pose to move to");
    return ToolPath(std::move(frames));
  }

  /// "tool" and "path", or "tools": a path for each.
  std::vector<PlanMotion> motions_of(const JsonField& step) {
    if (step.has("tool") == step.has("tools"))
      step.fail("must have either 'tool' and 'path', or 'tools' with a path for each");
    std::vector<PlanMotion> motions;
    if (step.has("tool")) {
      const std::size_t tool = tool_of(step.member("tool"));
      motions.push_back({tool, path_of(step.member("path"), state_[tool].pose)});
    } else {
      for (const auto& [name, path] : step.member("tools").members()) {
        const auto found = tool_named_.find(name);
        if (found == tool_named_.end()) path.fail("is for a tool that 'tools' does not have");
        refuse_left(path, name, found->second);
        motions.push_back({found->second, path_of(path, state_[found->second].pose)});
      }
      if (motions.empty()) step.member("tools").fail("names no tool");
    }
    return motions;
  }

  void read_step(const JsonField& field) {
    PlanStep step;
    step.where = field.path();
    step.action = word_of(field.member("do"), kActions);
    if (const auto name = field.optional_member("name")) {
      step.name = name->text();
      if (step.name.empty()) name->fail("is empty: leave it out, or give the step a name");
    }
    switch (step.action) {
      case PlanAction::kGrasp:
        field.expect_object({"do", "name", "tool", "at"});
        read_grasp(field, step);
        break;
      case PlanAction::kClose:
        field.expect_object({"do", "name", "tool", "at", "opening", "duration_s"});
        read_close(field, step);
        break;
      case PlanAction::kRetract:
      case PlanAction::kPress:
        field.expect_object({"do", "name", "tool", "path", "tools"});
        step.motions = motions_of(field);
        check_motions(field, step);
        break;
      case PlanAction::kCut:
        field.expect_object({"do", "name", "tool", "path", "curve"});
        read_cut(field, step);
        break;
      case PlanAction::kHold:
        field.expect_object({"do", "name", "duration_s"});
        step.duration_s = within(field.member("duration_s"), kShortestTimeStepS, kLongestStepS);
        break;
      case PlanAction::kRelease: {
        field.expect_object({"do", "name", "tool"});
        const JsonField named = field.member("tool");
        const std::size_t tool = tool_of(named);
        if (!state_[tool].pose) named.fail("is '" + named.text() + "', which is not at the organ");
        step.released.push_back(tool);
        state_[tool] = {};
        if (stays(plan_.tools[tool].kind)) state_[tool].left = step.where;
        break;
      }
    }
    for (const PlanMotion& motion : step.motions) {
      step.duration_s = std::max(step.duration_s, motion.path.duration_s());
      if (step.action == PlanAction::kCut) continue;  // a scalpel leaves the organ after its cut
      state_[motion.tool].pose = motion.path.frames().back().pose;
      if (state_[motion.tool].since.empty()) state_[motion.tool].since = step.where;
    }
    plan_.steps.push_back(std::move(step));
  }

  void read_grasp(const JsonField& field, PlanStep& step) {
    const JsonField named = field.member("tool");
    const std::size_t tool = tool_of(named);
    if (!binds(plan_.tools[tool].kind)) {
      named.fail("is '" + named.text() + "', a " + name_of(plan_.tools[tool].kind) +
                 ": only forceps and pins grasp; others are moved by press or retract");
    }
    if (state_[tool].pose)
      named.fail("is '" + named.text() + "', which holds since " + state_[tool].since + ": release it first");
    const JsonField at = field.member("at");
    at.expect_object({"position", "rotation"});
    step.motions.push_back({tool, ToolPath({{0, pose_of(at, std::nullopt)}})});
  }

  void read_close(const JsonField& field, PlanStep& step) {
    const JsonField named = field.member("tool");
    const std::size_t number = tool_of(named);
    const PlanTool& tool = plan_.tools[number];
    ToolState& state = state_[number];
    if (!closes(tool.kind))
      named.fail("is '" + named.text() + "', a " + name_of(tool.kind) +
                 ": only graspers and clips have jaws to close");
    const auto at = field.optional_member("at");
    if (state.pose && at) {
      at->fail("places '" + named.text() + "', which is at the organ since " + state.since +
               ": leave it out, so that it closes where it is");
    }
    if (!state.pose) {
      const JsonField place = field.member("at");
      place.expect_object({"position", "rotation"});
      step.motions.push_back({number, ToolPath({{0, pose_of(place, std::nullopt)}})});
      state.opening_m = tool.opening_m;
    } else {
      step.motions.push_back({number, ToolPath({{0, *state.pose}})});
    }
    step.duration_s = within(field.member("duration_s"), kShortestTimeStepS, kLongestStepS);
    const JsonField opening = field.member("opening");
    step.opening_m = metres(opening);
    const auto* const box = std::get_if<Box>(&tool.tool.shape);
    if (box == nullptr) return;  // what is wrong with the tool has been told
    const double units = units_per_metre(plan_.body.unit);
    if (step.opening_m > tool.opening_m) {
      opening.fail("is " + number_text(step.opening_m * units) + ": '" + named.text() + "' opens to " +
                   number_text(tool.opening_m * units) + " at most");
    }
    // A jaw that went further in a time step could leap over the tissue.
    const double steps = std::max(1.0, step.duration_s / plan_.time_step_s);
    const double each_m = std::abs(step.opening_m - state.opening_m) / 2 / steps;
    if (each_m > box->half_extent_m.z()) {
      field.fail("moves each jaw by " + number_text(each_m * units, 3) +
                 " in a time step, more than half of its thickness (" +
                 number_text(box->half_extent_m.z() * units, 3) + "): give it a longer duration_s");
    }
    state.opening_m = step.opening_m;
  }

  void check_motions(const JsonField& field, const PlanStep& step) const {
    for (const PlanMotion& motion : step.motions) {
      const PlanTool& tool = plan_.tools[motion.tool];
      const std::string named = "moves '" + tool.tool.name + "', a " + name_of(tool.kind);
      if (tool.kind == ToolKind::kScalpel) field.fail(named + ": a scalpel is moved by cut");
      if (!binds(tool.kind) && !closes(tool.kind)) continue;
      if (step.action == PlanAction::kPress)
        field.fail(named + ": it is moved by retract; press is for tools that touch");
      if (!state_[motion.tool].pose)
        field.fail(named + " that holds nothing: " + (closes(tool.kind) ? "close" : "grasp") + " first");
    }
  }

  void read_cut(const JsonField& field, PlanStep& step) {
    const JsonField named = field.member("tool");
    const std::size_t tool = tool_of(named);
    if (plan_.tools[tool].kind != ToolKind::kScalpel) {
      named.fail("is '" + named.text() + "', a " + name_of(plan_.tools[tool].kind) + ": only a scalpel cuts");
    }
    if (field.has("path") == field.has("curve"))
      field.fail("must have either 'path', where the scalpel goes, or 'curve', drawn on the organ at rest");
    if (field.has("path")) {
      step.motions.push_back({tool, path_of(field.member("path"), std::nullopt)});
      return;
    }
    const JsonField drawn = field.member("curve");
    step.curve = curve_of(drawn);
    try {
      step.motions.push_back(cut_along(plan_, tool, *step.curve));
    } catch (const Error& error) {
      drawn.fail(std::string("cannot be cut: ") + error.what());
    }
  }

  [[nodiscard]] CutCurve curve_of(const JsonField& field) const {
    field.expect_object({"through", "shape", "depth", "direction"});
    CutCurve curve;
    for (const JsonField& handle : field.member("through").elements())
      curve.handles_m.push_back(place_m(handle));
    if (const auto shape = field.optional_member("shape")) curve.smooth = word_of(*shape, kCurveShapes);
    const JsonField depth = field.member("depth");
    if (depth.is_array()) {
      for (const JsonField& one : depth.elements()) curve.depth_m.push_back(metres(one));
    } else {
      curve.depth_m.push_back(metres(depth));
    }
    if (const auto direction = field.optional_member("direction")) curve.direction = direction->vector();
    return curve;
  }

  std::vector<std::string>& errors_;
  Plan plan_;
  std::map<std::string, std::size_t> tool_named_;
  std::vector<ToolState> state_;  // of each tool
};

}  // namespace

const char* name_of(ToolKind kind) { return word_for(kind, kKinds); }
const char* name_of(PlanAction action) { return word_for(action, kActions); }
bool binds(ToolKind kind) { return kind == ToolKind::kForceps || kind == ToolKind::kPin; }
bool closes(ToolKind kind) { return kind == ToolKind::kGrasper || stays(kind); }
bool stays(ToolKind kind) { return kind == ToolKind::kClip; }
bool touches(ToolKind kind) { return !binds(kind) && !closes(kind) && kind != ToolKind::kScalpel; }

Pose pose_of_blade(const BladePose& blade) {
  return {blade.tip, Eigen::Quaterniond::FromTwoVectors(Vector3::UnitZ(), blade.heel - blade.tip)};
}

PlanMotion cut_along(const Plan& plan, std::size_t scalpel, const CutCurve& curve) {
  const PlanTool& tool = plan.tools.at(scalpel);
  if (tool.kind != ToolKind::kScalpel)
    throw Error("'" + tool.tool.name + "' does not cut: only a scalpel does");
  std::vector<KeyFrame> frames;
  for (const BladePose& blade :
       blade_along(curve, plan.body.mesh, tool.edge_m, mean_surface_edge_m(plan.body.mesh))) {
    const double at_s = written_time(plan.time_step_s * static_cast<double>(frames.size()));
    frames.push_back({at_s, pose_of_blade(blade)});
  }
  return {scalpel, ToolPath(std::move(frames))};
}

std::string title_of(const Plan& plan, const PlanStep& step) {
  if (!step.name.empty()) return step.name;
  std::string tools;
  const auto add = [&](std::size_t tool) {
    tools += (tools.empty() ? " " : ", ") + plan.tools[tool].tool.name;
  };
  for (const PlanMotion& motion : step.motions) add(motion.tool);
  for (const std::size_t tool : step.released) add(tool);
  return name_of(step.action) + tools;
}

double begins_s(const Plan& plan, std::size_t step) {
  double sum = 0;
  for (std::size_t i = 0; i < step; ++i) sum += plan.steps[i].duration_s;
  return sum;
}

double mean_surface_edge_m(const TetMesh& mesh) {
  double sum_m = 0;
  std::size_t edges = 0;
  for (const Face& face : faces_of(mesh).surface) {
    for (std::size_t i = 0; i < 3; ++i) {
      sum_m += (mesh.nodes[face.nodes[(i + 1) % 3]] - mesh.nodes[face.nodes[i]]).norm();
      ++edges;
    }
  }
  return edges == 0 ? 0 : sum_m / static_cast<double>(edges);
}

PlanReading read_plan(const std::filesystem::path& file, const MeshMaker& maker) {
  return read_plan_text(read_document(file), file, maker);
}

PlanReading read_plan_text(const std::string& text, const std::filesystem::path& file,
                           const MeshMaker& maker) {
  PlanReading reading;
  try {
    const nlohmann::json document = JsonField::parse(text, file.string());
    PlanReader reader(JsonField(document, file.string()), file.parent_path(), maker, reading.errors);
    if (reading.errors.empty()) reading.plan = reader.take();
  } catch (const Error& error) {
    reading.errors.emplace_back(error.what());
  }
  return reading;
}

}  // namespace kiroku::sim

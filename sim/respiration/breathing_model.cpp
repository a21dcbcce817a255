#include "sim/respiration/breathing_model.h"

#include <array>
#include <cmath>
#include <utility>

#include <nlohmann/json.hpp>

#include "base/error.h"
#include "base/number_text.h"
#include "sim/model/body_model.h"
#include "sim/volume/volume_reader.h"

namespace kiroku::sim {
namespace {

namespace fs = std::filesystem;

constexpr double kSecondsPerMinute = 60;
constexpr std::int64_t kMostPhases = 10000;

double within(const JsonField& field, double least, double most) {
  const double number = field.number();
  if (!(number >= least && number <= most)) {
    field.fail("is " + number_text(number) + ": it must be from " + number_text(least) + " to " +
               number_text(most));
  }
  return number;
}

Vector3 direction_of(const JsonField& field) {
  const Vector3 direction = field.vector();
  if (!(direction.norm() > 0)) field.fail("is (0, 0, 0), which is no direction");
  return direction.normalized();
}

class BreathingReader {
 public:
  /// `materials_given`: whether the document says what a tumour region is of.
  BreathingReader(const JsonField& document, const fs::path& folder, bool materials_given)
      : folder_(folder), body_(document, folder) {
    if (const auto name = document.optional_member("name")) model_.name = name->text();
    model_.unit = body_.model().unit;
    units_ = units_per_metre(model_.unit);
    model_.mesh = body_.model().mesh;
    model_.materials = body_.model().materials;
    model_.warnings = body_.model().warnings;
    if (const auto tumour = document.optional_member("tumour")) read_tumour(*tumour, materials_given);
    read_groups(document);
    if (const auto slide = document.optional_member("slide")) model_.slide = direction_of(*slide);
    if (const auto breathing = document.optional_member("breathing")) read_breathing(*breathing);
    if (const auto phases = document.optional_member("phases")) {
      const std::int64_t count = phases->integer();
      if (count < 2 || count > kMostPhases)
        phases->fail("is " + std::to_string(count) + ": it must be from 2 to " + std::to_string(kMostPhases));
      model_.phases = static_cast<std::size_t>(count);
    }
  }
  BreathingModel take() { return std::move(model_); }

 private:
  void read_tumour(const JsonField& field, bool materials_given) {
    field.expect_object({"region", "ball"});
    if (field.has("region") == field.has("ball")) field.fail("must have either 'region' or 'ball'");
    try {
      if (field.has("region")) {
        const JsonField named = field.member("region");
        const auto region = static_cast<std::int32_t>(named.integer());
        if (region != named.integer()) named.fail("is no number of a region");
        model_.tumour = tumour_of_region(model_.mesh, region);
        if (!materials_given) model_.materials[region] = kTumourTissue;
        return;
      }
      const JsonField ball = field.member("ball");
      ball.expect_object({"center", "radius"});
      model_.tumour = tumour_in_ball(model_.mesh, ball.member("center").vector() / units_,
                                     within(ball.member("radius"), 0, units_) / units_);
    } catch (const Error& error) {
      if (std::string(error.what()).starts_with("cannot use")) throw;
      field.fail(std::string("cannot be found: ") + error.what());
    }
    // Harder than the lung around it, whatever that is of.
    const std::int32_t region = regions_of(model_.mesh).back() + 1;
    for (const std::uint32_t t : model_.tumour->tetrahedra) model_.mesh.regions[t] = region;
    model_.materials[region] = kTumourTissue;
  }

  void read_groups(const JsonField& document) {
    GroupRules rules;
    if (const auto lung = document.optional_member("lung")) {
      const std::string side = lung->text();
      if (side != "left" && side != "right")
        lung->fail("is '" + side + "': it must be \"left\" or \"right\"");
      rules.side = side == "left" ? LungSide::kLeft : LungSide::kRight;
    }
    const LungSurface surface = surface_of(model_.mesh);
    std::optional<LabelMap> labels;
    if (const auto file = document.optional_member("labels")) {
      if (file->text().empty()) file->fail("names no file");
      labels = read_label_map(folder_ / file->text());
    }
    model_.groups = find_boundary_groups(model_.mesh, surface, labels ? &*labels : nullptr, rules);
    if (const auto changes = document.optional_member("groups")) {
      for (const JsonField& entry : changes->elements()) change_group(entry, surface);
    }
    for (const BoundaryGroup group : {BoundaryGroup::kTrachea, BoundaryGroup::kBack}) {
      if (counts_of(model_.groups)[static_cast<std::size_t>(group)] > 0) continue;
      model_.warnings.push_back(std::string("no node is of the group ") + name_of(group) +
                                "; give some in 'groups' if the lung has one");
    }
  }

  void change_group(const JsonField& entry, const LungSurface& surface) {
    entry.expect_object({"group", "nodes", "box"});
    const JsonField named = entry.member("group");
    const auto group = boundary_group_named(named.text());
    if (!group) {
      named.fail("is '" + named.text() + "': it must be one of free, rib_cage, diaphragm, trachea, back");
    }
    std::size_t changed = 0;
    for (const std::size_t node : body_.selected(entry)) {
      if (surface.row_of[node] < 0) {
        if (entry.has("nodes"))
          entry.member("nodes").fail("names node " + std::to_string(node) + ", which is inside");
        continue;
      }
      model_.groups[node] = *group;
      ++changed;
    }
    if (changed == 0) entry.member("box").fail("holds no node of the surface, only such that are inside");
  }

  void read_breathing(const JsonField& field) {
    field.expect_object({"cycle_s", "trace", "breaths", "rib_cage", "diaphragm"});
    if (int{field.has("cycle_s")} + int{field.has("trace")} + int{field.has("breaths")} > 1)
      field.fail("must have only one of 'cycle_s', 'trace' and 'breaths'");
    if (const auto cycle = field.optional_member("cycle_s")) {
      model_.waveform =
          Waveform(SineWave{within(*cycle, 2 * Waveform::kShortestBreathS, Waveform::kLongestS)});
    }
    if (const auto trace = field.optional_member("trace")) {
      if (trace->text().empty()) trace->fail("names no file");
      const fs::path file = folder_ / trace->text();
      model_.waveform = Waveform(parse_breathing_trace(read_document(file), file.string()));
    }
    if (const auto list = field.optional_member("breaths")) {
      std::vector<Breath> breaths;
      for (const JsonField& entry : list->elements()) {
        entry.expect_object({"duration_s", "depth", "baseline"});
        Breath breath{
            within(entry.member("duration_s"), 2 * Waveform::kShortestBreathS, Waveform::kLongestS)};
        if (const auto depth = entry.optional_member("depth")) breath.depth = depth->number();
        if (const auto baseline = entry.optional_member("baseline")) breath.baseline = baseline->number();
        breaths.push_back(breath);
      }
      if (breaths.empty()) list->fail("holds no breath");
      model_.waveform = Waveform(std::move(breaths));
    }
    if (const auto group = field.optional_member("rib_cage")) read_motion(*group, model_.motion.rib_cage);
    if (const auto group = field.optional_member("diaphragm")) read_motion(*group, model_.motion.diaphragm);
  }

  void read_motion(const JsonField& field, GroupMotion& motion) {
    field.expect_object({"amplitude", "phase_s", "direction", "baseline", "drift_per_min"});
    const double most = kLargestAmplitudeM * units_;
    if (const auto baseline = field.optional_member("baseline"))
      motion.baseline_m = within(*baseline, -most, most) / units_;
    if (const auto drift = field.optional_member("drift_per_min"))
      motion.drift_m_per_s = within(*drift, -most, most) / units_ / kSecondsPerMinute;
    if (const auto amplitude = field.optional_member("amplitude"))
      motion.amplitude_m = within(*amplitude, -most, most) / units_;
    if (const auto phase = field.optional_member("phase_s"))
      motion.phase_s = within(*phase, -kLongestPhaseS, kLongestPhaseS);
    if (const auto direction = field.optional_member("direction")) {
      if (direction->is_text()) {
        if (direction->text() != "normal")
          direction->fail("is '" + direction->text() + "': it must be \"normal\" or [x, y, z]");
        motion.direction.reset();
      } else {
        motion.direction = direction_of(*direction);
      }
    }
  }

  fs::path folder_;
  BodyReader body_;
  BreathingModel model_;
  double units_ = 1;
};

/// The places in a document that was read that name files.
std::vector<nlohmann::ordered_json*> names_of_files(nlohmann::ordered_json& document) {
  std::vector<nlohmann::ordered_json*> names;
  for (const char* const pointer : {"/mesh", "/labels", "/breathing/trace"}) {
    const nlohmann::ordered_json::json_pointer place(pointer);
    if (document.contains(place)) names.push_back(&document.at(place));
  }
  return names;
}

nlohmann::ordered_json motion_json(const GroupMotion& motion, double units) {
  nlohmann::ordered_json object{{"amplitude", motion.amplitude_m * units}, {"phase_s", motion.phase_s}};
  if (motion.direction) {
    object["direction"] = {motion.direction->x(), motion.direction->y(), motion.direction->z()};
  } else {
    object["direction"] = "normal";
  }
  if (motion.baseline_m != 0) object["baseline"] = motion.baseline_m * units;
  if (motion.drift_m_per_s != 0) object["drift_per_min"] = motion.drift_m_per_s * units * kSecondsPerMinute;
  return object;
}

/// What 'groups' must say beyond what it says, after which the model's are these.
nlohmann::ordered_json changes_of_groups(const BoundaryGroups& from, const BoundaryGroups& to) {
  std::array<std::vector<std::size_t>, kBoundaryGroups> nodes;
  for (std::size_t node = 0; node < from.size(); ++node) {
    if (from[node] != to[node]) nodes[static_cast<std::size_t>(to[node])].push_back(node);
  }
  nlohmann::ordered_json changes = nlohmann::ordered_json::array();
  for (std::size_t group = 1; group < nodes.size(); ++group) {
    if (!nodes[group].empty())
      changes.push_back({{"group", name_of(static_cast<BoundaryGroup>(group))}, {"nodes", nodes[group]}});
  }
  return changes;
}

}  // namespace

const Tumour& BreathingModel::needed_tumour() const {
  if (tumour) return *tumour;
  throw Error(
      "the model has no tumour: give \"tumour\": {\"region\": N} for a region of the mesh, or \"tumour\": "
      "{\"ball\": {\"center\": [x, y, z], \"radius\": r}}");
}

std::vector<double> phase_times_s(const Waveform& waveform, std::size_t phases) {
  // A sine's end is its beginning; of other waveforms both ends are shown.
  const double steps = static_cast<double>(waveform.periodic() ? phases : phases - 1);
  std::vector<double> times_s;
  times_s.reserve(phases);
  for (std::size_t i = 0; i < phases; ++i)
    times_s.push_back(waveform.begins_s() + waveform.duration_s() * static_cast<double>(i) / steps);
  return times_s;
}

BreathingModel read_breathing_model(const fs::path& file) {
  std::string text = read_document(file);
  nlohmann::json document = JsonField::parse(text, file.string());
  const JsonField root(document, file.string());
  root.expect_object({"name", "mesh", "length_unit", "materials", "tumour", "labels", "lung", "groups",
                      "slide", "breathing", "phases"});
  const bool materials_given = root.has("materials");
  if (!materials_given) {
    // All is lung, until the tumour is known.
    document["materials"] = {{{"region", "all"},
                              {"young_modulus_pa", kLungTissue.young_modulus_pa},
                              {"poisson_ratio", kLungTissue.poisson_ratio},
                              {"density_kg_m3", kLungTissue.density_kg_m3}}};
  }
  BreathingModel model = BreathingReader(root, file.parent_path(), materials_given).take();
  model.document = std::move(text);
  return model;
}

std::vector<fs::path> files_of(const BreathingModel& model, const fs::path& file) {
  nlohmann::ordered_json document = nlohmann::ordered_json::parse(model.document);
  std::vector<fs::path> files;
  for (const nlohmann::ordered_json* name : names_of_files(document))
    files.push_back(file.parent_path() / name->get<std::string>());
  return files;
}

std::string with_motion(const BreathingModel& model, const fs::path& file, const BreathingMotion& motion,
                        const fs::path& folder, std::optional<double> cycle_s,
                        const std::optional<BoundaryGroups>& groups) {
  nlohmann::ordered_json document = nlohmann::ordered_json::parse(model.document);
  const double units = document.at("length_unit") == "m" ? 1 : units_per_metre(LengthUnit::kMillimetre);
  for (nlohmann::ordered_json* name : names_of_files(document)) {
    const fs::path named = file.parent_path() / name->get<std::string>();
    *name = fs::proximate(fs::absolute(named), fs::absolute(folder)).string();
  }
  if (!document.contains("breathing")) document["breathing"] = nlohmann::ordered_json::object();
  nlohmann::ordered_json& breathing = document["breathing"];
  if (cycle_s) breathing["cycle_s"] = *cycle_s;
  breathing["rib_cage"] = motion_json(motion.rib_cage, units);
  breathing["diaphragm"] = motion_json(motion.diaphragm, units);
  if (groups) {
    // After what is said already: later entries count.
    for (nlohmann::ordered_json& change : changes_of_groups(model.groups, *groups))
      document["groups"].push_back(std::move(change));
  }
  constexpr int kIndent = 1;
  return document.dump(kIndent) + "\n";
}

}  // namespace kiroku::sim

#include "viewer/planning/plan_folder.h"

#include <algorithm>
#include <cerrno>
#include <sys/stat.h>

#include "base/error.h"
#include "base/foreign_json.h"
#include "base/joined.h"
#include "sim/meshing/mesh_recipe.h"
#include "sim/model/body_model.h"
#include "sim/plan/plan_document.h"
#include "sim/volume/volume_reader.h"
#include "timestamp/small_files.h"
#include "viewer/http/disk_room.h"
#include "viewer/http/new_file_name.h"
#include "viewer/http/request.h"

namespace kiroku::viewer {
namespace {

namespace fs = std::filesystem;
using nlohmann::ordered_json;

/// Plans are texts of a person; what is larger is something else.
constexpr std::uintmax_t kLargestDocument = 16U << 20;

/// A plan's document, or null for anything else.
ordered_json document_at(const fs::path& file) {
  std::error_code failed;
  if (fs::file_size(file, failed) > kLargestDocument || failed) return nullptr;
  try {
    ordered_json document = parse_foreign_json<ordered_json>(sim::read_document(file));
    const bool is_plan = document.is_object() && document.contains("mesh") && document.contains("tools") &&
                         document.contains("steps") && document["tools"].is_object() &&
                         document["steps"].is_array();
    return is_plan ? document : nullptr;
  } catch (const IoError&) {  // gone, or not for us: then it is not listed
    return nullptr;
  }
}

sim::Plan read(const ordered_json& document, const fs::path& file, const sim::MeshMaker& maker) {
  sim::PlanReading reading = sim::read_plan_text(document.dump(), file, maker);
  if (!reading.plan) throw Refusal(422, joined(reading.errors, "; "));
  return std::move(*reading.plan);
}

/// Of a CT in a folder of several series the one that the mesh is made of.
sim::VolumeOptions reading_of(const ordered_json& document) {
  sim::VolumeOptions options;
  const ordered_json& mesh = document["mesh"];
  if (mesh.is_object()) {
    options.series = mesh.value("series", "");
    options.resample = mesh.value("resample", false);
  }
  return options;
}

/// Gives out the mesh that was made already.
sim::MeshMaker maker_of(const sim::TetMesh& mesh) {
  return [&mesh](const sim::JsonField&, const sim::JsonField&, const fs::path&, std::vector<std::string>&) {
    return mesh;
  };
}

}  // namespace

PlanFolder::PlanFolder(fs::path folder) : folder_(std::move(folder)) {
  std::error_code failed;
  if (!fs::is_directory(folder_, failed))
    throw UsageError("there is no folder " + folder_.string() +
                     " with plans: make it and put a plan into it with its CT, or name another with --plans");
}

std::vector<PlanFolder::Listed> PlanFolder::plans() const {
  std::vector<fs::path> files;
  const auto look_into = [&](const fs::path& folder, auto&& folder_found) {
    std::error_code failed;
    for (fs::directory_iterator at(folder, failed), end; !failed && at != end; at.increment(failed)) {
      std::error_code ignored;
      if (at->is_directory(ignored)) {
        folder_found(at->path());
      } else if (at->is_regular_file(ignored) && at->path().extension() == ".json") {
        files.push_back(at->path());
      }
    }
  };
  look_into(folder_, [&](const fs::path& below) { look_into(below, [](const fs::path&) {}); });
  std::vector<Listed> plans;
  for (const fs::path& file : files) {
    const ordered_json document = document_at(file);
    if (document.is_null()) continue;
    Listed& plan = plans.emplace_back();
    plan.file = file.lexically_relative(folder_).generic_string();
    if (const auto name = document.find("name"); name != document.end() && name->is_string())
      plan.name = name->get<std::string>();
    plan.steps = document["steps"].size();
    plan.has_volume = document.contains("volume");
  }
  std::ranges::sort(plans, {}, &Listed::file);
  return plans;
}

fs::path PlanFolder::path_among(const std::vector<Listed>& all, const std::string& file) const {
  // Nothing but what is listed, so that no name leads elsewhere.
  if (std::ranges::find(all, file, &Listed::file) == all.end())
    throw Refusal(404, "there is no plan of that name here");
  return folder_ / file;
}

OpenedPlan PlanFolder::open(const std::string& file,
                            const std::function<void(const std::string& step)>& step) const {
  const fs::path path = path_among(plans(), file);
  OpenedPlan opened;
  opened.file = file;
  opened.own = document_at(path);
  if (opened.own.is_null()) throw Refusal(404, "there is no plan of that name here");
  step("reading the plan");
  const sim::Plan own = read(opened.own, path, sim::recipe_mesh_maker(step));
  if (own.volume.empty())
    throw Refusal(422, "this plan names no CT that could be shown: give its \"volume\" a file or folder");
  opened.tooled = sim::with_tools(opened.own, own);
  opened.plan = read(opened.tooled, path, maker_of(own.body.mesh));
  step("reading the CT");
  const sim::Volume volume = sim::read_volume(own.volume, reading_of(opened.own)).volume;
  opened.volume =
      std::make_shared<const sim::ShadedVolume>(sim::shade(volume, sim::extent_of(own.body.mesh)));
  return opened;
}

std::string PlanFolder::save(const OpenedPlan& beside, const std::string& name,
                             const ordered_json& document) const {
  check_new_file_name(name, "a plan");
  const std::vector<Listed> all = plans();
  if (all.size() >= kMost)
    throw Refusal(409, "there are " + std::to_string(all.size()) +
                           " plans here, as many as are kept: have some removed");
  const fs::path folder = path_among(all, beside.file).parent_path();
  const fs::path file = folder / (name + ".json");
  const sim::Plan plan = read(document, file, maker_of(beside.plan.body.mesh));
  if (plan.steps.size() != document["steps"].size()) throw Refusal(422, "the plan could not be read back");
  if (std::error_code ignored; fs::exists(file, ignored))
    throw Refusal(409, "there is a plan '" + name + "' already: save it under another name");
  const std::string text = document.dump(1) + "\n";
  if (text.size() > kLargestDocument)
    throw Refusal(422, "this plan has more steps than one that can be opened again: undo some");
  require_disk_room(folder, text.size(), "remove plans that nobody needs");
  constexpr mode_t kMode = 0640;
  timestamp::write_new_file(file, bytes_of(text), kMode);
  return file.lexically_relative(folder_).generic_string();
}

}  // namespace kiroku::viewer

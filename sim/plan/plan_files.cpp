#include "sim/plan/plan_files.h"

#include <algorithm>
#include <array>

#include "base/error.h"
#include "sim/model/body_model.h"
#include "sim/model/json_field.h"

namespace kiroku::sim {
namespace {

namespace fs = std::filesystem;

void add(std::vector<PlanFile>& files, const std::string& role, const fs::path& name, const fs::path& path,
         const DataFileOf& data_file_of) {
  if (!fs::is_directory(path)) {
    files.push_back({role, name.generic_string(), path, ""});
    if (const auto data = data_file_of(path)) {
      files.push_back({role, (name.parent_path() / *data).lexically_normal().generic_string(),
                       path.parent_path() / *data, name.generic_string()});
    }
    return;
  }
  const std::size_t first = files.size();
  for (const auto& entry : fs::recursive_directory_iterator(path)) {
    if (entry.is_regular_file())
      files.push_back({role, (name / fs::relative(entry.path(), path)).generic_string(), entry.path(), ""});
  }
  std::ranges::sort(files.begin() + static_cast<std::ptrdiff_t>(first), files.end(), {}, &PlanFile::name);
}

}  // namespace

PlanKind kind_of_plan(const fs::path& plan) {
  constexpr std::array<const char*, 7> kOfLungs{"breathing", "tumour", "lung",  "labels",
                                                "groups",    "slide",  "phases"};
  try {
    const nlohmann::json document = JsonField::parse(read_document(plan), plan.string());
    const bool is_lung =
        document.is_object() && !document.contains("steps") &&
        std::ranges::any_of(kOfLungs, [&](const char* key) { return document.contains(key); });
    return is_lung ? PlanKind::kBreathing : PlanKind::kSteps;
  } catch (const Error&) {
    return PlanKind::kSteps;
  }
}

std::vector<PlanFile> files_of_plan(const fs::path& plan, const DataFileOf& data_file_of) {
  const nlohmann::json document = JsonField::parse(read_document(plan), plan.string());
  const JsonField field(document, plan.string());
  const fs::path folder = plan.parent_path();
  std::vector<PlanFile> files{{"plan", plan.filename().generic_string(), plan, ""}};
  const auto take = [&](const char* role, const JsonField& named) {
    add(files, role, fs::path(named.text()).lexically_normal(), named.existing_path(folder), data_file_of);
  };
  const JsonField mesh = field.member("mesh");
  if (mesh.is_object()) {
    for (const char* const key : {"labels", "contours"}) {
      if (const auto named = mesh.optional_member(key)) take(key, *named);
    }
  } else {
    take("mesh", mesh);
  }
  if (const auto volume = field.optional_member("volume")) take("volume", *volume);
  if (const auto labels = field.optional_member("labels")) take("labels", *labels);
  if (const auto breathing = field.optional_member("breathing"); breathing && breathing->is_object()) {
    if (const auto trace = breathing->optional_member("trace")) take("trace", *trace);
  }
  return files;
}

std::vector<PlanFile> files_of_volume(const fs::path& volume, const DataFileOf& data_file_of) {
  std::vector<PlanFile> files;
  // "ct/" has no name of its own.
  const fs::path named = volume.has_filename() ? volume : volume.parent_path();
  add(files, "volume", named.filename(), volume, data_file_of);
  return files;
}

}  // namespace kiroku::sim

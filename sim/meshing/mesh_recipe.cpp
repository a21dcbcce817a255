#include "sim/meshing/mesh_recipe.h"

#include <utility>

#include "base/error.h"
#include "sim/meshing/lung_mask.h"

namespace kiroku::sim {
namespace {

using Step = std::function<void(const std::string&)>;

void check(const MeshRecipe& recipe) {
  if (!recipe.threshold && !recipe.labels && recipe.organ == "lung" && recipe.regions.empty()) return;
  if (recipe.threshold.has_value() == recipe.labels.has_value()) {
    throw UsageError(
        "it is not said what of the volume to mesh: by a threshold or by labels, one of them; only the organ "
        "'lung' is found without");
  }
  if (!recipe.labels && (recipe.organ || !recipe.regions.empty()))
    throw UsageError("an organ and regions are chosen among labels: give the labels too");
}

BodyRegions body_of(const MeshRecipe& recipe, const VolumeFile& file, const Step& step,
                    std::vector<std::string>& findings) {
  BodyRegions body;
  if (recipe.threshold) {
    body = regions_of_threshold(file.volume, *recipe.threshold);
  } else if (!recipe.labels) {
    step("finding the lungs");
    body.map = find_lungs(file.volume).map;
    body.add("lung");
  } else {
    step("reading " + recipe.labels->string());
    LabelMap labels = read_label_map(*recipe.labels, &findings);
    if (!same_places(labels.grid, file.volume.grid)) labels = resampled(labels, file.volume.grid);
    std::vector<RegionLabels> regions;
    if (recipe.organ) {
      const Organ& organ = organ_named(*recipe.organ);
      regions.push_back({std::string(organ.name), {organ.labels}});
    }
    regions.insert(regions.end(), recipe.regions.begin(), recipe.regions.end());
    body = regions_of_labels(std::move(labels), regions);
  }
  if (recipe.contours) add_contours(body, read_contours(*recipe.contours), file);
  return body;
}

std::size_t count_of(const JsonField& field, std::size_t most) {
  const std::int64_t count = field.integer();
  if (count < 1 || std::cmp_greater(count, most))
    field.fail("is " + std::to_string(count) + ": it must be from 1 to " + std::to_string(most));
  return static_cast<std::size_t>(count);
}

std::uint16_t label_of(const JsonField& field) {
  constexpr std::int64_t kMostLabel = 65535;
  const std::int64_t label = field.integer();
  if (label < 1 || label > kMostLabel)
    field.fail("is " + std::to_string(label) + ": labels are from 1 to 65535");
  return static_cast<std::uint16_t>(label);
}

MeshRecipe recipe_of(const JsonField& field, const JsonField& document, const std::filesystem::path& folder) {
  field.expect_object(
      {"organ", "labels", "regions", "contours", "threshold", "vertices", "pieces", "series", "resample"});
  MeshRecipe recipe;
  const auto volume = document.optional_member("volume");
  if (!volume) field.fail("is a recipe, for which the document must name the 'volume'");
  recipe.volume = volume->existing_path(folder);
  if (const auto series = field.optional_member("series")) recipe.reading.series = series->text();
  if (const auto resample = field.optional_member("resample")) recipe.reading.resample = resample->boolean();
  if (const auto threshold = field.optional_member("threshold")) {
    const std::vector<JsonField> ends = threshold->elements(2);
    recipe.threshold = HuInterval{ends[0].number(), ends[1].number()};
    if (recipe.threshold->least > recipe.threshold->greatest) threshold->fail("begins above its end");
  }
  if (const auto labels = field.optional_member("labels")) recipe.labels = labels->existing_path(folder);
  if (const auto organ = field.optional_member("organ")) {
    recipe.organ = organ->text();
    try {
      organ_named(*recipe.organ);
    } catch (const UsageError& unknown) {
      organ->fail(std::string("is not known: ") + unknown.what());
    }
  }
  if (const auto regions = field.optional_member("regions")) {
    for (const auto& [name, labels] : regions->members()) {
      RegionLabels& region = recipe.regions.emplace_back(RegionLabels{name, {}});
      for (const JsonField& label : labels.elements())
        region.labels.push_back({label_of(label), label_of(label)});
      if (region.labels.empty()) labels.fail("names no label");
    }
  }
  if (const auto contours = field.optional_member("contours"))
    recipe.contours = contours->existing_path(folder);
  if (const auto vertices = field.optional_member("vertices"))
    recipe.nodes = count_of(*vertices, kMostMeshNodes);
  if (const auto pieces = field.optional_member("pieces")) recipe.pieces = count_of(*pieces, kMostMeshNodes);
  try {
    check(recipe);
  } catch (const UsageError& unclear) {
    field.fail(std::string("is no recipe: ") + unclear.what());
  }
  return recipe;
}

}  // namespace

RecipeMesh make_mesh(const MeshRecipe& recipe, const Step& told) {
  check(recipe);
  const Step step = told ? told : [](const std::string&) {};
  MeshRequest wanted;
  if (recipe.organ) wanted.pieces = organ_named(*recipe.organ).pieces;
  wanted.nodes = recipe.nodes.value_or(wanted.nodes);
  wanted.pieces = recipe.pieces.value_or(wanted.pieces);
  RecipeMesh result;
  step("reading " + recipe.volume.string());
  result.volume = read_volume(recipe.volume, recipe.reading);
  result.hu = range_of(result.volume.volume);
  result.findings = result.volume.findings;
  BodyRegions body = body_of(recipe, result.volume, step, result.findings);
  result.volume.volume.hu = {};  // much of the memory
  result.made = make_organ_mesh(body.map, wanted, step);
  result.findings.insert(result.findings.end(), result.made.findings.begin(), result.made.findings.end());
  for (const auto& [region, name] : body.names) {
    if (result.made.quality.regions.contains(region)) continue;
    result.findings.push_back("nothing of the region " + std::to_string(region) + " '" + name +
                              "' is in the mesh");
  }
  result.region_names = std::move(body.names);
  return result;
}

MeshMaker recipe_mesh_maker(const Step& step) {
  return [step](const JsonField& recipe, const JsonField& document, const std::filesystem::path& folder,
                std::vector<std::string>& warnings) {
    RecipeMesh made = make_mesh(recipe_of(recipe, document, folder), step);
    warnings.insert(warnings.end(), made.findings.begin(), made.findings.end());
    return std::move(made.made.mesh);
  };
}

}  // namespace kiroku::sim

#include "viewer/breathing/breathing_bench.h"

#include <algorithm>
#include <sys/stat.h>
#include <utility>

#include "base/error.h"
#include "base/number_text.h"
#include "crypto/file_hash.h"
#include "sim/respiration/series_fit.h"
#include "sim/volume/image_file.h"
#include "timestamp/small_files.h"
#include "viewer/http/disk_room.h"
#include "viewer/http/new_file_name.h"
#include "viewer/http/request.h"

namespace kiroku::viewer {
namespace {

namespace fs = std::filesystem;

std::string pixels_text(std::size_t columns, std::size_t rows) {
  return std::to_string(columns) + " x " + std::to_string(rows);
}

void check_radiographs(const std::vector<BenchRadiograph>& radiographs,
                       const sim::ProjectionGeometry& geometry) {
  std::size_t bytes = 0;
  for (std::size_t i = 0; i < radiographs.size(); ++i) {
    const BenchRadiograph& one = radiographs[i];
    if (one.image.columns != geometry.columns() || one.image.rows != geometry.rows()) {
      throw Error(one.name + " has " + pixels_text(one.image.columns, one.image.rows) +
                  " pixels, the geometry says " + pixels_text(geometry.columns(), geometry.rows()) +
                  ": give the geometry that the radiographs were made with");
    }
    if (i > 0 && !(one.time_s > radiographs[i - 1].time_s))
      throw Error(one.name + " was taken at " + number_text(one.time_s) + " s, not after the one before");
    bytes += one.image.values.size() * sizeof(float);
    BreathingBench::require_memory_for(bytes);
  }
}

}  // namespace

std::vector<NamedFile> files_named_by(const sim::BreathingModel& model, const fs::path& file) {
  std::vector<NamedFile> named;
  const auto name = [&](const fs::path& path) { named.push_back({path, crypto::hash_file(path).sha256}); };
  for (const fs::path& path : sim::files_of(model, file)) {
    name(path);
    if (const auto voxels = sim::data_file_of(path)) name(path.parent_path() / *voxels);
  }
  return named;
}

BreathingBench::BreathingBench(BenchInputs inputs, const std::function<void(const std::string& step)>& step)
    : file_(std::move(inputs.file)),
      model_(std::move(inputs.model)),
      named_(std::move(inputs.named)),
      radiographs_(std::move(inputs.radiographs)),
      start_s_(inputs.start_s),
      recording_(std::move(inputs.recording)) {
  const auto tell = [&](const char* what) {
    if (step) step(what);
  };
  const sim::Tumour& tumour = model_.needed_tumour();
  check_radiographs(radiographs_, inputs.geometry);
  tell("solving for how the lung moves");
  surface_ = sim::surface_of(model_.mesh);
  lung_ = solve(model_.groups);
  tumour_region_ = model_.mesh.regions[tumour.tetrahedra.front()];
  tumour_m_ = sim::centre_of(model_.mesh, tumour).mean(model_.mesh.nodes);
  tell("projecting the CT");
  ct_ = std::make_shared<sim::CtProjector>(inputs.volume, sim::Attenuation(sim::Attenuation::kCtEnergyKev));
  mesh_ = std::make_shared<sim::MeshProjector>(*ct_, model_.mesh);
  if (can_fit()) volume_ = std::move(inputs.volume);
  const std::size_t most = std::min({kFactors, inputs.geometry.columns(), inputs.geometry.rows()});
  for (std::size_t factor = 1; factor <= most; ++factor) {
    sim::ProjectionGeometry geometry = inputs.geometry.binned(factor);
    sim::ProjectionImage still = mesh_->outside(geometry);
    views_.push_back({std::move(geometry), std::move(still)});
  }
  const sim::ProjectionImage at_rest = drr(1, std::vector<sim::Vector3>(nodes(), sim::Vector3::Zero()));
  windows_ = sim::overlay_windows(has_radiographs() ? radiographs_.front().image : at_rest, at_rest);
}

void BreathingBench::require_memory_for(std::size_t radiograph_bytes) {
  if (radiograph_bytes <= kMostRadiographBytes) return;
  throw Error("the radiographs take more than " + std::to_string(kMostRadiographBytes >> 30) +
              " GiB of memory: give a part of the series, or one of fewer pixels");
}

bool BreathingBench::can_fit() const { return radiographs_.size() >= sim::kLeastMoments; }

sim::BoundaryGroups BreathingBench::groups_of(const sim::BoundaryGroups& of_surface) const {
  if (of_surface.size() != surface_.nodes.size()) {
    throw Error("the groups are of a surface of " + std::to_string(of_surface.size()) +
                " nodes, this lung's has " + std::to_string(surface_.nodes.size()) + ": load the page again");
  }
  sim::BoundaryGroups groups = model_.groups;
  for (std::size_t row = 0; row < of_surface.size(); ++row) groups[surface_.nodes[row]] = of_surface[row];
  sim::require_moved(groups);
  return groups;
}

std::shared_ptr<const GroupedLung> BreathingBench::solve(const sim::BoundaryGroups& groups) const {
  const sim::BreathingBody body(model_.mesh, model_.materials, groups, model_.slide);
  sim::MotionResponses responses(body);
  const sim::MotionResponses::Place tumour =
      responses.at(sim::centre_of(model_.mesh, model_.needed_tumour()));
  return std::make_shared<const GroupedLung>(GroupedLung{groups, std::move(responses), tumour});
}

std::shared_ptr<const GroupedLung> BreathingBench::lung_of(const MotionDeed& motion) const {
  if (!motion.surface_groups) return lung_;
  const sim::BoundaryGroups groups = groups_of(*motion.surface_groups);
  return groups == model_.groups ? lung_ : solve(groups);
}

sim::BreathingModel BreathingBench::model_with(const MotionDeed& motion) const {
  sim::BreathingModel model = model_;
  if (motion.surface_groups) model.groups = groups_of(*motion.surface_groups);
  model.motion = motion.motion;
  model.waveform = waveform_of(motion);
  return model;
}

MotionDeed BreathingBench::own_motion() const {
  return {model_.motion,
          model_.waveform.periodic() ? std::optional(model_.waveform.duration_s()) : std::nullopt};
}

sim::Waveform BreathingBench::waveform_of(const MotionDeed& motion) const {
  if (!motion.cycle_s) return model_.waveform;
  if (!model_.waveform.periodic()) {
    throw Error(
        "the waveform of this model has no cycle: it is a trace, or told breath by breath; change it in the "
        "document");
  }
  return sim::Waveform(sim::SineWave{*motion.cycle_s});
}

std::vector<double> BreathingBench::times_s(const sim::Waveform& waveform) const {
  std::vector<double> times_s;
  if (!has_radiographs()) return sim::phase_times_s(waveform, model_.phases);
  for (const BenchRadiograph& one : radiographs_) times_s.push_back(one.time_s);
  return times_s;
}

std::size_t BreathingBench::radiograph_at(double time_s) const {
  const auto after = std::ranges::upper_bound(radiographs_, time_s, {}, &BenchRadiograph::time_s);
  return static_cast<std::size_t>(std::max<std::ptrdiff_t>(after - radiographs_.begin() - 1, 0));
}

const sim::ProjectionGeometry& BreathingBench::geometry(std::size_t factor) const {
  return views_[std::min(factor, views_.size()) - 1].geometry;
}

sim::ProjectionImage BreathingBench::drr(std::size_t factor, const std::vector<sim::Vector3>& moved_m) const {
  const View& view = views_[std::min(factor, views_.size()) - 1];
  sim::ProjectionImage image = mesh_->inside(view.geometry, moved_m);
  sim::add_to(image, view.still);
  return image;
}

std::vector<sim::PixelLine> BreathingBench::outline(std::size_t factor,
                                                    const std::vector<sim::Vector3>& moved_m) const {
  sim::TetMesh mesh = model_.mesh;
  for (std::size_t node = 0; node < moved_m.size(); ++node) mesh.nodes[node] += moved_m[node];
  return sim::outline_of(mesh, tumour_region_, geometry(factor));
}

std::string BreathingBench::save(const std::string& name, const MotionDeed& motion) const {
  check_new_file_name(name, "a model");
  static_cast<void>(waveform_of(motion));
  std::optional<sim::BoundaryGroups> groups;
  if (motion.surface_groups) groups = groups_of(*motion.surface_groups);
  const fs::path folder = fs::absolute(file_).parent_path(), file = folder / (name + ".json");
  if (std::error_code ignored; fs::exists(file, ignored))
    throw Refusal(409, "there is a file '" + name + ".json' already: save it under another name");
  const auto models =
      std::count_if(fs::directory_iterator(folder), fs::directory_iterator(),
                    [](const fs::directory_entry& each) { return each.path().extension() == ".json"; });
  if (static_cast<std::size_t>(models) >= kMostModels) {
    throw Refusal(409, "there are " + std::to_string(kMostModels) +
                           " models beside this one, as many as are kept: have some removed");
  }
  for (const NamedFile& named : named_) {
    if (crypto::hash_file(named.path).sha256 != named.sha256) {
      throw Refusal(409, "'" + named.path.filename().string() +
                             "' has changed since this lung was opened, so that what is shown would not be "
                             "what is saved: start the workbench anew");
    }
  }
  const std::string text = sim::with_motion(model_, file_, motion.motion, folder, motion.cycle_s, groups);
  require_disk_room(folder, text.size(), "remove models that nobody needs");
  constexpr mode_t kMode = 0640;
  timestamp::write_new_file(file, bytes_of(text), kMode);
  return file.filename().string();
}

}  // namespace kiroku::viewer

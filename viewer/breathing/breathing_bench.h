// What everybody at a breathing workbench has in common: the lung and its responses, the CT that shows it,
// and a series of radiographs. Immutable, thread-safe.
#pragma once

#include <filesystem>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "crypto/hash.h"
#include "sim/drr/mesh_projector.h"
#include "sim/drr/overlay.h"
#include "sim/respiration/breathing_model.h"
#include "sim/respiration/breathing_pictures.h"
#include "sim/respiration/motion_responses.h"
#include "viewer/breathing/breathing_deeds.h"

namespace kiroku::viewer {

/// A radiograph, light where much attenuates, `time_s` since the first.
struct BenchRadiograph {
  double time_s = 0;
  sim::ProjectionImage image;
  std::string name;  // for people
};

/// Of which case's fluoroscopy radiographs are.
struct BenchRecording {
  std::string case_id, stream;
  double first_s = 0;  // when the first was taken, since the case began
};

/// A file that a model is made of, as it was when the model was read.
struct NamedFile {
  std::filesystem::path path;
  crypto::Sha256Digest sha256;
};
/// Those that the model's document names. Call it as soon as the model was read: what is exchanged before is
/// not noticed. Throws kiroku::IoError, kiroku::Error for what is no file.
std::vector<NamedFile> files_named_by(const sim::BreathingModel& model, const std::filesystem::path& file);

/// What a bench is made of.
struct BenchInputs {
  std::filesystem::path file;  // the model's
  sim::BreathingModel model;
  std::vector<NamedFile> named;  // files_named_by() of the model
  sim::Volume volume;
  sim::ProjectionGeometry geometry;
  std::vector<BenchRadiograph> radiographs;      // by their times; may be none
  double start_s = 0;                            // the waveform's moment at the first radiograph
  std::optional<BenchRecording> recording = {};  // nothing: they are of no case
};

/// How a lung answers its groups' motion. Immutable, thread-safe.
struct GroupedLung {
  sim::BoundaryGroups groups;  // (|V|)
  sim::MotionResponses responses;
  sim::MotionResponses::Place tumour;  // its centre's
};

class BreathingBench {
 public:
  /// So much memory radiographs may take, as floats.
  static constexpr std::size_t kMostRadiographBytes = std::size_t{2} << 30;
  /// kiroku::Error for more; whoever reads a series asks as it grows.
  static void require_memory_for(std::size_t radiograph_bytes);

  /// kiroku::Error in one sentence for a model without tumour, rib cage or diaphragm, radiographs of another
  /// size than the geometry's, that are not one after the other, or too many; what the projectors throw.
  /// `step` hears what is done next.
  explicit BreathingBench(BenchInputs inputs, const std::function<void(const std::string& step)>& step = {});

  [[nodiscard]] const std::filesystem::path& file() const { return file_; }
  [[nodiscard]] const sim::BreathingModel& model() const { return model_; }
  /// By the model's groups.
  [[nodiscard]] const std::shared_ptr<const GroupedLung>& own_lung() const { return lung_; }
  /// By those of a motion, solved for anew where they differ from the model's; takes about as long as opening
  /// the lung did. kiroku::Error in one sentence where they are not as many as the surface has nodes, none
  /// moves, or nothing holds the lung.
  [[nodiscard]] std::shared_ptr<const GroupedLung> lung_of(const MotionDeed& motion) const;
  [[nodiscard]] const sim::LungSurface& surface() const { return surface_; }
  /// Groups of a surface of more nodes are changed in the document alone.
  static constexpr std::size_t kMostPaintedNodes = 20'000;
  [[nodiscard]] bool may_paint() const { return surface_.nodes.size() <= kMostPaintedNodes; }
  [[nodiscard]] const std::vector<BenchRadiograph>& radiographs() const { return radiographs_; }
  [[nodiscard]] const std::optional<BenchRecording>& recording() const { return recording_; }
  [[nodiscard]] bool has_radiographs() const { return !radiographs_.empty(); }
  [[nodiscard]] std::size_t nodes() const { return model_.mesh.nodes.size(); }

  /// As the document says it.
  [[nodiscard]] MotionDeed own_motion() const;
  /// kiroku::Error where the waveform has no cycle that could be another: it was measured, or is told breath
  /// by breath.
  [[nodiscard]] sim::Waveform waveform_of(const MotionDeed& motion) const;
  /// The moments of a time line, ascending: radiographs, else the model's phases.
  [[nodiscard]] std::vector<double> times_s(const sim::Waveform& waveform) const;
  /// The waveform's moment at one of the time line.
  [[nodiscard]] double model_time_s(double time_s) const {
    return has_radiographs() ? start_s_ + time_s : time_s;
  }
  /// The last radiograph that was taken by then; the first before. There must be one.
  [[nodiscard]] std::size_t radiograph_at(double time_s) const;

  /// Pixels `factor` (1 to kFactors) times as wide and high.
  static constexpr std::size_t kFactors = 3;
  [[nodiscard]] const sim::ProjectionGeometry& geometry(std::size_t factor) const;
  [[nodiscard]] sim::ProjectionImage drr(std::size_t factor, const std::vector<sim::Vector3>& moved_m) const;
  /// Of the first radiograph and the lung at rest: pictures keep these, so that greys can be compared.
  [[nodiscard]] const sim::OverlayWindows& windows() const { return windows_; }
  /// The tumour's edge where the nodes are displaced by that.
  [[nodiscard]] std::vector<sim::PixelLine> outline(std::size_t factor,
                                                    const std::vector<sim::Vector3>& moved_m) const;
  /// The tumour's centre at rest.
  [[nodiscard]] const sim::Vector3& tumour_m() const { return tumour_m_; }

  /// So many models are kept in one folder.
  static constexpr std::size_t kMostModels = 1000;

  /// The whole series can be fitted to where there are so many moments (sim::kLeastMoments).
  [[nodiscard]] bool can_fit() const;
  /// For a fit: the model as `motion` has it, the lung in the CT with its directions, and the CT. What
  /// waveform_of() throws, and kiroku::Error for groups of another surface or of which none moves.
  [[nodiscard]] sim::BreathingModel model_with(const MotionDeed& motion) const;
  [[nodiscard]] sim::BreathingScene scene_of(const sim::BreathingModel& model) const {
    return {model, ct_, mesh_};
  }
  [[nodiscard]] const sim::Volume& volume() const { return volume_; }

  /// Writes the model, as it was when this was made, with another motion and its groups beside it, as `name`
  /// with ".json", durably; returns that. Refusal 400 for a name that is no file's, 409 where there is such a
  /// file or are kMostModels, or where a file that the model names is another by now: nobody has seen such a
  /// lung; 507 where the disk has no room. kiroku::Error as model_with(). kiroku::IoError.
  [[nodiscard]] std::string save(const std::string& name, const MotionDeed& motion) const;

 private:
  struct View {
    sim::ProjectionGeometry geometry;
    sim::ProjectionImage still;
  };
  /// Of all nodes, where those of the surface are of these.
  [[nodiscard]] sim::BoundaryGroups groups_of(const sim::BoundaryGroups& of_surface) const;
  [[nodiscard]] std::shared_ptr<const GroupedLung> solve(const sim::BoundaryGroups& groups) const;

  std::filesystem::path file_;
  sim::BreathingModel model_;
  std::vector<NamedFile> named_;  // by the model
  std::vector<BenchRadiograph> radiographs_;
  double start_s_;
  std::optional<BenchRecording> recording_;
  std::shared_ptr<const sim::CtProjector> ct_;
  std::shared_ptr<const sim::MeshProjector> mesh_;
  sim::Volume volume_;       // none where there is nothing to fit to
  std::vector<View> views_;  // by factor
  sim::OverlayWindows windows_;
  sim::LungSurface surface_;
  std::int32_t tumour_region_ = 0;
  sim::Vector3 tumour_m_ = sim::Vector3::Zero();
  std::shared_ptr<const GroupedLung> lung_;
};

}  // namespace kiroku::viewer

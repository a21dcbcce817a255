// The options of every command that computes radiographs of a CT, and what they name, read.
#pragma once

#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "apps/common/command_line.h"
#include "apps/common/step_line.h"
#include "apps/sim/number_option.h"
#include "apps/sim/volume_request.h"
#include "sim/drr/gl_projector.h"
#include "sim/drr/mesh_projector.h"
#include "sim/drr/picture.h"
#include "sim/mesh/length_unit.h"

namespace kiroku::apps {

struct DrrRequest {
  VolumeRequest volume;
  std::string geometry;
  std::optional<std::string> gantry, mesh, displacement, unit, part, energy, projector;
  bool keep_mass = false;
};
/// The request must live until the program has run.
void add_drr_options(Command& command, DrrRequest& request);

/// A CT, perhaps with a mesh that deforms it, and who looks at it.
class DrrScene {
 public:
  /// Errors of all that is read, kiroku::UsageError for options that do not belong together.
  DrrScene(const DrrRequest& request, StepLine& line);

  /// Displaces the mesh, which there must be, as a .vtu says. What sim::read_displacement() throws.
  void move_to(const std::filesystem::path& vtu);
  /// Of each node of that mesh, m.
  void move_to(std::vector<sim::Vector3> displacement_m) { displacement_m_ = std::move(displacement_m); }
  /// What the .vtu says of each node of that mesh, m. What sim::read_displacement() throws.
  [[nodiscard]] std::vector<sim::Vector3> displacement_of(const std::filesystem::path& vtu) const;

  [[nodiscard]] const sim::GeometryDocument& machine() const { return machine_; }
  [[nodiscard]] const sim::Attenuation& attenuation() const { return attenuation_; }
  /// As the request says: the whole, or a part. What still() and moving() add up to.
  [[nodiscard]] sim::ProjectionImage project(const sim::ProjectionGeometry& geometry) const;
  /// What does not change where the mesh moves, and what does; of each nothing where the request asks for
  /// none of it. A film computes the first once.
  [[nodiscard]] std::optional<sim::ProjectionImage> still(const sim::ProjectionGeometry& geometry) const;
  [[nodiscard]] std::optional<sim::ProjectionImage> moving(const sim::ProjectionGeometry& geometry) const;
  /// Of the volume's box, in the patient.
  [[nodiscard]] sim::Vector3 middle_m() const;
  /// With its nodes where they are displaced to; without any where there is no mesh.
  [[nodiscard]] sim::TetMesh deformed_mesh() const;
  /// Of the volume and of OpenGL, one sentence each.
  [[nodiscard]] const std::vector<std::string>& findings() const { return findings_; }

 private:
  sim::GeometryDocument machine_;
  sim::Attenuation attenuation_;
  sim::DensityRule rule_;
  std::string part_;
  sim::LengthUnit unit_;  // of the mesh's file
  std::vector<std::string> findings_;
  std::unique_ptr<sim::CtProjector> ct_;
  std::unique_ptr<sim::MeshProjector> mesh_;
  std::unique_ptr<sim::GlProjector> gl_;  // where OpenGL projects what is inside
  std::vector<sim::Vector3> displacement_m_;
};

/// Of one at least, and never negative.
sim::ProjectionImage sum_of(std::optional<sim::ProjectionImage> still,
                            std::optional<sim::ProjectionImage> moving);

/// kiroku::UsageError where the file is there, unless it may be replaced.
void refuse_to_replace(const std::string& file, bool force);

}  // namespace kiroku::apps

#include "apps/sim/drr_request.h"

#include <algorithm>
#include <filesystem>
#include <utility>

#include "base/error.h"
#include "sim/drr/dicom_radiograph.h"
#include "sim/mesh/mesh_reader.h"
#include "sim/mesh/vtu_reader.h"

namespace kiroku::apps {
namespace {

sim::GeometryDocument machine_of(const DrrRequest& request) {
  sim::GeometryDocument machine = sim::is_dicom_file(request.geometry)
                                      ? sim::read_dicom_geometry(request.geometry)
                                      : sim::read_geometry(request.geometry);
  if (!request.gantry) return machine;
  if (!machine.gantry) {
    throw UsageError("--gantry turns a gantry, and " + request.geometry +
                     " describes none: it gives a matrix, which has its angle already");
  }
  machine.gantry->gantry_deg = parse_number(*request.gantry, "--gantry");
  machine.geometry = sim::ProjectionGeometry(*machine.gantry);
  return machine;
}

}  // namespace

sim::ProjectionImage sum_of(std::optional<sim::ProjectionImage> still,
                            std::optional<sim::ProjectionImage> moving) {
  if (!still) return std::move(*moving);
  if (moving) {
    sim::add_to(*still, *moving);
  } else {
    for (float& value : still->values) value = std::max(value, 0.0F);
  }
  return std::move(*still);
}

void refuse_to_replace(const std::string& file, bool force) {
  if (!force && std::filesystem::is_regular_file(file)) {
    throw UsageError("'" + file + "' is there already: name another file, or give --force to replace it");
  }
}

void add_drr_options(Command& command, DrrRequest& request) {
  add_volume_options(command, request.volume);
  command.required_option("-g,--geometry", "FILE", request.geometry,
                          "source and detector (.json), or an RT Image (.dcm)");
  command.option("--gantry", "DEGREES", request.gantry, "another angle of the gantry than the geometry's");
  command.option("--mesh", "FILE", request.mesh, "a mesh of the volume (.msh, .vtk, .veg) that moves");
  command.option("--displacement", "VTU", request.displacement,
                 "how it moves: a .vtu of sim solve, plan run or sim respire", "not at all");
  command.choice("--length-unit", {"mm", "m"}, request.unit, "of the mesh", "mm");
  command.choice("--part", {"all", "inside", "outside"}, request.part, "what is shown: of the mesh", "all");
  command.flag("--keep-mass", request.keep_mass,
               "tissue becomes denser as its volume shrinks, instead of staying as it is");
  command.choice("--projector", {"processor", "opengl"}, request.projector,
                 "who projects what is in the mesh; opengl takes a graphics processor where one is there",
                 "processor");
  command.option("--energy", "KEV", request.energy, "of the rays, 20 to 20000", "70");
}

DrrScene::DrrScene(const DrrRequest& request, StepLine& line)
    : machine_(machine_of(request)),
      attenuation_(request.energy ? parse_number(*request.energy, "--energy")
                                  : sim::Attenuation::kCtEnergyKev),
      rule_(request.keep_mass ? sim::DensityRule::kKeepMass : sim::DensityRule::kKeepDensity),
      part_(request.part.value_or("all")),
      unit_(request.unit == "m" ? sim::LengthUnit::kMetre : sim::LengthUnit::kMillimetre) {
  if (!request.mesh &&
      (request.displacement || request.part || request.unit || request.keep_mass || request.projector)) {
    throw UsageError(
        "--displacement, --part, --length-unit, --keep-mass and --projector are of a mesh: give --mesh too");
  }
  // What is small is read first, so that its mistakes need not wait for the CT.
  sim::TetMesh mesh;
  if (request.mesh) {
    mesh = sim::read_mesh(*request.mesh, unit_).mesh;
    if (request.displacement) {
      displacement_m_ = sim::read_displacement(*request.displacement, mesh, unit_);
    } else {
      displacement_m_.assign(mesh.nodes.size(), sim::Vector3::Zero());
    }
  }
  line.show("reading " + request.volume.path);
  sim::VolumeFile file = sim::read_volume(request.volume.path, request.volume.options());
  findings_ = std::move(file.findings);
  line.show("projecting");
  if (request.projector == "opengl") {
    gl_ = std::make_unique<sim::GlProjector>(file.volume, attenuation_, mesh, sim::GpuUse::kAuto);
    if (!gl_->notice().empty()) findings_.push_back(gl_->notice());
  }
  ct_ = std::make_unique<sim::CtProjector>(file.volume, attenuation_);
  if (request.mesh) mesh_ = std::make_unique<sim::MeshProjector>(*ct_, std::move(mesh));
}

std::vector<sim::Vector3> DrrScene::displacement_of(const std::filesystem::path& vtu) const {
  return sim::read_displacement(vtu, mesh_->mesh(), unit_);
}

void DrrScene::move_to(const std::filesystem::path& vtu) { move_to(displacement_of(vtu)); }

sim::Vector3 DrrScene::middle_m() const {
  sim::Vector3 middle = sim::Vector3::Zero();
  for (const sim::Vector3& corner : ct_->corners_m()) middle += corner / double(ct_->corners_m().size());
  return middle;
}

sim::TetMesh DrrScene::deformed_mesh() const {
  sim::TetMesh mesh = mesh_ ? mesh_->mesh() : sim::TetMesh();
  for (std::size_t node = 0; node < mesh.nodes.size(); ++node) mesh.nodes[node] += displacement_m_[node];
  return mesh;
}

std::optional<sim::ProjectionImage> DrrScene::still(const sim::ProjectionGeometry& geometry) const {
  if (!mesh_) return ct_->project(geometry);
  if (part_ == "inside") return std::nullopt;
  return mesh_->outside(geometry);
}

std::optional<sim::ProjectionImage> DrrScene::moving(const sim::ProjectionGeometry& geometry) const {
  if (!mesh_ || part_ == "outside") return std::nullopt;
  return gl_ ? gl_->inside(geometry, displacement_m_, rule_)
             : mesh_->inside(geometry, displacement_m_, rule_);
}

sim::ProjectionImage DrrScene::project(const sim::ProjectionGeometry& geometry) const {
  return sum_of(still(geometry), moving(geometry));
}

}  // namespace kiroku::apps

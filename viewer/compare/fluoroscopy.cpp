#include "viewer/compare/fluoroscopy.h"

#include <algorithm>
#include <span>
#include <utility>
#include <vector>

#include "base/error.h"
#include "sim/drr/attenuation.h"
#include "viewer/playback/picture_span.h"

namespace kiroku::compare {
namespace {

/// The usual luma of BT.601; a fluoroscope's colours are grey.
constexpr float kRed = 0.299F, kGreen = 0.587F, kBlue = 0.114F;
/// As line integrals are of a body; gradient correlation knows no scale.
constexpr float kScale = 5.0F / 255;

std::span<const sim::Vector3> nodes_of(const sim::PlanFrame& frame, std::vector<sim::Vector3>& into) {
  const auto nodes = static_cast<std::size_t>(frame.displacement_m.size()) / 3;
  into.resize(nodes);
  for (std::size_t node = 0; node < nodes; ++node)
    into[node] = frame.displacement_m.segment<3>(static_cast<Eigen::Index>(3 * node));
  return into;
}

}  // namespace

std::string fluoroscopy_of(const archive::CaseReader& recording, const std::optional<std::string>& asked,
                           const std::string& option) {
  if (asked) {
    if (recording.stream(*asked).kind != "video")
      throw UsageError("stream '" + *asked + "' has no pictures; choose a video stream");
    return *asked;
  }
  std::vector<std::string> names;
  for (const archive::StreamInfo& stream : recording.opening().streams) {
    if (stream.kind == "video" && stream.purpose == kFluoroscopyPurpose) names.push_back(stream.name);
  }
  if (names.empty())
    throw UsageError("no stream of the case has the purpose 'fluoroscopy': say with " + option +
                     " which one is");
  if (names.size() > 1)
    throw UsageError("the case has several streams of fluoroscopy: say with " + option + " which one");
  return names.front();
}

PlanRadiographs::PlanRadiographs(const sim::Plan& plan, const sim::Volume& volume)
    : ct_(volume, sim::Attenuation(sim::Attenuation::kCtEnergyKev)), rest_(ct_, plan.body.mesh) {}

sim::ProjectionImage PlanRadiographs::project(const sim::PlanFrames::Kept& moment,
                                              const sim::ProjectionGeometry& geometry) {
  const bool is_cut = moment.mesh->tetrahedra.size() != rest_.mesh().tetrahedra.size();
  if (is_cut && moment.mesh != cut_mesh_) {
    cut_ = std::make_unique<sim::MeshProjector>(ct_, *moment.mesh);
    cut_mesh_ = moment.mesh;
  }
  if (!outside_by_ || *outside_by_ != geometry.matrix()) {
    outside_ = rest_.outside(geometry);
    outside_by_ = geometry.matrix();
  }
  std::vector<sim::Vector3> nodes;
  sim::ProjectionImage image = (is_cut ? *cut_ : rest_).inside(geometry, nodes_of(moment.frame, nodes));
  sim::add_to(image, outside_);
  return image;
}

sim::Vector3 PlanRadiographs::middle_m() const {
  sim::Vector3 middle = sim::Vector3::Zero();
  for (const sim::Vector3& corner : ct_.corners_m()) middle += corner / double(ct_.corners_m().size());
  return middle;
}

sim::ProjectionImage radiograph_of(const media::PictureView& rgb, sim::Polarity polarity) {
  constexpr float kWhite = 255;
  const std::size_t pixels = static_cast<std::size_t>(rgb.width) * static_cast<std::size_t>(rgb.height);
  sim::ProjectionImage image{static_cast<std::size_t>(rgb.width), static_cast<std::size_t>(rgb.height), {}};
  image.values.reserve(pixels);
  for (std::size_t i = 0; i < pixels; ++i) {
    const float grey = kRed * float(rgb.samples[3 * i]) + kGreen * float(rgb.samples[3 * i + 1]) +
                       kBlue * float(rgb.samples[3 * i + 2]);
    image.values.push_back(kScale * (polarity == sim::Polarity::kBoneBlack ? kWhite - grey : grey));
  }
  return image;
}

Fluoroscopy compare_fluoroscopy(const archive::CaseReader& recording, const crypto::AgeIdentities& identities,
                                const TimeMap& map, const sim::PlanFrames& frames,
                                PlanRadiographs& radiographs, const FluoroscopyRequest& request,
                                const std::function<void(double share)>& progress) {
  playback::PictureSpan reader(recording, identities, request.stream, request.at_ns, request.at_ns + 1);
  std::optional<sim::ProjectionImage> recorded;
  std::int64_t at_ns = 0;
  while (reader.next() && (!recorded || reader.time_ns() <= request.at_ns)) {
    if (static_cast<std::size_t>(reader.width()) != request.geometry.columns() ||
        static_cast<std::size_t>(reader.height()) != request.geometry.rows()) {
      throw UsageError("the pictures of '" + request.stream + "' have " + std::to_string(reader.width()) +
                       " x " + std::to_string(reader.height()) + " pixels, the geometry " +
                       std::to_string(request.geometry.columns()) + " x " +
                       std::to_string(request.geometry.rows()) + ": say in it what the recording has");
    }
    const std::vector<std::uint8_t> rgb = reader.rgb();
    recorded = radiograph_of({reader.width(), reader.height(), 3, rgb}, request.polarity);
    at_ns = reader.time_ns();
  }
  if (!recorded) throw UsageError("stream '" + request.stream + "' holds no picture at that time");
  const PlanMoment moment = map.plan_at(at_ns);
  const sim::PlanFrames::Kept& kept = frames.at(moment.step, moment.plan_s);
  Fluoroscopy found{request.stream, request.geometry, request.polarity, at_ns, moment.plan_s, 0, {}};
  found.similarity = sim::gradient_correlation(*recorded, radiographs.project(kept, request.geometry));
  if (!request.align) return found;
  found.alignment = sim::register_rigidly(
      *recorded, request.geometry, radiographs.middle_m(),
      [&](const sim::ProjectionGeometry& seen_by) { return radiographs.project(kept, seen_by); },
      [&](std::size_t done, std::size_t all) {
        if (progress && all > 0) progress(double(done) / double(all));
      });
  found.geometry = request.geometry.of_moved_patient(found.alignment->motion);
  return found;
}

}  // namespace kiroku::compare

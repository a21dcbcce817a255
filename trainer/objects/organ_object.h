// What is pushed aside; the two objects of the exclusion study and the vessels that its surgeons asked for,
// made at any resolution.
//
// Source: "Construction of Training Environment for Surgical Exclusion with a Basic Study of Multi-finger
// Haptic Interaction": object A is like a liver, with grooves between its regions and one elasticity
// throughout; object B is like a lung, soft, with a bronchus and a pulmonary artery that are stiffer. The
// papers give elasticities, not shapes: the shapes here are the project's own. Its surgeons say that aorta
// and great vein are pushed aside, too (section 6.3), without a number: object C is the project's own in all.
#pragma once

#include <functional>
#include <string>

#include "sim/fem/elastic_body.h"
#include "sim/render/picture.h"

namespace kiroku::trainer {

enum class ObjectKind { kLiver, kLung, kVessels };
/// "a", "b", "c"; kiroku::UsageError for others.
ObjectKind object_kind(const std::string& name);
std::string name_of(ObjectKind kind);
/// How far the object reaches above and below the origin, m.
double half_thickness_m(ObjectKind kind);
/// How far it reaches towards the trainee and away, m.
double half_width_m(ObjectKind kind);

/// An organ that can be made a body of. Metres.
struct OrganObject {
  std::string name;  // by which results are kept: "a", "b", "c", or that of a patient's organ
  sim::Rgb tissue{};
  sim::TetMesh mesh;
  sim::Materials materials;
  sim::Constraints constraints{0};
};

/// A and B: a sheet of tissue around the origin, 20 cm along x, 12 cm along y, rounded at its borders. C: two
/// vessels beside each other, 20 cm along x. Held at both ends of x over 7.5 % of the length. Metres.
///
/// A: 3 cm thick, E 0.3 MPa, Poisson's ratio 0.4; regions 1 to 3 are its lobes, from -x on, with grooves 8 mm
///    deep between them on the upper side.
/// B: 4.4 cm thick, region 1 of E 0.1 MPa; region 2, a bronchus that forks, and region 3, an artery beside
/// it, of
///    E 1.0 MPa, both entering at -x. Poisson's ratio 0.4.
/// C: region 1, a great vein at -y, of E 0.1 MPa; region 2, an aorta beside it, of E 0.3 MPa; both 2.3 cm
///    thick, full and without a wall of their own; region 3, what joins them, of E 0.05 MPa. Poisson's ratio
///    0.4.
///
/// Meshed as organs of a CT are (sim/meshing), from voxels of 2 mm; about `vertices` nodes. The same call
/// gives the same bits. `step` as of make_organ_mesh(). kiroku::UsageError for numbers out of range.
OrganObject make_object(ObjectKind kind, std::size_t vertices,
                        const std::function<void(const std::string&)>& step = {});

/// With fewer, a fingertip would go between the nodes of the surface.
inline constexpr std::size_t kLeastObjectNodes = 800, kMostObjectNodes = 100'000;

}  // namespace kiroku::trainer

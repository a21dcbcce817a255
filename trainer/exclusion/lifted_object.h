// An object whose border fingertips lift by so much: how stress depends on how many there are, and on where
// they lie. Thread-safe but where the contact is not.
#pragma once

#include <string>
#include <vector>

#include "sim/contact/contact_body.h"
#include "trainer/exclusion/exclusion_body.h"

namespace kiroku::trainer {

enum class LiftManner : std::uint8_t {
  kSpread,    // side by side along the border, as hands do (side_by_side_m())
  kTogether,  // each beside the next, so that they touch nearly
};
std::string name_of(LiftManner manner);

struct LiftedObject {
  Eigen::VectorXd displacement_m;               // (3 |V|)
  std::vector<sim::SymmetricTensor> stress_pa;  // (|T|)
  std::vector<sim::Pose> poses;                 // of the fingertips
  std::vector<double> forces_n;                 // of each
  double wrist_n = 0;                           // of all together: the length of their sum
  std::vector<double> von_mises_at_nodes_pa;    // (|V|), of stress smoothed as ElasticBody::at_nodes() does
  double largest_von_mises_pa = 0;
  std::size_t largest_at = 0;    // a tetrahedron
  double high_von_mises_pa = 0;  // stress_of_share_pa()
  double von_mises_95_pa = 0;    // what 95 % of the tissue stays below, by the same measure
};

/// Lifts from where fingertips touch the border from below, in steps of half a millimetre, with the task's
/// friction; small displacements. kiroku::UsageError for other than 1 to 5 fingers and for a lift that is not
/// above 0 and at most 5 cm.
LiftedObject lift_border(const sim::ContactBody& contact, const ExclusionTask& task, std::size_t fingers,
                         LiftManner manner, double height_m);

/// The greatest von Mises stress away from what presses and holds: of tetrahedra whose middle is 3.5 cm or
/// more from a fingertip and 1 cm or more from where objects A and B are held.
struct StressPeak {
  double von_mises_pa = 0;
  std::size_t tetrahedron = 0;
  sim::Vector3 at_m = sim::Vector3::Zero();  // its middle, undeformed
};
StressPeak peak_away(const sim::TetMesh& mesh, const LiftedObject& lifted);

/// Tetrahedra at which materials of different stiffness meet: they share a face with one of another Young's
/// modulus;
/// (|T|).
std::vector<bool> at_interface(const sim::TetMesh& mesh, const sim::Materials& materials);

}  // namespace kiroku::trainer

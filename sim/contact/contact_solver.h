// Contact of rigid tools with a compliant surface: forces and displacements where one may touch it.
//
// A node is outside a tool where the signed distance phi(x) >= 0. The body answers u = C f with its
// compliance C between the nodes of a neighbourhood (after Hirota and Kaneko, see fem/compliance.h), so that
// only the forces f of contacts are unknown. They press, never pull, and only where they touch:
// f >= 0, phi >= 0, f phi = 0, for all tools in one problem; whether a finger pushes the tissue or has it
// pushed against itself by another need not be told or tried.
//
// The distance is not linear in x. It is convex, so the plane through the nearest point of the tool never
// tells more than the distance itself: each linear problem (complementarity.h) gives a state that penetrates
// nowhere, and the next one, of the planes at that state, costs less energy (the convex-concave procedure:
// Yuille and Rangarajan, Neural Computation 15, 2003). Steps follow each other until pressed nodes lie on
// their tool to the tolerance.
//
// Sticking tools (the surface constraint of "Interactive Volume Manipulation for Supporting Preoperative
// Planning"): a node that touches is bound to where it is on the tool and follows it in all three directions,
// until the tool would have to pull at it; then it is let go in the same step, and glides on the tool for the
// rest of the step. A node is bound to one tool at most, on others it glides.
//
// Friction (Coulomb's) lies between gliding and sticking: a node is bound while the force along the tool's
// surface is at most `friction` times the one that presses. If more would be needed it slides: that much acts
// on it against the way it slides, and where it comes to lie it is bound again in the next step. How hard it
// presses and where it slides to depend on that force in turn: they are found one after the other until they
// fit (Tresca's friction, iterated: Necas, Jarusek and Haslinger, Bollettino UMI 17-B, 1980; its direction by
// the projection of Alart and Curnier, Computer Methods in Applied Mechanics and Engineering 92, 1991), so
// that each linear problem stays symmetric, and a state penetrates nowhere, also where the rounds of a step
// are too few; then the next steps go on. What slides goes on sliding for the rest of its step. A node that
// more than one tool touches slides without friction.
#pragma once

#include <cstdint>
#include <limits>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "sim/contact/complementarity.h"
#include "sim/contact/point_tree.h"
#include "sim/contact/tool_shape.h"

namespace kiroku::sim {

/// The nodes of the surface that may be touched now, in groups as PointTree asks for. None of them is held.
/// Immutable once made.
struct ContactNeighbourhood {
  std::vector<std::uint32_t> nodes;  // (|N|), of the mesh
  Eigen::VectorXd rest_m;            // (3 |N|), where they are when no tool touches
  Eigen::MatrixXd compliance;        // (3 |N| x 3 |N|), m/N, symmetric to the bit
  std::vector<double> area_m2;       // (|N|), of the undeformed surface: a third of each face around it
  std::vector<std::uint8_t> free;    // (|N|), 1 where no component is prescribed: others cannot stick
  double size_m = 0;                 // of the body: its longest side
};

struct ContactTool {
  std::string name;  // for errors: "finger 1"
  ToolShape shape;
  bool sticks = false;
  /// Of a tool that sticks: Coulomb's coefficient, greater than zero. Infinite: nodes never slide.
  double friction = std::numeric_limits<double>::infinity();

  /// Whether what sticks may slide.
  [[nodiscard]] bool slides() const { return sticks && friction < std::numeric_limits<double>::infinity(); }
};

struct ContactOptions {
  /// How far a pressed node may be from its tool, and a node inside one, in lengths of the body.
  double tolerance = 1e-6;
  /// Linear problems a step at most. One is enough not to penetrate with what is known to touch; more find
  /// what is pushed into another tool, and bring pressed nodes back to curved ones.
  int most_iterations = 50;
};

/// A node on a tool.
struct Contact {
  std::uint32_t node = 0;  // of the mesh
  std::uint32_t tool = 0;
  Vector3 force_n = Vector3::Zero();  // on the tissue
  Vector3 normal = Vector3::UnitX();  // of the tool's surface there, outwards
  double pressure_pa = 0;             // the force along the normal for the node's area
};

/// What one tool feels.
struct ToolForce {
  Vector3 force_n = Vector3::Zero();    // on the tool; minus the forces on its nodes
  Vector3 torque_nm = Vector3::Zero();  // on the tool, about its origin
  /// Its parts along the mean normal of the touched surface (weighted by the nodes' areas) and across it.
  double normal_n = 0, tangential_n = 0;
  std::uint32_t nodes = 0;  // that it presses
};

struct ContactResult {
  std::vector<ToolForce> tools;
  Vector3 wrist_force_n = Vector3::Zero();  // the sum over all tools: what a hand feels that holds them
  std::vector<Contact> contacts;            // by tool and node
  int iterations = 0;
  bool converged = false;
  double deepest_penetration_m = 0;  // of a node of the neighbourhood, after the step; 0 for none
  double largest_gap_m = 0;          // between a pressed node and its tool
};

/// Holds the state between steps: which nodes press, where sticking ones are bound, how the surface lies. Not
/// thread-safe. Allocates only for more contacts than ever before.
class ContactSolver {
 public:
  /// kiroku::UsageError for tools without extent and options without sense.
  ContactSolver(std::shared_ptr<const ContactNeighbourhood> neighbourhood, std::vector<ContactTool> tools,
                const ContactOptions& options = {});

  /// Makes room: steps with no more contacts than that, of which some may turn out not to press, allocate
  /// nothing. There is some from the beginning.
  void reserve(std::size_t contacts);
  [[nodiscard]] std::size_t room() const { return touches_.capacity(); }

  /// Takes over the contacts of another of the same tools and the same body at rest where it was, whose
  /// neighbourhood may be another; contacts of nodes that are not in this one are lost. Whether that is a
  /// balance as it was one before: false where contacts were lost, or a node that previous did not know is
  /// inside a tool. Allocates nothing where there is room.
  bool continue_from(const ContactSolver& previous);
  /// The same where body and tools may be others: `tool_there` says for each of these tools which one of the
  /// previous it is, or a number too large for one that was not there. Contacts of tools that are no longer
  /// are lost.
  void continue_from(const ContactSolver& previous, std::span<const std::uint32_t> tool_there);

  /// What else moves the body has taken the nodes of the neighbourhood, (3 |N|), to other places to rest at.
  void rest_at(Eigen::VectorXd rest_m);

  /// Moves the tools there and finds the balance. Valid until the next call. The same poses from the same
  /// state give the same bits. kiroku::Error, and the state as before, for poses that are none, and for tools
  /// that leave a node no place because they overlap, naming it and them.
  const ContactResult& step(std::span<const Pose> poses);

  /// Throws as step() does where these are no poses for the tools.
  void check(std::span<const Pose> poses) const;

  /// As of the last step (or continue_from()).
  [[nodiscard]] const ContactResult& result() const { return result_; }
  /// (3 |N|), where the nodes are.
  [[nodiscard]] const Eigen::VectorXd& positions_m() const { return positions_m_; }
  [[nodiscard]] const ContactNeighbourhood& neighbourhood() const { return *neighbourhood_; }
  [[nodiscard]] const std::vector<ContactTool>& tools() const { return tools_; }

 private:
  /// A direction in which a node presses on a tool or is bound to it.
  struct Row {
    std::uint32_t touch, point;
    Vector3 direction;
    double gap_m;  // along the direction, if no force acted
    bool equality;
  };
  /// A node on a tool: one row, or three where it sticks.
  struct Touch {
    std::uint32_t point = 0, tool = 0;
    bool bound = false, pressing = false;
    bool sliding = false;  // with friction; not bound then
    bool blocked = false;  // what is prescribed does not let it move along the normal
    Vector3 anchor_m = Vector3::Zero(), anchor_normal = Vector3::UnitX();  // in the tool's frame, if bound
    Vector3 normal = Vector3::UnitX();                                     // of the tool there
    Vector3 force_n = Vector3::Zero();                                     // on the node
    /// Of one that slides: which way friction acts on it, and how much was reckoned with.
    Vector3 along = Vector3::Zero(), friction_n = Vector3::Zero();
  };

  [[nodiscard]] std::size_t rows_per_contact() const;
  void take_touches(const ContactSolver& previous, std::span<const std::uint32_t> tool_there);
  bool move_from(const ContactSolver& previous);
  void report_as(const ContactSolver& previous);
  void find_balance();
  bool add_touching(double depth_m);
  void bind(Touch& touch);
  void make_rows();
  void solve_rows();
  bool release();
  bool slip();
  bool update_friction();
  [[nodiscard]] Vector3 slip_m(const Touch& touch) const;
  void hold_where_it_lies();
  void move();
  [[nodiscard]] bool settled();
  void keep(bool all);
  void report();
  [[noreturn]] void refuse(const Row& row) const;
  [[nodiscard]] Vector3 position_m(std::uint32_t point) const {
    return positions_m_.segment<3>(3 * Eigen::Index{point});
  }
  [[nodiscard]] SurfaceDistance distance(std::uint32_t tool, std::uint32_t point) const;
  /// Whether friction holds it: more than one tool leave it no place of its own on any.
  [[nodiscard]] bool rubs(const Touch& touch) const {
    return tools_[touch.tool].slides() && touching_[touch.point] == 1;
  }
  [[nodiscard]] std::uint32_t& touch_at(std::uint32_t tool, std::uint32_t point) {
    return touch_at_[tool * neighbourhood_->nodes.size() + point];
  }

  std::shared_ptr<const ContactNeighbourhood> neighbourhood_;
  std::vector<ContactTool> tools_;
  ContactOptions options_;
  std::vector<double> reach_m_;  // of each tool

  std::vector<Pose> poses_;
  std::vector<Eigen::Matrix3d> rotations_;
  std::vector<Touch> touches_, before_;
  std::vector<Pose> poses_before_;
  std::vector<std::uint32_t> touch_at_;  // of each tool and point, kNone for none
  std::vector<std::uint8_t> bound_;      // (|N|)
  std::vector<std::uint8_t> touching_;   // (|N|), by how many tools
  std::vector<Row> rows_;
  ComplementarityProblem problem_;
  PointTree tree_;
  Eigen::VectorXd rest_m_, positions_m_;
  double tolerance_m_, deepest_m_ = 0, largest_gap_m_ = 0;
  int iterations_ = 0;
  bool converged_ = false;
  ContactResult result_;
};

}  // namespace kiroku::sim

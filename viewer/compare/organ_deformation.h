// How the plan's organ was deformed to fit the recorded pictures, small enough for a document: displacements
// of the drawn surface as sums of fields that all pictures share. Objects belong to one thread.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "sim/align/deformed_track.h"
#include "sim/align/drawn_surface.h"
#include "viewer/compare/departure.h"

namespace kiroku::compare {

/// Displacements of one surface in many pictures, as weighted sums of few fields. Numbers are those that a
/// document has, so that whoever reads it comes to the same.
class DisplacementFields {
 public:
  /// A node is off by at most that. The least standard error that a fit states is eight times as large.
  static constexpr double kMostErrorMm = 0.2;
  static constexpr std::size_t kMostFields = 64;
  /// Of a field's components, of which the largest is 1; and of weights.
  static constexpr double kFieldStep = 1e-3, kWeightStepMm = 1e-2;

  explicit DisplacementFields(std::size_t nodes) : nodes_(nodes) {}

  /// The weights of the fields, mm; zeros at the end are left out. A field is added where the ones that are
  /// there do not suffice. Nothing where there would be more than kMostFields.
  std::optional<std::vector<double>> take(const std::vector<sim::Vector3>& displacement_m);

  /// (3 x nodes) each: x, y, z of each node, without unit.
  [[nodiscard]] const std::vector<Eigen::VectorXd>& fields() const { return fields_; }
  [[nodiscard]] std::size_t nodes() const { return nodes_; }
  /// (nodes), m.
  [[nodiscard]] std::vector<sim::Vector3> sum(const std::vector<double>& weights_mm) const;

 private:
  [[nodiscard]] std::vector<double> weights_of(const Eigen::VectorXd& displacement_mm) const;
  [[nodiscard]] Eigen::VectorXd sum_mm(const std::vector<double>& weights_mm) const;

  std::size_t nodes_;
  std::vector<Eigen::VectorXd> fields_;
};

/// What a picture says of the organ's shape.
struct Deformation {
  sim::WhyRigid why = sim::WhyRigid::kNoRest;
  sim::WhyUnfitted unfitted = sim::WhyUnfitted::kFitted;  // of WhyRigid::kUnfitted
  [[nodiscard]] bool deformed() const { return why == sim::WhyRigid::kDeformed; }
  // Where it is deformed:
  std::int64_t rest_ns = 0;  // the picture from which displacements count
  sim::Camera camera;
  std::vector<double> weights_mm;  // of DisplacementFields
  std::vector<bool> told;          // (drawn nodes), whether the displacement's standard error is small enough
  double standard_error_m = 0;     // root of the mean square over those
  double largest_m = 0;            // displacement of those
  double misfit_px = 0, supported = 0;  // as sim::AlignedMoment has them
};

/// The shape of the organ at a moment, on the nodes of the drawn surface.
struct ShownDeformation {
  sim::Camera camera;
  std::vector<sim::Vector3> displacement_m;
  std::vector<bool> told;
  double standard_error_m = 0, largest_m = 0;
};

/// Of an alignment in which it was asked for, a deformation for each of its moments.
struct DeformedAlignment {
  explicit DeformedAlignment(std::size_t drawn_nodes) : fields(drawn_nodes) {}

  DisplacementFields fields;
  std::vector<Deformation> moments;
  std::vector<Departure> departures;  // for each of them, where the plan's own shapes were given

  /// Keeps what the track said; the drawn surface is that of the alignment.
  void take(const sim::DeformedMoment& moment, const sim::DrawnSurface& drawn);
  [[nodiscard]] std::size_t deformed() const;
  /// How many pictures kept the rigid organ for each reason, those with none left out.
  struct Count {
    sim::WhyRigid why = sim::WhyRigid::kNoRest;
    std::size_t pictures = 0;
  };
  [[nodiscard]] std::vector<Count> rigid() const;
  /// Of the told displacements of all pictures, m; 0 where none is.
  [[nodiscard]] double largest_m() const;
  /// What the last colour stands for: the largest displacement, rounded up to 1, 2 or 5 times a power of ten
  /// in mm, at least 5 mm.
  [[nodiscard]] double scale_mm() const;
  /// Likewise, of departures from the plan.
  [[nodiscard]] double departure_scale_mm() const;
  [[nodiscard]] ShownDeformation shown(const Deformation& deformation) const;
};

/// Why the rigid organ stands, for people: "the endoscope moved".
std::string sentence_of(sim::WhyRigid why);

}  // namespace kiroku::compare

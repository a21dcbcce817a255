// K = L L^T over the unknowns that are free, once, for many solves: CHOLMOD, supernodal, ordered by METIS
// over nodes. Same matrix, same bits: BLAS is kept to one thread (for the whole process), since the order of
// its sums may change with their number.
#pragma once

#include <algorithm>
#include <memory>
#include <optional>
#include <span>
#include <thread>
#include <vector>

#include <Eigen/Core>

#include "sim/fem/stiffness.h"

namespace kiroku::sim {

/// Owns its factor; not thread-safe but for solve_columns(), as solves share memory to work in.
class Factorisation {
 public:
  /// `free` (3 |V|): the unknowns; may be none. `order`: all nodes, as elimination_order() gives them.
  /// `threads`: how many work on it, at least one. The matrix must outlive it. kiroku::Error if it is not
  /// positive definite on the unknowns, with the node whose motion nothing resists; std::bad_alloc.
  Factorisation(const StiffnessMatrix& stiffness, const std::vector<bool>& free,
                std::span<const std::uint32_t> order,
                unsigned threads = std::max(std::thread::hardware_concurrency(), 1U));
  ~Factorisation();
  Factorisation(const Factorisation&) = delete;
  Factorisation& operator=(const Factorisation&) = delete;

  /// Brings the factor up to date where only blocks between these nodes have changed in the matrix: the same
  /// bits as a new factorisation gives. Errors as above; it is of no use after one.
  void update(std::span<const std::uint32_t> nodes);

  /// Displacements (3 |V|), zero where not free, that make K u = `force_n` (3 |V|) where free.
  [[nodiscard]] Eigen::VectorXd solve(const Eigen::VectorXd& force_n) const;

  /// The same for many right sides, one a column; (3 |V| x m), in place. Much faster than one by one, as the
  /// factor is read once. The same matrix of right sides gives the same bits, other columns beside one may
  /// change its last ones. Thread-safe: any number of threads may be in it, and one in solve().
  /// std::bad_alloc.
  void solve_columns(Eigen::Ref<Eigen::MatrixXd> columns) const;

  [[nodiscard]] std::size_t unknowns() const { return unknown_.size(); }

 private:
  struct Cholmod;
  void refuse(std::optional<std::size_t> failed_column) const;

  std::unique_ptr<Cholmod> cholmod_;
  unsigned threads_;
  std::vector<std::size_t> unknown_;  // their numbers in (3 |V|), ascending
};

}  // namespace kiroku::sim

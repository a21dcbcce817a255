#include "sim/fem/factorisation.h"

#include "base/error.h"
#include "sim/fem/cholmod_handles.h"
#include "sim/fem/factor_layout.h"
#include "sim/fem/supernodal_cholesky.h"

extern "C" void openblas_set_num_threads(int number);  // its header declares far more, in C99

namespace kiroku::sim {

struct Factorisation::Cholmod {
  CholmodSession session;  // outlives the factor
  CholmodSession::Factor factor;
  std::unique_ptr<SupernodalCholesky> numbers;
};

Factorisation::Factorisation(const StiffnessMatrix& stiffness, const std::vector<bool>& free,
                             std::span<const std::uint32_t> order, unsigned threads)
    : cholmod_(std::make_unique<Cholmod>()), threads_(threads) {
  openblas_set_num_threads(1);
  std::vector<std::uint32_t> unknown_of(free.size(), kNoUnknown);
  for (std::size_t number = 0; number < free.size(); ++number) {
    if (!free[number]) continue;
    unknown_of[number] = static_cast<std::uint32_t>(unknown_.size());
    unknown_.push_back(number);
  }
  if (unknown_.empty()) return;
  cholmod_->factor = lay_out_factor(cholmod_->session, stiffness, unknown_of, order);
  cholmod_->numbers = std::make_unique<SupernodalCholesky>(stiffness, unknown_of, *cholmod_->factor);
  refuse(cholmod_->numbers->compute(threads_));
}

void Factorisation::update(std::span<const std::uint32_t> nodes) {
  if (!unknown_.empty()) refuse(cholmod_->numbers->recompute(nodes, threads_));
}

void Factorisation::refuse(std::optional<std::size_t> failed_column) const {
  if (!failed_column) return;
  const auto* const permutation = static_cast<const std::int64_t*>(cholmod_->factor->Perm);
  const std::size_t number = unknown_[static_cast<std::size_t>(permutation[*failed_column])];
  throw Error(
      "node " + std::to_string(number / 3) +
      " can move without any resistance: it hangs on tetrahedra that can turn about an edge or a node");
}

Factorisation::~Factorisation() = default;

Eigen::VectorXd Factorisation::solve(const Eigen::VectorXd& force_n) const {
  Eigen::VectorXd displacement_m = Eigen::VectorXd::Zero(force_n.size());
  if (unknown_.empty()) return displacement_m;
  CholmodSession& session = cholmod_->session;
  const CholmodSession::Dense right = session.allocate_dense(unknown_.size(), 1);
  auto* const forces = static_cast<double*>(right->x);
  for (std::size_t i = 0; i < unknown_.size(); ++i)
    forces[i] = force_n[static_cast<Eigen::Index>(unknown_[i])];
  const CholmodSession::Dense solution(
      cholmod_l_solve(CHOLMOD_A, cholmod_->factor.get(), right.get(), session.common()), {session.common()});
  session.check();
  const auto* const moved = static_cast<const double*>(solution->x);
  for (std::size_t i = 0; i < unknown_.size(); ++i) {
    displacement_m[static_cast<Eigen::Index>(unknown_[i])] = moved[i];
  }
  return displacement_m;
}

void Factorisation::solve_columns(Eigen::Ref<Eigen::MatrixXd> columns) const {
  if (unknown_.empty()) {
    columns.setZero();
    return;
  }
  // Of its own, so that threads share nothing but the factor, which solving leaves as it is.
  CholmodSession session;
  const auto count = static_cast<std::size_t>(columns.cols());
  const CholmodSession::Dense right = session.allocate_dense(unknown_.size(), count);
  auto* const forces = static_cast<double*>(right->x);
  for (std::size_t column = 0; column < count; ++column) {
    const auto from = columns.col(static_cast<Eigen::Index>(column));
    for (std::size_t i = 0; i < unknown_.size(); ++i)
      forces[column * unknown_.size() + i] = from[static_cast<Eigen::Index>(unknown_[i])];
  }
  const CholmodSession::Dense solution(
      cholmod_l_solve(CHOLMOD_A, cholmod_->factor.get(), right.get(), session.common()), {session.common()});
  session.check();
  const auto* const moved = static_cast<const double*>(solution->x);
  columns.setZero();
  for (std::size_t column = 0; column < count; ++column) {
    auto into = columns.col(static_cast<Eigen::Index>(column));
    for (std::size_t i = 0; i < unknown_.size(); ++i)
      into[static_cast<Eigen::Index>(unknown_[i])] = moved[column * unknown_.size() + i];
  }
}

}  // namespace kiroku::sim

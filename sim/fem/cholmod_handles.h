// CHOLMOD's handles as objects, for the .cpp files of this folder.
#pragma once

#include <memory>
#include <new>
#include <string>

#include <suitesparse/cholmod.h>

#include "base/error.h"

namespace kiroku::sim {

/// What every call of CHOLMOD needs; one thread at a time. Its own messages stay off.
class CholmodSession {
 public:
  CholmodSession() {
    cholmod_l_start(&common_);
    common_.print = 0;
  }
  ~CholmodSession() { cholmod_l_finish(&common_); }
  CholmodSession(const CholmodSession&) = delete;
  CholmodSession& operator=(const CholmodSession&) = delete;

  [[nodiscard]] cholmod_common* common() { return &common_; }
  /// Throws if the last call failed: std::bad_alloc or kiroku::Error.
  void check() const {
    if (common_.status == CHOLMOD_OUT_OF_MEMORY) throw std::bad_alloc();
    if (common_.status == CHOLMOD_TOO_LARGE)
      throw Error("the mesh is too large to be factorised: take a coarser one");
    if (common_.status < 0) throw Error("CHOLMOD failed with status " + std::to_string(common_.status));
  }

  struct SparseDeleter {
    cholmod_common* common;
    void operator()(cholmod_sparse* matrix) const { cholmod_l_free_sparse(&matrix, common); }
  };
  using Sparse = std::unique_ptr<cholmod_sparse, SparseDeleter>;
  struct DenseDeleter {
    cholmod_common* common;
    void operator()(cholmod_dense* matrix) const { cholmod_l_free_dense(&matrix, common); }
  };
  using Dense = std::unique_ptr<cholmod_dense, DenseDeleter>;
  struct FactorDeleter {
    cholmod_common* common;
    void operator()(cholmod_factor* factor) const { cholmod_l_free_factor(&factor, common); }
  };
  using Factor = std::unique_ptr<cholmod_factor, FactorDeleter>;

  /// The pattern of a symmetric matrix: its lower triangle, columns sorted.
  Sparse allocate_pattern(std::size_t size, std::size_t entries) {
    Sparse matrix(cholmod_l_allocate_sparse(size, size, entries, 1, 1, -1, CHOLMOD_PATTERN, &common_),
                  {&common_});
    check();
    return matrix;
  }
  Dense allocate_dense(std::size_t rows, std::size_t columns) {
    Dense matrix(cholmod_l_allocate_dense(rows, columns, rows, CHOLMOD_REAL, &common_), {&common_});
    check();
    return matrix;
  }

 private:
  cholmod_common common_{};
};

}  // namespace kiroku::sim

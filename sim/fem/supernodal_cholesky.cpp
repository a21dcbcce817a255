#include "sim/fem/supernodal_cholesky.h"

#include <algorithm>
#include <array>
#include <atomic>
#include <chrono>
#include <condition_variable>
#include <exception>
#include <memory>
#include <mutex>
#include <system_error>
#include <thread>
#include <utility>

#include <suitesparse/cholmod.h>

#include "sim/fem/front_memory.h"
#include "sim/fem/lists.h"

// BLAS and LAPACK as Fortran names them; all matrices are stored by columns.
// NOLINTBEGIN(readability-identifier-naming)
extern "C" {
void dsyrk_(const char* triangle, const char* transposed, const int* n, const int* k, const double* alpha,
            const double* a, const int* lda, const double* beta, double* c, const int* ldc);
void dgemm_(const char* transposed_a, const char* transposed_b, const int* m, const int* n, const int* k,
            const double* alpha, const double* a, const int* lda, const double* b, const int* ldb,
            const double* beta, double* c, const int* ldc);
void dtrsm_(const char* side, const char* triangle, const char* transposed, const char* diagonal,
            const int* m, const int* n, const double* alpha, const double* a, const int* lda, double* b,
            const int* ldb);
void dpotrf_(const char* triangle, const int* n, double* a, const int* lda, int* info);
}
// NOLINTEND(readability-identifier-naming)

namespace kiroku::sim {
namespace {

/// Rows or columns of a front that are one piece of work.
constexpr std::size_t kTile = 128;
/// Of its own columns so many are eliminated at a time.
constexpr std::size_t kPanel = 64;
/// A thread that finds nothing to do looks for so long before it sleeps: stages of a front follow each other
/// faster than a sleeping thread is woken.
constexpr std::chrono::microseconds kLooking{100};

std::size_t tiles_in(std::size_t count) { return (count + kTile - 1) / kTile; }

/// Columns of a product L L^T, its lower triangle, taken off: `columns` on the diagonal and `below` rows
/// beneath them; `source` is the first of those rows of L, of which `inner` columns count.
void take_product_off(const double* source, std::size_t leading_source, std::size_t inner,
                      std::size_t columns, std::size_t below, double* into, std::size_t leading_into) {
  const int n = static_cast<int>(columns), k = static_cast<int>(inner), m = static_cast<int>(below),
            lda = static_cast<int>(leading_source), ldc = static_cast<int>(leading_into);
  const double one = 1, minus_one = -1;
  dsyrk_("L", "N", &n, &k, &minus_one, source, &lda, &one, into, &ldc);
  if (m > 0) {
    dgemm_("N", "T", &m, &n, &k, &minus_one, source + columns, &lda, source, &lda, &one, into + columns,
           &ldc);
  }
}

/// A block of K, some of whose entries are in the columns of a supernode.
struct BlockPlace {
  std::uint32_t row, column;  // nodes
  std::uint32_t first;        // of the factor's columns it has entries in: those up to the second after it
  const Eigen::Matrix3d* block;
};

/// Rows of a child that follow each other in its parent too.
struct Run {
  std::size_t from, into, count;
};

}  // namespace

class SupernodalCholesky::Work {
 public:
  Work(const StiffnessMatrix& stiffness, std::span<const std::uint32_t> unknown_of, cholmod_factor& factor)
      : count_(factor.nsuper),
        first_column_(static_cast<const std::int64_t*>(factor.super), count_ + 1),
        first_row_(static_cast<const std::int64_t*>(factor.pi), count_ + 1),
        first_number_(static_cast<const std::int64_t*>(factor.px), count_ + 1),
        rows_(static_cast<const std::int64_t*>(factor.s), factor.ssize),
        numbers_(static_cast<double*>(factor.x)),
        position_of_(unknown_of.begin(), unknown_of.end()),
        supernode_of_(factor.n),
        children_(count_),
        blocks_(count_),
        contributions_(count_),
        children_left_(count_),
        chosen_(count_),
        tiles_left_(count_) {
    for (std::uint32_t s = 0; s < count_; ++s) {
      std::fill(supernode_of_.begin() + first_column_[s], supernode_of_.begin() + first_column_[s + 1], s);
    }
    const auto* const permutation = static_cast<const std::int64_t*>(factor.Perm);
    std::vector<std::uint32_t> position(factor.n);
    for (std::uint32_t i = 0; i < factor.n; ++i) position[static_cast<std::size_t>(permutation[i])] = i;
    for (std::uint32_t& unknown : position_of_) {
      if (unknown != kNoUnknown) unknown = position[unknown];
    }
    list_children();
    list_blocks(stiffness);
  }

  void choose_all(bool keep) {
    chosen_.assign(count_, true);
    keeps_ = keep;
  }
  [[nodiscard]] bool keeps() const { return keeps_; }
  /// The supernodes with columns of these nodes, and their ancestors.
  void choose(std::span<const std::uint32_t> nodes) {
    chosen_.assign(count_, false);
    for (const std::uint32_t node : nodes) {
      for (std::size_t component = 0; component < 3; ++component) {
        const std::uint32_t position = position_of_[3 * std::size_t{node} + component];
        if (position == kNoUnknown) continue;
        for (std::optional<std::uint32_t> s = supernode_of_[position]; s && !chosen_[*s]; s = parent_of(*s))
          chosen_[*s] = true;
      }
    }
  }

  std::optional<std::size_t> run(unsigned threads) {
    failed_column_.reset();
    failure_ = nullptr;
    ready_.clear();
    changes_ = 0;
    std::ranges::fill(children_left_, 0);
    for (std::uint32_t s = 0; s < count_; ++s) {
      if (!chosen_[s]) continue;
      if (const auto parent = parent_of(s)) ++children_left_[*parent];
    }
    for (std::uint32_t s = static_cast<std::uint32_t>(count_); s-- > 0;) {
      if (chosen_[s] && children_left_[s] == 0) begin(s);
    }
    if (spaces_.size() < threads) spaces_.resize(threads);
    std::vector<std::thread> workers;
    try {
      for (unsigned i = 1; i < threads; ++i) workers.emplace_back([this, i] { work(spaces_[i]); });
    } catch (const std::system_error&) {
      // The machine gives no more threads; those that are there suffice.
    }
    work(spaces_[0]);
    for (std::thread& worker : workers) worker.join();
    if (failure_) std::rethrow_exception(failure_);
    return failed_column_;
  }

 private:
  [[nodiscard]] std::size_t columns_of(std::uint32_t s) const {
    return static_cast<std::size_t>(first_column_[s + 1] - first_column_[s]);
  }
  [[nodiscard]] std::size_t rows_of(std::uint32_t s) const {
    return static_cast<std::size_t>(first_row_[s + 1] - first_row_[s]);
  }
  /// Where the first row below its columns is one of; none for a root.
  [[nodiscard]] std::optional<std::uint32_t> parent_of(std::uint32_t s) const {
    if (rows_of(s) == columns_of(s)) return std::nullopt;
    return supernode_of_[static_cast<std::size_t>(
        rows_[static_cast<std::size_t>(first_row_[s]) + columns_of(s)])];
  }

  void list_children() {
    for (std::uint32_t s = 0; s < count_; ++s) {
      if (const auto parent = parent_of(s)) children_.count(*parent);
    }
    children_.allocate();
    for (std::uint32_t s = 0; s < count_; ++s) {
      if (const auto parent = parent_of(s)) children_.add(*parent, s);
    }
  }

  /// Each supernode that has a column of an entry of the block, once.
  template <typename Take>
  void for_each_owner(std::uint32_t row, std::uint32_t column, Take take) const {
    std::array<std::uint32_t, 9> owners{};
    std::size_t found = 0;
    for (std::size_t i = 0; i < 3; ++i) {
      for (std::size_t j = 0; j < 3; ++j) {
        const std::uint32_t a = position_of_[3 * std::size_t{row} + i],
                            b = position_of_[3 * std::size_t{column} + j];
        if (a == kNoUnknown || b == kNoUnknown) continue;
        const std::uint32_t owner = supernode_of_[std::min(a, b)];
        if (std::find(owners.begin(), owners.begin() + found, owner) != owners.begin() + found) continue;
        owners[found++] = owner;
        take(owner);
      }
    }
  }

  /// A node's unknowns follow each other in the factor's order.
  [[nodiscard]] std::uint32_t first_position_of(std::uint32_t node) const {
    const auto begin = position_of_.begin() + 3 * std::ptrdiff_t{node};
    return *std::min_element(begin, begin + 3);
  }

  void list_blocks(const StiffnessMatrix& stiffness) {
    const auto for_each_block = [&](auto take) {
      for (std::uint32_t column = 0; column < stiffness.nodes(); ++column) {
        const auto rows = stiffness.rows(column);
        for (std::size_t i = 0; i < rows.size(); ++i) {
          for_each_owner(rows[i], column, [&](std::uint32_t owner) {
            take(owner,
                 BlockPlace{rows[i], column, std::min(first_position_of(rows[i]), first_position_of(column)),
                            &stiffness.blocks(column)[i]});
          });
        }
      }
    };
    for_each_block([this](std::uint32_t owner, const BlockPlace&) { blocks_.count(owner); });
    blocks_.allocate();
    for_each_block([this](std::uint32_t owner, const BlockPlace& place) { blocks_.add(owner, place); });
  }

  /// What a thread keeps from one supernode to the next, and from one run to the next.
  struct Workspace {
    std::vector<std::int32_t> row_in_supernode;  // of each row of the matrix
    std::vector<Run> runs;
  };

  /// What is done to a front, in this order; from kDiagonal to kColumns once for each panel, which is so many
  /// of its own columns. Tiles do not depend on the number of threads.
  enum class Stage : std::uint8_t {
    kAssembly,      // puts its own columns together
    kDiagonal,      // factorises the panel's diagonal block
    kRows,          // finds all rows below it
    kColumns,       // takes what they make off the front's own columns to come
    kContribution,  // puts the rows below together, and takes off them what all its own columns make
  };
  struct Task {
    std::uint32_t s;
    Stage stage = Stage::kAssembly;
    std::size_t panel = 0, tile = 0;
  };

  void work(Workspace& space) {
    try {
      space.row_in_supernode.resize(supernode_of_.size());
    } catch (...) {
      fail(std::current_exception());
      return;
    }
    std::unique_lock lock(mutex_);
    while (true) {
      wait_for_work(lock);
      if (ready_.empty() || failure_) break;
      const Task task = ready_.back();
      ready_.pop_back();
      ++running_;
      lock.unlock();
      std::optional<std::size_t> failed;
      try {
        failed = compute(task, space);
      } catch (...) {
        fail(std::current_exception());
      }
      lock.lock();
      if (failed) {
        failed_column_ = std::min(failed_column_.value_or(*failed), *failed);
      } else if (small(task.s) || --tiles_left_[task.s] == 0) {
        follow(task, lock);
      }
      --running_;
      announce();
    }
  }

  [[nodiscard]] bool idle() const { return ready_.empty() && running_ > 0 && !failure_; }

  /// Until there is something to do or nothing will come any more.
  void wait_for_work(std::unique_lock<std::mutex>& lock) {
    const auto until = std::chrono::steady_clock::now() + kLooking;
    while (idle() && std::chrono::steady_clock::now() < until) {
      const unsigned seen = changes_.load(std::memory_order_relaxed);
      lock.unlock();
      constexpr int kLooks = 64;
      for (int look = 0; look < kLooks && changes_.load(std::memory_order_relaxed) == seen; ++look)
        std::this_thread::yield();
      lock.lock();
    }
    changed_.wait(lock, [this] { return !idle(); });
  }

  /// The lock is held.
  void announce() {
    changes_.fetch_add(1, std::memory_order_relaxed);
    changed_.notify_all();
  }

  void fail(std::exception_ptr failure) {
    const std::lock_guard lock(mutex_);
    if (!failure_) failure_ = std::move(failure);
    announce();
  }

  [[nodiscard]] std::size_t below_of(std::uint32_t s) const { return rows_of(s) - columns_of(s); }
  [[nodiscard]] std::size_t end_of_panel(std::uint32_t s, std::size_t panel) const {
    return std::min((panel + 1) * kPanel, columns_of(s));
  }
  /// Too little for several threads.
  [[nodiscard]] bool small(std::uint32_t s) const { return rows_of(s) <= end_of_panel(s, 0) + kTile; }

  [[nodiscard]] std::size_t tiles_of(const Task& task) const {
    const std::size_t end = end_of_panel(task.s, task.panel);
    switch (task.stage) {
      case Stage::kAssembly:
        return tiles_in(columns_of(task.s));
      case Stage::kDiagonal:
        return 1;
      case Stage::kRows:
        return tiles_in(rows_of(task.s) - end);
      case Stage::kColumns:
        return tiles_in(columns_of(task.s) - end);
      case Stage::kContribution:
        return tiles_in(below_of(task.s));
    }
    return 0;
  }

  /// The first tile of the stage that follows and has any; nothing after the last.
  [[nodiscard]] std::optional<Task> next_after(Task task) const {
    task.tile = 0;
    do {
      if (task.stage == Stage::kContribution) return std::nullopt;
      if (task.stage != Stage::kColumns) {
        task.stage = static_cast<Stage>(static_cast<int>(task.stage) + 1);
      } else if (end_of_panel(task.s, task.panel) < columns_of(task.s)) {
        task.stage = Stage::kDiagonal;
        ++task.panel;
      } else {
        task.stage = Stage::kContribution;
      }
    } while (tiles_of(task) == 0);
    return task;
  }

  /// A front's first stage; the lock is held.
  void begin(std::uint32_t s) {
    const Task first{s};
    // A small front is one piece of work.
    push_tiles(first, small(s) ? 1 : tiles_of(first));
  }

  void push_tiles(const Task& task, std::size_t tiles) {
    tiles_left_[task.s] = tiles;
    for (std::size_t tile = tiles; tile-- > 0;) ready_.push_back({task.s, task.stage, task.panel, tile});
  }

  /// What a finished stage makes possible; the lock is held, but not while memory is given back.
  void follow(const Task& done, std::unique_lock<std::mutex>& lock) {
    if (const auto next = small(done.s) ? std::nullopt : next_after(done)) {
      push_tiles(*next, tiles_of(*next));
      return;
    }
    if (!keeps_) {
      lock.unlock();
      for (const std::uint32_t child : children_[done.s]) contributions_[child].reset();
      lock.lock();
    }
    const auto parent = parent_of(done.s);
    if (parent && --children_left_[*parent] == 0) begin(*parent);
  }

  /// The column that failed, if one did. A small front is worked on to its end.
  std::optional<std::size_t> compute(const Task& task, Workspace& space) {
    if (!small(task.s)) return compute_tile(task, space);
    for (std::optional<Task> next = task; next; next = next_after(*next)) {
      for (next->tile = 0; next->tile < tiles_of(*next); ++next->tile) {
        if (const auto failed = compute_tile(*next, space)) return failed;
      }
    }
    return std::nullopt;
  }

  std::optional<std::size_t> compute_tile(const Task& task, Workspace& space) {
    const std::size_t first = task.tile * kTile, end = end_of_panel(task.s, task.panel);
    switch (task.stage) {
      case Stage::kAssembly:
        assemble(task.s, first, std::min(first + kTile, columns_of(task.s)), space);
        break;
      case Stage::kDiagonal:
        // By one thread alone, before any tile of it is written.
        if (task.panel == 0 && !contributions_[task.s])
          contributions_[task.s] = allocate_numbers(below_of(task.s) * below_of(task.s));
        return factorise_diagonal(task.s, task.panel * kPanel, end);
      case Stage::kRows:
        compute_rows(task.s, task.panel * kPanel, end, end + first);
        break;
      case Stage::kColumns:
        update_columns(task.s, task.panel * kPanel, end, end + first);
        break;
      case Stage::kContribution:
        contribute(task.s, first, space);
        break;
    }
    return std::nullopt;
  }

  /// A tile of the front's own columns, from `begin` to `end`: its part of K, and what its children leave to
  /// it.
  void assemble(std::uint32_t s, std::size_t begin, std::size_t end, Workspace& space) const {
    const std::size_t rows = rows_of(s);
    double* const block = numbers_ + first_number_[s];
    for (std::size_t j = begin; j < end; ++j) std::fill_n(block + j * rows + j, rows - j, 0.0);
    find_rows(s, space);
    add_stiffness(s, begin, end, space);
    for (const std::uint32_t child : children_[s]) extend_add(child, begin, end, space, block, rows);
  }

  void find_rows(std::uint32_t s, Workspace& space) const {
    const std::size_t rows = rows_of(s);
    const auto row_list = rows_.subspan(static_cast<std::size_t>(first_row_[s]), rows);
    for (std::size_t i = 0; i < rows; ++i)
      space.row_in_supernode[static_cast<std::size_t>(row_list[i])] = static_cast<std::int32_t>(i);
  }

  /// Adds what a child leaves to the columns of its parent's front from `begin` to `end`. Row and column 0 of
  /// the front would be at `into`, of which there are columns of `leading` numbers.
  void extend_add(std::uint32_t child, std::size_t begin, std::size_t end, Workspace& space, double* into,
                  std::size_t leading) const {
    const std::size_t own = below_of(child);
    const auto row_list = rows_.subspan(static_cast<std::size_t>(first_row_[child]) + columns_of(child), own);
    const auto target = [&](std::int64_t row) {
      return static_cast<std::size_t>(space.row_in_supernode[static_cast<std::size_t>(row)]);
    };
    // Rows ascend in the parent as they do in the child.
    std::size_t first =
        static_cast<std::size_t>(std::ranges::lower_bound(row_list, begin, {}, target) - row_list.begin());
    if (first == own || target(row_list[first]) >= end) return;
    space.runs.clear();
    for (std::size_t i = first; i < own; ++i) {
      const std::size_t at = target(row_list[i]);
      if (!space.runs.empty() && space.runs.back().into + space.runs.back().count == at) {
        ++space.runs.back().count;
      } else {
        space.runs.push_back({i, at, 1});
      }
    }
    const double* const from = contributions_[child].get();
    for (auto run = space.runs.begin(); run != space.runs.end(); ++run) {
      for (std::size_t k = 0; k < run->count && run->into + k < end; ++k) {
        const double* const from_column = from + own * (run->from + k);
        double* const into_column = into + leading * (run->into + k);
        add_run(from_column + run->from + k, into_column + run->into + k, run->count - k);
        for (auto below = run + 1; below != space.runs.end(); ++below)
          add_run(from_column + below->from, into_column + below->into, below->count);
      }
      if (run->into + run->count >= end) return;
    }
  }

  static void add_run(const double* __restrict from, double* __restrict into, std::size_t count) {
    for (std::size_t i = 0; i < count; ++i) into[i] += from[i];
  }

  [[nodiscard]] double* number(std::uint32_t s, std::size_t row, std::size_t column) const {
    return numbers_ + first_number_[s] + rows_of(s) * column + row;
  }

  /// The first column that fails, if one does.
  [[nodiscard]] std::optional<std::size_t> factorise_diagonal(std::uint32_t s, std::size_t begin,
                                                              std::size_t end) const {
    const int order = static_cast<int>(end - begin), leading = static_cast<int>(rows_of(s));
    int failed = 0;
    dpotrf_("L", &order, number(s, begin, begin), &leading, &failed);
    if (failed == 0) return std::nullopt;
    return static_cast<std::size_t>(first_column_[s] + failed - 1) + begin;
  }

  /// A tile of rows, from `first` on, of the panel of columns from `begin` to `end`.
  void compute_rows(std::uint32_t s, std::size_t begin, std::size_t end, std::size_t first) const {
    const int columns = static_cast<int>(end - begin), leading = static_cast<int>(rows_of(s)),
              count = static_cast<int>(std::min(kTile, rows_of(s) - first));
    const double one = 1;
    dtrsm_("R", "L", "T", "N", &count, &columns, &one, number(s, begin, begin), &leading,
           number(s, first, begin), &leading);
  }

  /// A tile of the front's own columns, from `first` on, takes what the panel makes.
  void update_columns(std::uint32_t s, std::size_t begin, std::size_t end, std::size_t first) const {
    const std::size_t columns = std::min(kTile, columns_of(s) - first);
    take_product_off(number(s, first, begin), rows_of(s), end - begin, columns, rows_of(s) - first - columns,
                     number(s, first, first), rows_of(s));
  }

  /// A tile of columns of what the supernode leaves to its ancestors.
  void contribute(std::uint32_t s, std::size_t first, Workspace& space) const {
    const std::size_t own = columns_of(s), below = below_of(s), columns = std::min(kTile, below - first);
    double* const contribution = contributions_[s].get();
    for (std::size_t j = first; j < first + columns; ++j)
      std::fill_n(contribution + j * below + j, below - j, 0.0);
    find_rows(s, space);
    for (const std::uint32_t child : children_[s]) {
      extend_add(child, own + first, own + first + columns, space, contribution - own * below - own, below);
    }
    take_product_off(number(s, own + first, 0), rows_of(s), own, columns, below - first - columns,
                     contribution + first * below + first, below);
  }

  /// To its own columns from `first` to `last`.
  void add_stiffness(std::uint32_t s, std::size_t first, std::size_t last, const Workspace& space) const {
    const auto begin = static_cast<std::uint32_t>(first_column_[s]) + static_cast<std::uint32_t>(first),
               end = static_cast<std::uint32_t>(first_column_[s]) + static_cast<std::uint32_t>(last);
    for (const BlockPlace& place : blocks_[s]) {
      if (place.first >= end || place.first + 2 < begin) continue;
      for (std::size_t i = 0; i < 3; ++i) {
        // Of a block on the diagonal, one triangle.
        for (std::size_t j = 0; j < (place.row == place.column ? i + 1 : 3); ++j) {
          const std::uint32_t a = position_of_[3 * std::size_t{place.row} + i];
          const std::uint32_t b = position_of_[3 * std::size_t{place.column} + j];
          if (a == kNoUnknown || b == kNoUnknown) continue;
          const auto [column, row] = std::minmax(a, b);
          if (column < begin || column >= end) continue;
          *number(s, static_cast<std::size_t>(space.row_in_supernode[row]), first + (column - begin)) =
              (*place.block)(static_cast<Eigen::Index>(i), static_cast<Eigen::Index>(j));
        }
      }
    }
  }

  std::size_t count_;
  std::span<const std::int64_t> first_column_, first_row_, first_number_, rows_;
  double* numbers_;
  std::vector<std::uint32_t> position_of_;   // of each component of (3 |V|), in the factor's order
  std::vector<std::uint32_t> supernode_of_;  // of each column
  Lists<std::uint32_t> children_;
  Lists<BlockPlace> blocks_;
  std::vector<Workspace> spaces_;  // of each thread
  /// (below x below) of each supernode, its lower triangle: what its subtree takes off the rows below it.
  std::vector<Numbers> contributions_;
  bool keeps_ = false;  // contributions, for later runs

  std::mutex mutex_;  // for all below
  std::condition_variable changed_;
  std::atomic<unsigned> changes_ = 0;         // so far in this run; read without the lock
  std::vector<std::uint32_t> children_left_;  // that are not computed yet
  std::vector<bool> chosen_;                  // those to compute: with each its ancestors
  std::vector<std::size_t> tiles_left_;       // of the stage each is in
  std::vector<Task> ready_;                   // the last is next
  std::size_t running_ = 0;
  std::optional<std::size_t> failed_column_;
  std::exception_ptr failure_;
};

SupernodalCholesky::SupernodalCholesky(const StiffnessMatrix& stiffness,
                                       std::span<const std::uint32_t> unknown_of,
                                       cholmod_factor_struct& factor)
    : work_(std::make_unique<Work>(stiffness, unknown_of, factor)) {}
SupernodalCholesky::~SupernodalCholesky() = default;

std::optional<std::size_t> SupernodalCholesky::compute(unsigned threads) {
  work_->choose_all(false);
  return work_->run(threads);
}

std::optional<std::size_t> SupernodalCholesky::recompute(std::span<const std::uint32_t> nodes,
                                                         unsigned threads) {
  if (work_->keeps()) {
    work_->choose(nodes);
  } else {
    work_->choose_all(true);
  }
  return work_->run(threads);
}

}  // namespace kiroku::sim

// The compliance of a held body where it may be touched: columns of K^-1 at chosen nodes, kept for a body
// whose stiffness stays as it is.
//
// Source: the force between two nodes of a body needs only K^-1 between them (Hirota and Kaneko,
// "Representation of soft objects in virtual environments", 1998). K^-1 is the compliance: block (i, j) is
// what a force at node j displaces node i by.
#pragma once

#include <algorithm>
#include <condition_variable>
#include <cstdint>
#include <deque>
#include <exception>
#include <memory>
#include <mutex>
#include <span>
#include <thread>
#include <vector>

#include <Eigen/Core>

#include "sim/fem/elastic_body.h"

namespace kiroku::sim {

struct ComplianceOptions {
  /// How many work on columns when they are filled at once, at least one.
  unsigned threads = std::max(std::thread::hardware_concurrency(), 1U);
  /// Columns may take so much memory; the ones not asked for longest go first. Columns that someone holds,
  /// and the ones being computed, come on top.
  std::size_t memory_bytes = std::size_t{1} << 30;
};

/// Columns of up to kGroupSize nodes that lie beside each other. Immutable.
struct ComplianceGroup {
  std::vector<std::uint32_t> nodes;  // whose columns these are, ascending
  Eigen::MatrixXd columns;           // (3 |rows| x 3 |nodes|), m/N; the rows are those of the Compliance
};

/// Thread-safe. The body must outlive it. Nodes are always computed in the same groups, so that a column has
/// the same bits whoever asks for it, when, and on however many threads.
class Compliance {
 public:
  /// The chosen nodes (each once). If the columns of all of them with a row for every node of the mesh fit
  /// the memory, they are all computed here. If not, columns have rows for the chosen nodes only and are
  /// computed when they are asked for. kiroku::Error for nodes that are not in the mesh or chosen twice, and
  /// what ElasticBody::compliance_columns() throws.
  Compliance(const ElasticBody& body, std::vector<std::uint32_t> nodes,
             const ComplianceOptions& options = {});
  ~Compliance();
  Compliance(const Compliance&) = delete;
  Compliance& operator=(const Compliance&) = delete;

  static constexpr std::size_t kGroupSize = 8;

  /// Every column is there, with a row for every node of the mesh.
  [[nodiscard]] bool complete() const { return complete_; }
  [[nodiscard]] const std::vector<std::uint32_t>& nodes() const { return nodes_; }
  /// Which nodes the rows are of: all of the mesh in their order, or the chosen ones in theirs.
  [[nodiscard]] std::size_t rows() const { return row_nodes_; }
  /// The row block of a chosen node.
  [[nodiscard]] std::size_t row_of(std::uint32_t node) const;

  /// A chosen node's columns with those of its group; computed first where they are not there.
  std::shared_ptr<const ComplianceGroup> group_of(std::uint32_t node);
  /// Where the columns of the node stand in its group.
  static Eigen::Index first_column(const ComplianceGroup& group, std::uint32_t node);
  /// The same for many nodes, those that are missing on all threads; in the order of the nodes.
  std::vector<std::shared_ptr<const ComplianceGroup>> groups_of(std::span<const std::uint32_t> nodes);

  /// Whether a chosen node's columns are there now.
  [[nodiscard]] bool available(std::uint32_t node) const;
  /// Has columns computed by a worker thread, in this order, and forgets what it was asked before and has not
  /// begun: what lies around the contact now counts. Returns at once. A failure of the worker is thrown by
  /// the next call that asks for columns.
  void prefetch(std::span<const std::uint32_t> nodes);

  struct Usage {
    std::size_t columns_bytes = 0;      // held now
    std::size_t groups_computed = 0;    // so far, by anyone
    std::size_t groups_waited_for = 0;  // of these, while someone waited for it in group_of() or groups_of()
  };
  [[nodiscard]] Usage usage() const;

 private:
  struct Slot {
    std::shared_ptr<const ComplianceGroup> group;  // absent until computed, and once it had to go
    bool computing = false;
    std::uint64_t asked_for = 0;  // when last, in calls
  };

  [[nodiscard]] std::uint32_t group_number(std::uint32_t node) const;
  [[nodiscard]] std::shared_ptr<const ComplianceGroup> compute(std::uint32_t number) const;
  std::shared_ptr<const ComplianceGroup> obtain(std::uint32_t number, bool waited_for);
  void fill(std::span<const std::uint32_t> numbers);
  void make_room();  // with the lock held
  void work();
  void rethrow_failure();  // with the lock held

  const ElasticBody& body_;
  ComplianceOptions options_;
  std::vector<std::uint32_t> nodes_;
  std::vector<std::vector<std::uint32_t>> members_;  // of each group
  std::vector<std::uint32_t> group_of_node_;         // (|V|), kNone for nodes that are not chosen
  std::vector<std::uint32_t> row_of_node_;           // (|V|), kNone where there is no row
  std::size_t row_nodes_ = 0;
  bool complete_ = false;

  mutable std::mutex mutex_;  // for all below
  std::condition_variable changed_;
  std::vector<Slot> slots_;
  std::uint64_t calls_ = 0;
  Usage usage_;
  std::deque<std::uint32_t> wanted_;  // groups, for the worker
  bool ending_ = false;
  std::exception_ptr failure_;
  std::thread worker_;  // once something was to be prefetched
};

/// Nodes in groups of at most `size`, each of nodes that lie beside each other: halved at the middle of their
/// longest extent until they are small enough. Same input, same groups.
std::vector<std::vector<std::uint32_t>> neighbouring_groups(const std::vector<Vector3>& positions_m,
                                                            std::vector<std::uint32_t> nodes,
                                                            std::size_t size);

}  // namespace kiroku::sim

#include "sim/fem/compliance.h"

#include <algorithm>
#include <atomic>
#include <limits>
#include <string>
#include <system_error>
#include <tuple>
#include <utility>

#include "base/error.h"
#include "sim/fem/background_thread.h"

namespace kiroku::sim {
namespace {

constexpr std::uint32_t kNone = std::numeric_limits<std::uint32_t>::max();

void halve(const std::vector<Vector3>& positions_m, std::span<std::uint32_t> nodes, std::size_t size,
           std::vector<std::vector<std::uint32_t>>& groups) {
  if (nodes.size() <= size) {
    groups.emplace_back(nodes.begin(), nodes.end());
    std::ranges::sort(groups.back());
    return;
  }
  Vector3 least = positions_m[nodes[0]], greatest = least;
  for (const std::uint32_t node : nodes) {
    least = least.cwiseMin(positions_m[node]);
    greatest = greatest.cwiseMax(positions_m[node]);
  }
  Eigen::Index axis = 0;
  (greatest - least).maxCoeff(&axis);
  // Whole groups on the left, so that few are left unfilled.
  const std::size_t groups_left = (nodes.size() / 2 + size - 1) / size;
  const auto middle = nodes.begin() + static_cast<std::ptrdiff_t>(groups_left * size);
  std::nth_element(nodes.begin(), middle, nodes.end(), [&](std::uint32_t a, std::uint32_t b) {
    return std::tuple(positions_m[a][axis], a) < std::tuple(positions_m[b][axis], b);
  });
  halve(positions_m, std::span(nodes.begin(), middle), size, groups);
  halve(positions_m, std::span(middle, nodes.end()), size, groups);
}

}  // namespace

std::vector<std::vector<std::uint32_t>> neighbouring_groups(const std::vector<Vector3>& positions_m,
                                                            std::vector<std::uint32_t> nodes,
                                                            std::size_t size) {
  std::vector<std::vector<std::uint32_t>> groups;
  if (!nodes.empty()) halve(positions_m, nodes, size, groups);
  return groups;
}

Compliance::Compliance(const ElasticBody& body, std::vector<std::uint32_t> nodes,
                       const ComplianceOptions& options)
    : body_(body), options_(options), nodes_(std::move(nodes)) {
  const std::size_t mesh_nodes = body_.mesh().nodes.size();
  group_of_node_.assign(mesh_nodes, kNone);
  row_of_node_.assign(mesh_nodes, kNone);
  for (const std::uint32_t node : nodes_) {
    if (node >= mesh_nodes) {
      throw Error("node " + std::to_string(node) + " is not in the mesh: it has " +
                  std::to_string(mesh_nodes) + " nodes");
    }
    if (row_of_node_[node] != kNone) {
      throw Error("node " + std::to_string(node) + " is chosen twice: name each node once");
    }
    row_of_node_[node] = static_cast<std::uint32_t>(row_nodes_++);
  }
  members_ = neighbouring_groups(body_.mesh().nodes, nodes_, kGroupSize);
  for (std::uint32_t number = 0; number < members_.size(); ++number) {
    for (const std::uint32_t node : members_[number]) group_of_node_[node] = number;
  }
  slots_.resize(members_.size());
  if (9 * sizeof(double) * mesh_nodes * nodes_.size() > options_.memory_bytes) return;
  complete_ = true;
  row_nodes_ = mesh_nodes;
  for (std::uint32_t node = 0; node < mesh_nodes; ++node) row_of_node_[node] = node;
  std::vector<std::uint32_t> all(members_.size());
  for (std::uint32_t number = 0; number < all.size(); ++number) all[number] = number;
  fill(all);
}

Compliance::~Compliance() {
  {
    const std::lock_guard lock(mutex_);
    ending_ = true;
  }
  changed_.notify_all();
  if (worker_.joinable()) worker_.join();
}

std::size_t Compliance::row_of(std::uint32_t node) const {
  if (node >= row_of_node_.size() || row_of_node_[node] == kNone) {
    throw Error("node " + std::to_string(node) + " has no row: choose it when the compliance is made");
  }
  return row_of_node_[node];
}

std::uint32_t Compliance::group_number(std::uint32_t node) const {
  if (node >= group_of_node_.size() || group_of_node_[node] == kNone) {
    throw Error("node " + std::to_string(node) + " has no columns: choose it when the compliance is made");
  }
  return group_of_node_[node];
}

Eigen::Index Compliance::first_column(const ComplianceGroup& group, std::uint32_t node) {
  return 3 * (std::ranges::lower_bound(group.nodes, node) - group.nodes.begin());
}

std::shared_ptr<const ComplianceGroup> Compliance::compute(std::uint32_t number) const {
  auto group = std::make_shared<ComplianceGroup>();
  group->nodes = members_[number];
  Eigen::MatrixXd columns = body_.compliance_columns(group->nodes);
  if (complete_) {
    group->columns = std::move(columns);
    return group;
  }
  group->columns.resize(static_cast<Eigen::Index>(3 * row_nodes_), columns.cols());
  for (Eigen::Index column = 0; column < columns.cols(); ++column) {
    for (std::size_t row = 0; row < nodes_.size(); ++row) {
      group->columns.col(column).segment<3>(static_cast<Eigen::Index>(3 * row)) =
          columns.col(column).segment<3>(static_cast<Eigen::Index>(3 * std::size_t{nodes_[row]}));
    }
  }
  return group;
}

std::shared_ptr<const ComplianceGroup> Compliance::obtain(std::uint32_t number, bool waited_for) {
  std::unique_lock lock(mutex_);
  rethrow_failure();
  Slot& slot = slots_[number];
  slot.asked_for = ++calls_;
  changed_.wait(lock, [&] { return !slot.computing; });
  if (slot.group) return slot.group;
  slot.computing = true;
  lock.unlock();
  std::shared_ptr<const ComplianceGroup> group;
  try {
    group = compute(number);
  } catch (...) {
    lock.lock();
    slot.computing = false;
    changed_.notify_all();
    throw;
  }
  lock.lock();
  slot.computing = false;
  slot.group = group;
  usage_.columns_bytes += static_cast<std::size_t>(group->columns.size()) * sizeof(double);
  ++usage_.groups_computed;
  if (waited_for) ++usage_.groups_waited_for;
  make_room();
  changed_.notify_all();
  return group;
}

void Compliance::make_room() {
  while (usage_.columns_bytes > options_.memory_bytes) {
    Slot* oldest = nullptr;
    for (Slot& slot : slots_) {
      // One that somebody holds would not free any memory.
      if (slot.group.use_count() == 1 && (oldest == nullptr || slot.asked_for < oldest->asked_for)) {
        oldest = &slot;
      }
    }
    if (oldest == nullptr) return;
    usage_.columns_bytes -= static_cast<std::size_t>(oldest->group->columns.size()) * sizeof(double);
    oldest->group.reset();
  }
}

void Compliance::fill(std::span<const std::uint32_t> numbers) {
  std::atomic<std::size_t> next = 0;
  std::mutex failure_mutex;
  std::exception_ptr failure;
  const auto take = [&] {
    try {
      for (std::size_t i = next++; i < numbers.size(); i = next++) obtain(numbers[i], true);
    } catch (...) {
      next = numbers.size();
      const std::lock_guard lock(failure_mutex);
      if (!failure) failure = std::current_exception();
    }
  };
  std::vector<std::thread> helpers;
  try {
    for (std::size_t i = 1; i < std::min<std::size_t>(options_.threads, numbers.size()); ++i)
      helpers.emplace_back(take);
  } catch (const std::system_error&) {
    // The machine gives no more threads; those that are there suffice.
  }
  take();
  for (std::thread& helper : helpers) helper.join();
  if (failure) std::rethrow_exception(failure);
}

std::shared_ptr<const ComplianceGroup> Compliance::group_of(std::uint32_t node) {
  return obtain(group_number(node), true);
}

std::vector<std::shared_ptr<const ComplianceGroup>> Compliance::groups_of(
    std::span<const std::uint32_t> nodes) {
  std::vector<std::uint32_t> missing;
  {
    const std::lock_guard lock(mutex_);
    for (const std::uint32_t node : nodes) {
      if (!slots_[group_number(node)].group) missing.push_back(group_number(node));
    }
  }
  std::ranges::sort(missing);
  missing.erase(std::unique(missing.begin(), missing.end()), missing.end());
  if (!missing.empty()) fill(missing);
  std::vector<std::shared_ptr<const ComplianceGroup>> groups;
  groups.reserve(nodes.size());
  // What was filled may have had to go again where memory is short; it is then computed once more.
  for (const std::uint32_t node : nodes) groups.push_back(group_of(node));
  return groups;
}

bool Compliance::available(std::uint32_t node) const {
  const std::lock_guard lock(mutex_);
  return slots_[group_number(node)].group != nullptr;
}

void Compliance::prefetch(std::span<const std::uint32_t> nodes) {
  {
    const std::lock_guard lock(mutex_);
    rethrow_failure();
    wanted_.clear();
    for (const std::uint32_t node : nodes) {
      const std::uint32_t number = group_number(node);
      if (slots_[number].group || slots_[number].computing) continue;
      if (std::ranges::find(wanted_, number) == wanted_.end()) wanted_.push_back(number);
    }
    if (wanted_.empty()) return;
    if (!worker_.joinable()) worker_ = std::thread([this] { work(); });
  }
  changed_.notify_all();
}

void Compliance::work() {
  work_in_background();  // force loops beside it come first; it works as well without
  std::unique_lock lock(mutex_);
  while (true) {
    changed_.wait(lock, [this] { return ending_ || !wanted_.empty(); });
    if (ending_) return;
    const std::uint32_t number = wanted_.front();
    wanted_.pop_front();
    lock.unlock();
    try {
      obtain(number, false);
    } catch (...) {
      lock.lock();
      failure_ = std::current_exception();
      wanted_.clear();
      continue;
    }
    lock.lock();
  }
}

void Compliance::rethrow_failure() {
  if (failure_) std::rethrow_exception(std::exchange(failure_, nullptr));
}

Compliance::Usage Compliance::usage() const {
  const std::lock_guard lock(mutex_);
  return usage_;
}

}  // namespace kiroku::sim

#include "evidence/hash_tree.h"

#include <algorithm>
#include <map>

#include "base/error.h"

namespace kiroku::evidence {

Bytes node_over(crypto::HashAlgorithm algorithm, HashList values) {
  if (values.size() == 1) return std::move(values.front());
  std::ranges::sort(values);
  crypto::Hasher hasher(algorithm);
  for (const Bytes& value : values) hasher.update(value);
  return hasher.so_far();
}

Bytes root_of(crypto::HashAlgorithm algorithm, const std::vector<HashList>& reduced_tree) {
  Bytes node = node_over(algorithm, reduced_tree.front());
  for (std::size_t i = 1; i < reduced_tree.size(); ++i) {
    HashList values = reduced_tree[i];
    values.push_back(std::move(node));
    node = node_over(algorithm, std::move(values));
  }
  return node;
}

HeldValues::HeldValues(const HashList& list) {
  sorted_.reserve(list.size());
  for (const Bytes& value : list) sorted_.push_back(text_of(value));
  std::ranges::sort(sorted_);
  sorted_.erase(std::unique(sorted_.begin(), sorted_.end()), sorted_.end());
}

bool HeldValues::contains(ByteView value) const {
  return std::ranges::binary_search(sorted_, text_of(value));
}

HashTree::HashTree(crypto::HashAlgorithm algorithm, std::vector<HashList> groups)
    : groups_(std::move(groups)) {
  if (groups_.empty() || std::ranges::any_of(groups_, &HashList::empty)) {
    throw UsageError("a hash tree needs at least one hash value in each of its groups");
  }
  std::vector<Bytes> leaves;
  std::map<Bytes, std::size_t> known;
  for (HashList& group : groups_) {
    std::ranges::sort(group);
    group.erase(std::unique(group.begin(), group.end()), group.end());
    Bytes node = node_over(algorithm, group);
    const auto [at, is_new] = known.emplace(node, leaves.size());
    if (is_new) leaves.push_back(std::move(node));
    leaf_of_.push_back(at->second);
  }
  levels_.push_back(std::move(leaves));
  while (levels_.back().size() > 1) {
    const std::vector<Bytes>& below = levels_.back();
    std::vector<Bytes> level;
    for (std::size_t i = 0; i < below.size(); i += 2) {
      level.push_back(i + 1 < below.size() ? node_over(algorithm, {below[i], below[i + 1]}) : below[i]);
    }
    levels_.push_back(std::move(level));
  }
}

std::vector<HashList> HashTree::reduced(std::size_t group) const {
  std::vector<HashList> path{groups_.at(group)};
  std::size_t at = leaf_of_[group];
  for (std::size_t level = 0; level + 1 < levels_.size(); ++level, at /= 2) {
    const std::size_t sibling = at ^ 1U;
    if (sibling < levels_[level].size()) path.push_back({levels_[level][sibling]});
  }
  // One value alone needs no list of its own: it joins its sibling's, or is the root.
  if (path.front().size() == 1) {
    if (path.size() == 1) return {};
    path[1].push_back(path.front().front());
    std::ranges::sort(path[1]);
    path.erase(path.begin());
  }
  return path;
}

}  // namespace kiroku::evidence

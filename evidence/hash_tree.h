// Hash trees of evidence records (RFC 4998 sections 4.2 and 4.3): one token over many groups of data objects,
// from which each group gets its own path. Pure functions and immutable values; thread-safe.
//
//                     root                 reduced tree of group A = {a1, a2}:
//                    /    \                  list 0: a1 a2          (the group's own values)
//               (A,B)      C                 list 1: node of B
//               /   \                        list 2: node of C
//         A = a1,a2  B = b1
//
// The node over several values is the hash of the values in binary ascending order, one behind the other. A
// value that is alone is its own node: it is not hashed again.
#pragma once

#include <cstddef>
#include <string_view>
#include <vector>

#include "evidence/record.h"

namespace kiroku::evidence {

/// The node over these values, at least one.
Bytes node_over(crypto::HashAlgorithm algorithm, HashList values);
/// Where a reduced tree leads: the node over its first list, added to the second one, and so on. At least one
/// list, none empty.
Bytes root_of(crypto::HashAlgorithm algorithm, const std::vector<HashList>& reduced_tree);

/// Which values a list has, in memory of 16 bytes each: whoever makes a record chooses how many. The list
/// must outlive it. Immutable; thread-safe.
class HeldValues {
 public:
  explicit HeldValues(const HashList& list);
  [[nodiscard]] bool contains(ByteView value) const;
  /// Different ones.
  [[nodiscard]] std::size_t size() const { return sorted_.size(); }

 private:
  std::vector<std::string_view> sorted_;
};

/// A binary tree over groups. Equal values of one group count once, and so do groups with one node.
class HashTree {
 public:
  /// At least one group, none empty. Throws kiroku::UsageError otherwise.
  HashTree(crypto::HashAlgorithm algorithm, std::vector<HashList> groups);
  [[nodiscard]] const Bytes& root() const { return levels_.back().front(); }
  /// The path of the group at this place among those given; empty where the root is its only value.
  [[nodiscard]] std::vector<HashList> reduced(std::size_t group) const;

 private:
  std::vector<HashList> groups_;
  std::vector<std::size_t> leaf_of_;        // of each group, in levels_[0]
  std::vector<std::vector<Bytes>> levels_;  // a node without a sibling stands in the next level, too
};

}  // namespace kiroku::evidence

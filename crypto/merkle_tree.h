// Merkle tree of RFC 6962 / RFC 9162 section 2.1 over SHA-256: leaves are hashed with prefix 0x00, nodes with
// 0x01. Functions are pure; objects are not thread-safe.
#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "base/bytes.h"
#include "crypto/hash.h"

namespace kiroku::crypto {

Sha256Digest merkle_leaf_hash(ByteView entry);
Sha256Digest merkle_node_hash(const Sha256Digest& left, const Sha256Digest& right);
/// How many nodes this thread has hashed since it began: how much work proofs were, whatever the machine.
std::uint64_t merkle_nodes_hashed();

/// The right edge of a growing tree: O(log n) memory, root at any time. Root of the empty tree is SHA-256 of
/// nothing.
class MerkleFrontier {
 public:
  /// Goes on behind `size` leaves that are known by their largest complete subtrees alone, left to right;
  /// nothing if a tree of that size has another number of them. Such are what MerkleTree::range_proof gives
  /// of the leaves left of a range, whatever the tree's size.
  static std::optional<MerkleFrontier> after(std::uint64_t size, std::vector<Sha256Digest> subtrees);

  void append(const Sha256Digest& leaf_hash);
  [[nodiscard]] std::uint64_t size() const { return size_; }
  [[nodiscard]] Sha256Digest root() const;

 private:
  std::uint64_t size_ = 0;
  std::vector<Sha256Digest> complete_subtrees_;  // sizes are the binary digits of size_, largest first
};

/// Every leaf hash and complete node in memory (64 bytes a leaf), for roots at any size and proofs in O(log
/// n) hashes. Arguments outside the stated bounds throw kiroku::UsageError.
class MerkleTree {
 public:
  void append(const Sha256Digest& leaf_hash);
  [[nodiscard]] std::uint64_t size() const { return levels_.empty() ? 0 : levels_.front().size(); }
  /// The hash of one leaf; index < size().
  [[nodiscard]] const Sha256Digest& leaf(std::uint64_t index) const { return levels_.front().at(index); }
  /// Root of the first `size` leaves; `size` ≤ size().
  [[nodiscard]] Sha256Digest root(std::uint64_t size) const;
  /// RFC 6962 2.1.1: index < size ≤ size().
  [[nodiscard]] std::vector<Sha256Digest> inclusion_proof(std::uint64_t index, std::uint64_t size) const;
  /// RFC 6962 2.1.2: 0 < old_size ≤ new_size ≤ size().
  [[nodiscard]] std::vector<Sha256Digest> consistency_proof(std::uint64_t old_size,
                                                            std::uint64_t new_size) const;
  /// The largest subtrees left of `first` and right of `last` (half open, not empty), left to right, in the
  /// tree of `size` leaves: with the leaves [first, last) they give the root.
  [[nodiscard]] std::vector<Sha256Digest> range_proof(std::uint64_t first, std::uint64_t last,
                                                      std::uint64_t size) const;

 private:
  /// RFC 6962's MTH of the leaves [first, last), a node of the tree.
  [[nodiscard]] Sha256Digest node(std::uint64_t first, std::uint64_t last) const;
  void require(bool condition, const char* what) const;

  std::vector<std::vector<Sha256Digest>> levels_;  // levels_[k][i]: leaves [i·2^k, (i+1)·2^k)
};

// Verifiers of proofs; every argument may come from an adversary. RFC 9162 2.1.3.2 and 2.1.4.2.
bool verify_inclusion(const Sha256Digest& leaf_hash, std::uint64_t index, std::uint64_t size,
                      const std::vector<Sha256Digest>& proof, const Sha256Digest& root);
bool verify_consistency(std::uint64_t old_size, const Sha256Digest& old_root, std::uint64_t new_size,
                        const Sha256Digest& new_root, const std::vector<Sha256Digest>& proof);
bool verify_range(const std::vector<Sha256Digest>& leaf_hashes, std::uint64_t first, std::uint64_t size,
                  const std::vector<Sha256Digest>& proof, const Sha256Digest& root);

}  // namespace kiroku::crypto

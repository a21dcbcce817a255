#include "crypto/merkle_tree.h"

#include <algorithm>
#include <bit>
#include <optional>
#include <string>
#include <utility>

#include "base/error.h"

namespace kiroku::crypto {
namespace {

thread_local std::uint64_t nodes_hashed = 0;

constexpr std::byte kLeafPrefix{0x00};
constexpr std::byte kNodePrefix{0x01};

// RFC 6962 section 2.1: where a node of `size` > 1 leaves divides: the largest power of two below it.
std::uint64_t split_of(std::uint64_t size) { return std::bit_floor(size - 1); }

// Walks down to the range [first, first + leaves.size()) in the order in which range_proof wrote its
// subtrees.
class RangeRecomputation {
 public:
  RangeRecomputation(const std::vector<Sha256Digest>& leaves, std::uint64_t first,
                     const std::vector<Sha256Digest>& proof)
      : leaves_(leaves), first_(first), last_(first + leaves.size()), proof_(proof) {}

  std::optional<Sha256Digest> node(std::uint64_t begin, std::uint64_t end) {
    if (end <= first_ || begin >= last_) {
      if (proof_used_ == proof_.size()) return std::nullopt;
      return proof_[proof_used_++];
    }
    if (end - begin == 1) return leaves_[begin - first_];
    const std::uint64_t middle = begin + split_of(end - begin);
    const auto left = node(begin, middle);
    if (!left) return std::nullopt;
    const auto right = node(middle, end);
    if (!right) return std::nullopt;
    return merkle_node_hash(*left, *right);
  }
  [[nodiscard]] bool proof_is_used_up() const { return proof_used_ == proof_.size(); }

 private:
  const std::vector<Sha256Digest>& leaves_;
  std::uint64_t first_, last_;
  const std::vector<Sha256Digest>& proof_;
  std::size_t proof_used_ = 0;
};

}  // namespace

Sha256Digest merkle_leaf_hash(ByteView entry) {
  thread_local Sha256 hash;
  hash.update({&kLeafPrefix, 1});
  hash.update(entry);
  return hash.finish();
}

Sha256Digest merkle_node_hash(const Sha256Digest& left, const Sha256Digest& right) {
  ++nodes_hashed;
  std::array<std::byte, 65> bytes;
  bytes[0] = kNodePrefix;
  std::ranges::copy(left, bytes.begin() + 1);
  std::ranges::copy(right, bytes.begin() + 33);
  return sha256(bytes);
}

std::uint64_t merkle_nodes_hashed() { return nodes_hashed; }

std::optional<MerkleFrontier> MerkleFrontier::after(std::uint64_t size, std::vector<Sha256Digest> subtrees) {
  if (subtrees.size() != static_cast<std::size_t>(std::popcount(size))) return std::nullopt;
  MerkleFrontier frontier;
  frontier.size_ = size;
  frontier.complete_subtrees_ = std::move(subtrees);
  return frontier;
}

void MerkleFrontier::append(const Sha256Digest& leaf_hash) {
  // Like adding one to a binary number: each 1 at the end carries, joining two subtrees of one size.
  Sha256Digest carried = leaf_hash;
  for (std::uint64_t digits = size_; (digits & 1) != 0; digits >>= 1) {
    carried = merkle_node_hash(complete_subtrees_.back(), carried);
    complete_subtrees_.pop_back();
  }
  complete_subtrees_.push_back(carried);
  ++size_;
}

Sha256Digest MerkleFrontier::root() const {
  if (complete_subtrees_.empty()) return sha256({});
  Sha256Digest result = complete_subtrees_.back();
  for (auto left = complete_subtrees_.rbegin() + 1; left != complete_subtrees_.rend(); ++left)
    result = merkle_node_hash(*left, result);
  return result;
}

void MerkleTree::append(const Sha256Digest& leaf_hash) {
  Sha256Digest completed = leaf_hash;
  for (std::size_t level = 0;; ++level) {
    if (level == levels_.size()) levels_.emplace_back();
    auto& nodes = levels_[level];
    nodes.push_back(completed);
    if (nodes.size() % 2 != 0) return;
    completed = merkle_node_hash(nodes[nodes.size() - 2], nodes.back());
  }
}

Sha256Digest MerkleTree::node(std::uint64_t first, std::uint64_t last) const {
  const std::uint64_t size = last - first;
  // Nodes begin at multiples of their rounded-up size, so that a power of two means a complete one, kept.
  if (std::has_single_bit(size)) {
    const auto level = static_cast<std::size_t>(std::countr_zero(size));
    return levels_[level][first >> level];
  }
  const std::uint64_t middle = first + split_of(size);
  return merkle_node_hash(node(first, middle), node(middle, last));
}

void MerkleTree::require(bool condition, const char* what) const {
  if (!condition)
    throw UsageError(std::string("cannot use a Merkle tree of ") + std::to_string(size()) +
                     " leaves like this: " + what);
}

Sha256Digest MerkleTree::root(std::uint64_t size) const {
  require(size <= this->size(), "the root asked for is of more leaves");
  return size == 0 ? sha256({}) : node(0, size);
}

std::vector<Sha256Digest> MerkleTree::inclusion_proof(std::uint64_t index, std::uint64_t size) const {
  require(index < size && size <= this->size(),
          "an inclusion proof needs index < size of at most all leaves");
  std::vector<Sha256Digest> proof;
  std::uint64_t first = 0;
  std::uint64_t last = size;
  while (last - first > 1) {  // top down; the proof is bottom up
    const std::uint64_t middle = first + split_of(last - first);
    if (index < middle) {
      proof.push_back(node(middle, last));
      last = middle;
    } else {
      proof.push_back(node(first, middle));
      first = middle;
    }
  }
  std::ranges::reverse(proof);
  return proof;
}

std::vector<Sha256Digest> MerkleTree::consistency_proof(std::uint64_t old_size,
                                                        std::uint64_t new_size) const {
  require(old_size > 0 && old_size <= new_size && new_size <= size(),
          "a consistency proof needs 0 < old size <= new size of at most all leaves");
  std::vector<Sha256Digest> proof;
  std::uint64_t first = 0;
  std::uint64_t last = new_size;
  bool on_left_edge = true;  // the old tree's root is known to the verifier and is not sent
  while (old_size != last) {
    const std::uint64_t middle = first + split_of(last - first);
    if (old_size <= middle) {
      proof.push_back(node(middle, last));
      last = middle;
    } else {
      proof.push_back(node(first, middle));
      first = middle;
      on_left_edge = false;
    }
  }
  if (!on_left_edge) proof.push_back(node(first, last));
  std::ranges::reverse(proof);
  return proof;
}

std::vector<Sha256Digest> MerkleTree::range_proof(std::uint64_t first, std::uint64_t last,
                                                  std::uint64_t size) const {
  require(first < last && last <= size && size <= this->size(),
          "a range proof needs first < last <= size of at most all leaves");
  struct Span {
    std::uint64_t begin, end;
  };
  std::vector<Sha256Digest> proof;
  std::vector<Span> open = {{0, size}};
  while (!open.empty()) {
    const auto [begin, end] = open.back();
    open.pop_back();
    if (end <= first || begin >= last) {
      proof.push_back(node(begin, end));
    } else if (begin < first || end > last) {
      const std::uint64_t middle = begin + split_of(end - begin);
      open.push_back({middle, end});
      open.push_back({begin, middle});
    }
  }
  return proof;
}

bool verify_inclusion(const Sha256Digest& leaf_hash, std::uint64_t index, std::uint64_t size,
                      const std::vector<Sha256Digest>& proof, const Sha256Digest& root) {
  if (index >= size) return false;
  std::uint64_t node = index;
  std::uint64_t last_node = size - 1;
  Sha256Digest result = leaf_hash;
  for (const auto& sibling : proof) {
    if (last_node == 0) return false;
    if ((node & 1) != 0 || node == last_node) {
      result = merkle_node_hash(sibling, result);
      while ((node & 1) == 0 && node != 0) {
        node >>= 1;
        last_node >>= 1;
      }
    } else {
      result = merkle_node_hash(result, sibling);
    }
    node >>= 1;
    last_node >>= 1;
  }
  return last_node == 0 && result == root;
}

bool verify_consistency(std::uint64_t old_size, const Sha256Digest& old_root, std::uint64_t new_size,
                        const Sha256Digest& new_root, const std::vector<Sha256Digest>& proof) {
  if (old_size == 0 || old_size > new_size) return false;
  if (old_size == new_size) return proof.empty() && old_root == new_root;
  // Where the old tree is complete, its root is the proof's first element, left out because it is known.
  auto next = proof.begin();
  Sha256Digest old_result = old_root;
  if (!std::has_single_bit(old_size)) {
    if (next == proof.end()) return false;
    old_result = *next++;
  }
  Sha256Digest new_result = old_result;
  std::uint64_t node = old_size - 1;
  std::uint64_t last_node = new_size - 1;
  while ((node & 1) != 0) {
    node >>= 1;
    last_node >>= 1;
  }
  for (; next != proof.end(); ++next) {
    if (last_node == 0) return false;
    if ((node & 1) != 0 || node == last_node) {
      old_result = merkle_node_hash(*next, old_result);
      new_result = merkle_node_hash(*next, new_result);
      while ((node & 1) == 0 && node != 0) {
        node >>= 1;
        last_node >>= 1;
      }
    } else {
      new_result = merkle_node_hash(new_result, *next);
    }
    node >>= 1;
    last_node >>= 1;
  }
  return last_node == 0 && old_result == old_root && new_result == new_root;
}

bool verify_range(const std::vector<Sha256Digest>& leaf_hashes, std::uint64_t first, std::uint64_t size,
                  const std::vector<Sha256Digest>& proof, const Sha256Digest& root) {
  if (leaf_hashes.empty() || first >= size || leaf_hashes.size() > size - first) return false;
  RangeRecomputation recomputation(leaf_hashes, first, proof);
  const auto result = recomputation.node(0, size);
  return result && recomputation.proof_is_used_up() && *result == root;
}

}  // namespace kiroku::crypto

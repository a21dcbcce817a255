#include "crypto/merkle_tree.h"

#include <algorithm>
#include <string>

#include <gtest/gtest.h>

#include "base/error.h"
#include "crypto/encoding.h"

namespace kiroku::crypto {
namespace {

// The reference tree and proofs of google/certificate-transparency (merkle_tree_test, merkle_verifier_test).
constexpr std::array<std::string_view, 8> kInputs = {
    "", "00", "10", "2021", "3031", "40414243", "5051525354555657", "606162636465666768696a6b6c6d6e6f"};
constexpr std::array<std::string_view, 8> kRoots = {
    "6e340b9cffb37a989ca544e6bb780a2c78901d3fb33738768511a30617afa01d",
    "fac54203e7cc696cf0dfcb42c92a1d9dbaf70ad9e621f4bd8d98662f00e3c125",
    "aeb6bcfe274b70a14fb067a5e5578264db0fa9b51af5e0ba159158f329e06e77",
    "d37ee418976dd95753c1c73862b9398fa2a2cf9b4ff0fdfe8b30cd95209614b7",
    "4e3bbb1f7b478dcfe71fb631631519a3bca12c9aefca1612bfce4c13a86264d4",
    "76e67dadbcdf1e10e1b74ddc608abd2f98dfb16fbce75277b5232a127f2087ef",
    "ddb89be403809e325750d3d263cd78929c2942b7942a34b77e122c9594a74c8c",
    "5dc9da79a70659a9ad559cb701ded9a2ab9d823aad2f4960cfe370eff4604328"};
constexpr std::string_view kLeaf1 = "96a296d224f285c67bee93c30f8a309157f0daa35dc5b87e410b78630a09cfc7";
constexpr std::string_view kLeaves2To4 = "5f083f0a1a33ca076a95279832580db3e0ef4584bdff1f54c8a360f50de3031e";
constexpr std::string_view kLeaves4To8 = "6b47aaf29ee3c2af9af889bc1fb9254dabd31177f16232dd6aab035ca39bf6e4";
constexpr std::string_view kLeaf4 = "bc1a0643b12e4d2d7c77918f44e0f4f79a838b6cf9ec5b5c283e1f4d88599e6b";
constexpr std::string_view kLeaves6To8 = "ca854ea128ed050b41b35ffc1b87b8eb2bde461e9e3b5596ece6b9d5975a0ae0";
constexpr std::string_view kLeaves4To6 = "0ebc5d3437fbe2db158b9f126a1d118e308181031d0a949f8dededebc558ef6a";

std::vector<std::string> hex_of(const std::vector<Sha256Digest>& hashes) {
  std::vector<std::string> result;
  std::ranges::transform(hashes, std::back_inserter(result), [](const auto& hash) { return to_hex(hash); });
  return result;
}

using Hex = std::vector<std::string>;

MerkleTree reference_tree() {
  MerkleTree tree;
  for (const auto input : kInputs) tree.append(merkle_leaf_hash(*from_hex(input)));
  return tree;
}

Sha256Digest leaf(std::uint64_t number) { return merkle_leaf_hash(bytes_of(std::to_string(number))); }

MerkleTree tree_of(std::uint64_t size) {
  MerkleTree tree;
  for (std::uint64_t i = 0; i < size; ++i) tree.append(leaf(i));
  return tree;
}

// The definition of RFC 6962 section 2.1, word for word and slow.
Sha256Digest defined_root(std::uint64_t first, std::uint64_t last) {
  if (first == last) return sha256({});
  if (last - first == 1) return leaf(first);
  std::uint64_t k = 1;
  while (2 * k < last - first) k *= 2;
  return merkle_node_hash(defined_root(first, first + k), defined_root(first + k, last));
}

TEST(MerkleTree, GivesThePublishedRoots) {
  const MerkleTree tree = reference_tree();
  MerkleFrontier frontier;
  const std::string empty = "e3b0c44298fc1c149afbf4c8996fb92427ae41e4649b934ca495991b7852b855";
  EXPECT_EQ(to_hex(tree.root(0)), empty);
  EXPECT_EQ(to_hex(frontier.root()), empty);
  for (std::size_t i = 0; i < kInputs.size(); ++i) {
    frontier.append(merkle_leaf_hash(*from_hex(kInputs[i])));
    EXPECT_EQ(to_hex(tree.root(i + 1)), kRoots[i]);
    EXPECT_EQ(to_hex(frontier.root()), kRoots[i]);
    EXPECT_EQ(frontier.size(), i + 1);
  }
}

TEST(MerkleTree, GivesThePublishedInclusionProofs) {
  const MerkleTree tree = reference_tree();
  EXPECT_EQ(hex_of(tree.inclusion_proof(0, 1)), Hex());
  EXPECT_EQ(hex_of(tree.inclusion_proof(0, 8)),
            (Hex{std::string(kLeaf1), std::string(kLeaves2To4), std::string(kLeaves4To8)}));
  EXPECT_EQ(hex_of(tree.inclusion_proof(5, 8)),
            (Hex{std::string(kLeaf4), std::string(kLeaves6To8), std::string(kRoots[3])}));
  EXPECT_EQ(hex_of(tree.inclusion_proof(2, 3)), (Hex{std::string(kRoots[1])}));
  EXPECT_EQ(hex_of(tree.inclusion_proof(1, 5)),
            (Hex{std::string(kRoots[0]), std::string(kLeaves2To4), std::string(kLeaf4)}));
}

TEST(MerkleTree, GivesThePublishedConsistencyProofs) {
  const MerkleTree tree = reference_tree();
  EXPECT_EQ(hex_of(tree.consistency_proof(1, 1)), Hex());
  EXPECT_EQ(hex_of(tree.consistency_proof(1, 8)),
            (Hex{std::string(kLeaf1), std::string(kLeaves2To4), std::string(kLeaves4To8)}));
  EXPECT_EQ(hex_of(tree.consistency_proof(6, 8)),
            (Hex{std::string(kLeaves4To6), std::string(kLeaves6To8), std::string(kRoots[3])}));
  EXPECT_EQ(hex_of(tree.consistency_proof(2, 5)), (Hex{std::string(kLeaves2To4), std::string(kLeaf4)}));
}

TEST(MerkleTree, AgreesWithTheDefinitionAtEverySize) {
  const MerkleTree tree = tree_of(70);
  MerkleFrontier frontier;
  for (std::uint64_t size = 0; size <= 70; ++size) {
    EXPECT_EQ(tree.root(size), defined_root(0, size)) << size;
    EXPECT_EQ(frontier.root(), tree.root(size)) << size;
    frontier.append(leaf(size));
  }
}

TEST(MerkleTree, EveryInclusionProofHoldsForItsLeafOnly) {
  constexpr std::uint64_t kSize = 35;
  const MerkleTree tree = tree_of(kSize);
  for (std::uint64_t size = 1; size <= kSize; ++size) {
    for (std::uint64_t index = 0; index < size; ++index) {
      auto proof = tree.inclusion_proof(index, size);
      const auto root = tree.root(size);
      EXPECT_TRUE(verify_inclusion(leaf(index), index, size, proof, root));
      EXPECT_FALSE(verify_inclusion(leaf(index + 1), index, size, proof, root));
      EXPECT_FALSE(verify_inclusion(leaf(index), size, size, proof, root));
      if (index > 0) {
        EXPECT_FALSE(verify_inclusion(leaf(index), index - 1, size, proof, root));
      }
      proof.push_back(leaf(0));
      EXPECT_FALSE(verify_inclusion(leaf(index), index, size, proof, root));
      proof.pop_back();
      if (!proof.empty()) {
        proof.pop_back();
        EXPECT_FALSE(verify_inclusion(leaf(index), index, size, proof, root));
      }
    }
  }
}

TEST(MerkleTree, EveryConsistencyProofHoldsForItsTreesOnly) {
  constexpr std::uint64_t kSize = 35;
  const MerkleTree tree = tree_of(kSize);
  for (std::uint64_t new_size = 1; new_size <= kSize; ++new_size) {
    for (std::uint64_t old_size = 1; old_size <= new_size; ++old_size) {
      auto proof = tree.consistency_proof(old_size, new_size);
      const auto old_root = tree.root(old_size);
      const auto new_root = tree.root(new_size);
      EXPECT_TRUE(verify_consistency(old_size, old_root, new_size, new_root, proof));
      EXPECT_FALSE(verify_consistency(old_size, leaf(99), new_size, new_root, proof));
      EXPECT_FALSE(verify_consistency(old_size, old_root, new_size, leaf(99), proof));
      EXPECT_FALSE(verify_consistency(0, old_root, new_size, new_root, proof));
      EXPECT_FALSE(verify_consistency(new_size + 1, old_root, new_size, new_root, proof));
      for (auto& hash : proof) {
        hash[0] ^= std::byte{1};
        EXPECT_FALSE(verify_consistency(old_size, old_root, new_size, new_root, proof));
        hash[0] ^= std::byte{1};
      }
      proof.push_back(leaf(0));
      EXPECT_FALSE(verify_consistency(old_size, old_root, new_size, new_root, proof));
    }
  }
}

TEST(MerkleTree, EveryRangeProofHoldsForItsLeavesOnly) {
  constexpr std::uint64_t kSize = 20;
  const MerkleTree tree = tree_of(kSize);
  for (std::uint64_t size = 1; size <= kSize; ++size) {
    for (std::uint64_t first = 0; first < size; ++first) {
      for (std::uint64_t last = first + 1; last <= size; ++last) {
        auto proof = tree.range_proof(first, last, size);
        std::vector<Sha256Digest> leaves;
        for (std::uint64_t i = first; i < last; ++i) leaves.push_back(leaf(i));
        const auto root = tree.root(size);
        EXPECT_TRUE(verify_range(leaves, first, size, proof, root));
        EXPECT_FALSE(verify_range(leaves, first, size, proof, leaf(99)));
        std::ranges::reverse(leaves);
        EXPECT_EQ(verify_range(leaves, first, size, proof, root), leaves.size() == 1);
        std::ranges::reverse(leaves);
        leaves.pop_back();  // one left out
        EXPECT_FALSE(verify_range(leaves, first, size, proof, root));
        leaves.push_back(leaf(last - 1));
        proof.push_back(leaf(0));
        EXPECT_FALSE(verify_range(leaves, first, size, proof, root));
      }
    }
  }
}

TEST(MerkleTree, AFrontierGoesOnBehindLeavesThatAreKnownBySubtreesAlone) {
  constexpr std::uint64_t kSize = 40;
  const MerkleTree tree = tree_of(kSize);
  for (std::uint64_t first = 0; first < kSize; ++first) {
    // The subtrees left of a range are the same whatever the size of the tree.
    const std::vector<Sha256Digest> left = tree.range_proof(first, kSize, kSize);
    auto frontier = MerkleFrontier::after(first, left);
    ASSERT_TRUE(frontier) << first;
    std::vector<Sha256Digest> leaves;
    for (std::uint64_t size = first + 1; size <= kSize; ++size) {
      leaves.push_back(leaf(size - 1));
      frontier->append(leaves.back());
      EXPECT_EQ(frontier->size(), size);
      EXPECT_EQ(frontier->root(), tree.root(size)) << first << " " << size;
      EXPECT_TRUE(verify_range(leaves, first, size, left, frontier->root()));
    }
    std::vector<Sha256Digest> more = left;
    more.push_back(leaf(0));
    EXPECT_FALSE(MerkleFrontier::after(first, more));
    EXPECT_FALSE(verify_range(leaves, first, kSize, more, tree.root(kSize)));
    if (!left.empty()) {
      more = left;
      more.pop_back();
      EXPECT_FALSE(MerkleFrontier::after(first, more));
      more = left;
      more.back() = leaf(99);
      auto other = MerkleFrontier::after(first, more);
      other->append(leaf(first));
      EXPECT_NE(other->root(), tree.root(first + 1));
    }
  }
}

TEST(MerkleTree, CountsTheNodesItHashes) {
  const std::uint64_t before = merkle_nodes_hashed();
  MerkleFrontier frontier;
  for (std::uint64_t i = 0; i < 8; ++i) frontier.append(leaf(i));
  EXPECT_EQ(merkle_nodes_hashed() - before, 7U);
}

TEST(MerkleTree, ProofOfOneLeafAsARangeEqualsItsInclusionProofInAnotherOrder) {
  const MerkleTree tree = tree_of(13);
  auto range = hex_of(tree.range_proof(6, 7, 13));
  auto inclusion = hex_of(tree.inclusion_proof(6, 13));
  std::ranges::sort(range);
  std::ranges::sort(inclusion);
  EXPECT_EQ(range, inclusion);
}

TEST(MerkleTree, VerifiersRefuseHostileSizes) {
  const std::uint64_t huge = ~std::uint64_t{0};
  const std::vector<Sha256Digest> proof(200, leaf(1));
  EXPECT_FALSE(verify_inclusion(leaf(0), huge - 1, huge, proof, leaf(2)));
  EXPECT_FALSE(verify_consistency(huge - 1, leaf(0), huge, leaf(1), proof));
  EXPECT_FALSE(verify_range({leaf(0), leaf(1)}, huge - 1, huge, proof, leaf(2)));
  EXPECT_FALSE(verify_range({leaf(0), leaf(1)}, huge / 2, huge, proof, leaf(2)));
  EXPECT_FALSE(verify_range({}, 0, 1, {leaf(0)}, leaf(0)));
}

TEST(MerkleTree, RefusesQuestionsOutsideItsSize) {
  const MerkleTree tree = tree_of(4);
  EXPECT_THROW(static_cast<void>(tree.root(5)), UsageError);
  EXPECT_THROW(static_cast<void>(tree.inclusion_proof(4, 4)), UsageError);
  EXPECT_THROW(static_cast<void>(tree.inclusion_proof(0, 5)), UsageError);
  EXPECT_THROW(static_cast<void>(tree.consistency_proof(0, 4)), UsageError);
  EXPECT_THROW(static_cast<void>(tree.consistency_proof(3, 2)), UsageError);
  EXPECT_THROW(static_cast<void>(tree.range_proof(2, 2, 4)), UsageError);
  EXPECT_THROW(static_cast<void>(tree.range_proof(2, 5, 4)), UsageError);
}

}  // namespace
}  // namespace kiroku::crypto

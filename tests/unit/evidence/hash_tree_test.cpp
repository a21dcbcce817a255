#include "evidence/hash_tree.h"

#include <gtest/gtest.h>

#include "base/error.h"
#include "tests/support/evidence_kit.h"

namespace kiroku::evidence {
namespace {

using crypto::HashAlgorithm;
using test::hash_of;

constexpr auto kHash = HashAlgorithm::kSha256;

Bytes joined(const Bytes& a, const Bytes& b) {
  Bytes both = std::min(a, b);
  append(both, std::max(a, b));
  return crypto::digest(kHash, both);
}

TEST(HashTree, ANodeIsTheHashOfItsValuesInBinaryAscendingOrder) {
  const Bytes low(32, std::byte{0x01});
  const Bytes high(32, std::byte{0xf0});  // a signed comparison would put it first
  EXPECT_EQ(node_over(kHash, {high, low}), joined(low, high));
  EXPECT_EQ(node_over(kHash, {low, high}), joined(low, high));
}

TEST(HashTree, AValueAloneIsItsOwnNode) {
  const Bytes value = hash_of(kHash, "a");
  EXPECT_EQ(node_over(kHash, {value}), value);
  const HashTree tree(kHash, {{value}});
  EXPECT_EQ(tree.root(), value);
  EXPECT_TRUE(tree.reduced(0).empty());
}

// RFC 4998 section 4.2.2: the first list holds the value and its siblings, each further one the next
// siblings.
TEST(HashTree, ReducesToTheSiblingsOnTheWayUp) {
  const Bytes a = hash_of(kHash, "a"), b = hash_of(kHash, "b"), c = hash_of(kHash, "c");
  const HashTree tree(kHash, {{a}, {b}, {c}});
  EXPECT_EQ(tree.root(), joined(joined(a, b), c));
  EXPECT_EQ(tree.reduced(0), (std::vector<HashList>{{std::min(a, b), std::max(a, b)}, {c}}));
  EXPECT_EQ(tree.reduced(2), (std::vector<HashList>{{std::min(c, joined(a, b)), std::max(c, joined(a, b))}}));
}

TEST(HashTree, EachPathOfAnyNumberOfGroupsLeadsToTheRoot) {
  for (std::size_t count = 1; count <= 40; ++count) {
    std::vector<HashList> groups;
    for (std::size_t i = 0; i < count; ++i) {
      HashList group;
      for (std::size_t k = 0; k <= i % 3; ++k) {
        group.push_back(hash_of(kHash, std::to_string(i) + "," + std::to_string(k)));
      }
      groups.push_back(group);
    }
    const HashTree tree(kHash, groups);
    for (std::size_t i = 0; i < count; ++i) {
      const auto path = tree.reduced(i);
      if (path.empty()) {
        EXPECT_EQ(groups[i], HashList{tree.root()});
        continue;
      }
      EXPECT_EQ(root_of(kHash, path), tree.root()) << i << " of " << count;
      for (const Bytes& value : groups[i]) EXPECT_TRUE(std::ranges::count(path.front(), value) == 1);
    }
  }
}

TEST(HashTree, TenThousandGroupsHavePathsOfFourteenValues) {
  std::vector<HashList> groups;
  for (int i = 0; i < 10'000; ++i) {
    groups.push_back({hash_of(kHash, std::to_string(i)), hash_of(kHash, "second of " + std::to_string(i))});
  }
  const HashTree tree(kHash, groups);
  const auto path = tree.reduced(4'711);
  EXPECT_EQ(path.size(), 1U + 14U);
  EXPECT_EQ(root_of(kHash, path), tree.root());
}

TEST(HashTree, GroupsAndValuesThatAreTheSameCountOnce) {
  const Bytes a = hash_of(kHash, "a"), b = hash_of(kHash, "b");
  const HashTree tree(kHash, {{a, b, a}, {b, a}, {a}});
  EXPECT_EQ(tree.reduced(0), tree.reduced(1));
  EXPECT_EQ(tree.root(), joined(joined(a, b), a));
}

TEST(HashTree, RefusesNothingAtAll) {
  EXPECT_THROW(HashTree(kHash, {}), UsageError);
  EXPECT_THROW(HashTree(kHash, {{hash_of(kHash, "a")}, {}}), UsageError);
}

TEST(HeldValuesTest, KnowsTheValuesOfAListAndHowManyDiffer) {
  const HashList list{to_bytes("b"), to_bytes("a"), to_bytes("b"), to_bytes("\xFF"), to_bytes("ab")};
  const HeldValues held(list);
  EXPECT_EQ(held.size(), 4U);
  for (const Bytes& value : list) EXPECT_TRUE(held.contains(value));
  for (const char* other : {"c", "", "aa", "a\xFF"}) EXPECT_FALSE(held.contains(to_bytes(other))) << other;
  EXPECT_FALSE(HeldValues({}).contains(to_bytes("a")));
}

}  // namespace
}  // namespace kiroku::evidence

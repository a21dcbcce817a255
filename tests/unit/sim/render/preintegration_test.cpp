#include "sim/render/preintegration.h"

#include <cmath>

#include <Eigen/Core>
#include <gtest/gtest.h>

#include "sim/render/tip_lighting.h"

namespace kiroku::sim {
namespace {

double number_of(std::uint16_t half) {
  return double{static_cast<float>(Eigen::half(Eigen::half_impl::__half_raw(half)))};
}

struct Seen {
  std::array<double, 3> colour{};
  double through = 1;
};
/// What the table has for a segment between two nodes, of another length than the table's too.
Seen by_table(const Preintegration& table, std::size_t from, std::size_t to, double length_mm) {
  const std::uint16_t* const entry = table.segments.data() + 4 * (Preintegration::kNodes * from + to);
  Seen seen;
  seen.through = std::exp2(-number_of(entry[3]) / double{Preintegration::kExtinctionScale} * length_mm);
  for (std::size_t c = 0; c < 3; ++c) seen.colour[c] = number_of(entry[c]) * (1 - seen.through);
  return seen;
}
/// The same, step by step along the ray.
Seen by_steps(const TransferFunction& transfer, double from_entry, double to_entry, double length_mm,
              bool linear) {
  constexpr int kSteps = 4000;
  Seen seen;
  for (int step = 0; step < kSteps; ++step) {
    const double entry = from_entry + (to_entry - from_entry) * (step + 0.5) / kSteps;
    const auto below = std::min(static_cast<std::size_t>(entry), kHuEntries - 2);
    const double part = entry - double(below);
    const TransferFunction::Entry &low = transfer.entries[below], &high = transfer.entries[below + 1];
    const double extinction =
        double{low.extinction_per_mm} * (1 - part) + double{high.extinction_per_mm} * part;
    const double share = 1 - std::exp2(-extinction * length_mm / kSteps);
    for (std::size_t c = 0; c < 3; ++c) {
      const double colour = double{low.colour[c]} * (1 - part) + double{high.colour[c]} * part;
      seen.colour[c] += seen.through * share * (linear ? linear_light(colour) : colour);
    }
    seen.through *= 1 - share;
  }
  return seen;
}

TEST(Preintegration, IsTheIntegralAlongARayWhoseHuRunStraight) {
  constexpr double kStepOf8Bits = 1.0 / 255;
  for (const std::string& name : transfer_function_names()) {
    const TransferFunction transfer = find_transfer_function(name);
    for (const bool linear : {false, true}) {
      for (const double length_mm : {0.3, 1.0, 4.0}) {
        const Preintegration table = preintegrate(transfer, length_mm, linear);
        double worst = 0;
        for (std::size_t from = 0; from < Preintegration::kNodes; from += 17) {
          for (std::size_t to = 0; to < Preintegration::kNodes; to += 15) {
            const Seen expected =
                by_steps(transfer, table.entry_of[from], table.entry_of[to], length_mm, linear);
            const Seen seen = by_table(table, from, to, length_mm);
            worst = std::max(worst, std::abs(seen.through - expected.through));
            for (std::size_t c = 0; c < 3; ++c)
              worst = std::max(worst, std::abs(seen.colour[c] - expected.colour[c]));
          }
        }
        EXPECT_LT(worst, kStepOf8Bits) << name << ' ' << length_mm << " mm" << (linear ? ", linear" : "");
      }
    }
  }
}

TEST(Preintegration, TakesAsMuchLightForAnyLength) {
  const TransferFunction transfer = find_transfer_function("skin");
  const Preintegration table = preintegrate(transfer, 1);
  const std::size_t air = table.node_of[0], skin = table.node_of[1024 + 100];
  for (const double length_mm : {0.1, 0.5, 2.0}) {
    EXPECT_NEAR(by_table(table, air, skin, length_mm).through,
                by_steps(transfer, table.entry_of[air], table.entry_of[skin], length_mm, false).through, 1e-3)
        << length_mm;
  }
}

TEST(Preintegration, TissueInFrontHidesTissueBehindIt) {
  const TransferFunction transfer = parse_transfer_function(
      R"({"name": "Two", "points": [{"hu": 0, "color": "#ff0000", "opacity_per_mm": 0.9},
                                    {"hu": 100, "color": "#0000ff", "opacity_per_mm": 0.9}]})",
      "two.json");
  const Preintegration table = preintegrate(transfer, 3);
  const std::size_t red = table.node_of[1024], blue = table.node_of[1024 + 100];
  const Seen from_red = by_table(table, red, blue, 3), from_blue = by_table(table, blue, red, 3);
  EXPECT_GT(from_red.colour[0], 2 * from_red.colour[2]);
  EXPECT_GT(from_blue.colour[2], 2 * from_blue.colour[0]);
  EXPECT_DOUBLE_EQ(from_red.through, from_blue.through);
}

TEST(Preintegration, KeepsWhatCannotBeSeenApartFromWhatCan) {
  for (const std::string& name : transfer_function_names()) {
    const TransferFunction transfer = find_transfer_function(name);
    const Preintegration table = preintegrate(transfer, 0.5);
    for (std::size_t entry = 0; entry < kHuEntries; ++entry) {
      if (transfer.entries[entry].extinction_per_mm > 0) continue;
      const TransferFunction::Entry& of_node = transfer.entries[table.entry_of[table.node_of[entry]]];
      ASSERT_EQ(of_node.extinction_per_mm, 0) << name << ", entry " << entry;
    }
    for (std::size_t node = 1; node < Preintegration::kNodes; ++node)
      ASSERT_LT(table.entry_of[node - 1], table.entry_of[node]) << name;
  }
}

TEST(Preintegration, RoundsHuSoThatNoneLooksOtherwise) {
  for (const std::string& name : transfer_function_names()) {
    const TransferFunction transfer = find_transfer_function(name);
    const Preintegration table = preintegrate(transfer, 0.5);
    for (std::size_t entry = 0; entry < kHuEntries; ++entry) {
      const TransferFunction::Entry &own = transfer.entries[entry],
                                    &of_node = transfer.entries[table.entry_of[table.node_of[entry]]];
      if (!(own.extinction_per_mm > 0)) continue;
      for (std::size_t c = 0; c < 3; ++c) ASSERT_NEAR(own.colour[c], of_node.colour[c], 2.0 / 255) << name;
      ASSERT_NEAR(std::sqrt(own.extinction_per_mm), std::sqrt(of_node.extinction_per_mm), 0.02) << name;
    }
  }
}

TEST(Preintegration, HasNodesForAFunctionThatNeverChanges) {
  const TransferFunction transfer = parse_transfer_function(
      R"({"name": "White", "points": [{"hu": 0, "color": "#ffffff", "opacity_per_mm": 0.1}]})", "white.json");
  const Preintegration table = preintegrate(transfer, 1);
  EXPECT_EQ(table.entry_of.front(), 0);
  EXPECT_EQ(table.entry_of.back(), kHuEntries - 1);
  EXPECT_NEAR(by_table(table, 3, 200, 2).through, 0.81, 1e-3);
  EXPECT_NEAR(by_table(table, 3, 200, 2).colour[1], 0.19, 1e-3);
}

}  // namespace
}  // namespace kiroku::sim

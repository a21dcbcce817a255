#include "sim/render/preintegration.h"

#include <algorithm>
#include <array>
#include <cmath>

#include <Eigen/Core>

#include "sim/render/tip_lighting.h"

namespace kiroku::sim {
namespace {

constexpr std::size_t kLast = kHuEntries - 1;
constexpr std::size_t kNodes = Preintegration::kNodes;

constexpr float kScale = Preintegration::kExtinctionScale;

/// Processors are slow with subnormal numbers; these are 0.
std::uint16_t half(double value) {
  constexpr double kLeastNormal = 0x1p-14;
  return value < kLeastNormal ? std::uint16_t{0} : Eigen::half(static_cast<float>(value)).x;
}

/// The extinction that a table has for it.
double shown(float extinction_per_mm) {
  const Eigen::half_impl::__half_raw raw(half(double{kScale * extinction_per_mm}));
  return double{static_cast<float>(Eigen::half(raw))} / double{kScale};
}

/// Nodes at both ends, on both sides of where tissue becomes visible, and so that as much changes between
/// each two.
std::vector<std::uint16_t> choose_nodes(const std::vector<TransferFunction::Entry>& entries) {
  std::vector<double> extinction;
  extinction.reserve(entries.size());
  for (const TransferFunction::Entry& entry : entries) extinction.push_back(shown(entry.extinction_per_mm));
  const double most = std::sqrt(*std::ranges::max_element(extinction));
  std::vector<double> changed(kHuEntries);  // up to each
  std::vector<std::size_t> borders;
  for (std::size_t i = 0; i < kLast; ++i) {
    const bool from = extinction[i] > 0, to = extinction[i + 1] > 0;
    if (from != to) borders.insert(borders.end(), {i, i + 1});
    double change = 0;
    // Roots, as much tissue that is faint is seen at once.
    if (from || to) change = std::abs(std::sqrt(extinction[i + 1]) - std::sqrt(extinction[i])) / most;
    for (std::size_t c = 0; (from || to) && c < 3; ++c)
      change = std::max(change, std::abs(double{entries[i + 1].colour[c]} - double{entries[i].colour[c]}));
    changed[i + 1] = changed[i] + change;
  }
  if (borders.size() > kNodes / 2) borders.clear();
  constexpr double kEvenly = 0.2;
  const double all = changed.back();
  for (std::size_t i = 0; i < kHuEntries; ++i) {
    const double even = double(i) / double(kLast);
    changed[i] = all > 0 ? kEvenly * even + (1 - kEvenly) * changed[i] / all : even;
  }
  std::vector<bool> is_node(kHuEntries);
  std::size_t count = 0;
  const auto mark = [&](std::size_t entry) {
    if (!is_node[entry]) ++count;
    is_node[entry] = true;
  };
  mark(0);
  mark(kLast);
  for (const std::size_t border : borders) mark(border);
  const std::size_t spread = kNodes - count;
  for (std::size_t n = 1; n <= spread; ++n) {
    const double share = double(n) / double(spread + 1);
    mark(static_cast<std::size_t>(std::ranges::lower_bound(changed, share) - changed.begin()));
  }
  // Where several fell upon one: what is still free, from the middle of the widest gap.
  std::vector<std::uint16_t> nodes;
  for (std::size_t i = 0; i < kHuEntries; ++i) {
    if (is_node[i]) nodes.push_back(static_cast<std::uint16_t>(i));
  }
  while (nodes.size() < kNodes) {
    std::size_t widest = 0;
    for (std::size_t n = 0; n + 1 < nodes.size(); ++n) {
      if (nodes[n + 1] - nodes[n] > nodes[widest + 1] - nodes[widest]) widest = n;
    }
    nodes.insert(nodes.begin() + static_cast<std::ptrdiff_t>(widest) + 1,
                 static_cast<std::uint16_t>((nodes[widest] + nodes[widest + 1]) / 2));
  }
  return nodes;
}

struct Sums {
  double extinction = 0;
  std::array<double, 3> colour{};  // times extinction
};

/// Integrals over HU from the first entry to each.
std::vector<Sums> integrals(const std::vector<TransferFunction::Entry>& entries, bool linear) {
  std::vector<Sums> sums(kHuEntries);
  const auto colour_of = [&](const TransferFunction::Entry& entry, std::size_t c) {
    return linear ? linear_light(double{entry.colour[c]}) : double{entry.colour[c]};
  };
  for (std::size_t i = 0; i < kLast; ++i) {
    const double from = shown(entries[i].extinction_per_mm), to = shown(entries[i + 1].extinction_per_mm);
    sums[i + 1] = sums[i];
    sums[i + 1].extinction += (from + to) / 2;
    for (std::size_t c = 0; c < 3; ++c) {
      sums[i + 1].colour[c] += (from * colour_of(entries[i], c) + to * colour_of(entries[i + 1], c)) / 2;
    }
  }
  return sums;
}

/// A segment in parts from its front to its end: each takes its share of what is left and gives its colour.
class Segment {
 public:
  Segment(const std::vector<Sums>& sums, std::size_t from, std::size_t to, double length_mm) {
    const bool up = to > from;
    const std::size_t apart = up ? to - from : from - to;
    count_ = std::min<std::size_t>(apart, kMostParts);
    const auto place = [&](std::size_t part) {
      const std::size_t way = (apart * part + count_ / 2) / count_;
      return up ? from + way : from - way;
    };
    for (std::size_t part = 0; part < count_; ++part) {
      const Sums &begin = sums[place(part)], &end = sums[place(part + 1)];
      const double depth = std::abs(end.extinction - begin.extinction);
      extinction_ += depth / double(apart);
      share_[part] = -std::expm1(-std::log(2.0) * depth / double(apart) * length_mm);
      for (std::size_t c = 0; c < 3; ++c)
        colour_[part][c] = depth > 0 ? std::abs(end.colour[c] - begin.colour[c]) / depth : 0;
    }
  }

  [[nodiscard]] double extinction_per_mm() const { return extinction_; }
  /// As it is seen from its front, or from its end.
  [[nodiscard]] std::array<double, 3> colour(bool from_end) const {
    double through = 1;
    std::array<double, 3> sum{};
    for (std::size_t i = 0; i < count_; ++i) {
      const std::size_t part = from_end ? count_ - 1 - i : i;
      for (std::size_t c = 0; c < 3; ++c) sum[c] += through * share_[part] * colour_[part][c];
      through *= 1 - share_[part];
    }
    for (double& c : sum) c = through < 1 ? c / (1 - through) : 0;
    return sum;
  }

 private:
  static constexpr std::size_t kMostParts = 24;
  std::size_t count_ = 0;
  double extinction_ = 0;
  std::array<double, kMostParts> share_{};
  std::array<std::array<double, 3>, kMostParts> colour_{};
};

}  // namespace

Preintegration preintegrate(const TransferFunction& transfer, double length_mm, bool linear) {
  Preintegration table;
  table.length_mm = length_mm;
  table.entry_of = choose_nodes(transfer.entries);
  table.node_of.resize(kHuEntries);
  std::size_t node = 0;
  for (std::size_t entry = 0; entry < kHuEntries; ++entry) {
    while (node + 1 < kNodes && table.entry_of[node + 1] <= entry) ++node;
    const bool up = node + 1 < kNodes && table.entry_of[node + 1] - entry < entry - table.entry_of[node];
    table.node_of[entry] = static_cast<std::uint8_t>(node + (up ? 1 : 0));
  }
  const std::vector<Sums> sums = integrals(transfer.entries, linear);
  table.segments.resize(4 * kNodes * kNodes);
  const auto put = [&](std::size_t from, std::size_t to, const std::array<double, 3>& colour,
                       double extinction) {
    std::uint16_t* const entry = table.segments.data() + 4 * (kNodes * from + to);
    for (std::size_t c = 0; c < 3; ++c) entry[c] = half(colour[c]);
    entry[3] = half(double{kScale} * extinction);
  };
  for (std::size_t from = 0; from < kNodes; ++from) {
    const TransferFunction::Entry& still = transfer.entries[table.entry_of[from]];
    std::array<double, 3> colour{};
    for (std::size_t c = 0; c < 3; ++c)
      colour[c] = linear ? linear_light(double{still.colour[c]}) : double{still.colour[c]};
    put(from, from, colour, double{still.extinction_per_mm});
    for (std::size_t to = from + 1; to < kNodes; ++to) {
      const Segment segment(sums, table.entry_of[from], table.entry_of[to], length_mm);
      put(from, to, segment.colour(false), segment.extinction_per_mm());
      put(to, from, segment.colour(true), segment.extinction_per_mm());
    }
  }
  return table;
}

}  // namespace kiroku::sim

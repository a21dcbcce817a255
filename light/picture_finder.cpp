#include "light/picture_finder.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <numeric>
#include <optional>
#include <utility>

#include "light/light_code.h"

namespace kiroku::light {
namespace {

constexpr int kFrameRows = kRows + 2, kFrameColumns = kColumns + 2;
constexpr float kLeastContrast = 10;

/// A picture's value between its pixels.
float value_at(const GreyView& picture, double x, double y) {
  const int left = static_cast<int>(x), top = static_cast<int>(y);
  const auto fx = static_cast<float>(x - left), fy = static_cast<float>(y - top);
  const std::uint8_t* const row = picture.samples + top * picture.stride + left;
  const std::uint8_t* const next = row + picture.stride;
  const float upper = static_cast<float>(row[0]) * (1 - fx) + static_cast<float>(row[1]) * fx;
  const float lower = static_cast<float>(next[0]) * (1 - fx) + static_cast<float>(next[1]) * fx;
  return upper * (1 - fy) + lower * fy;
}

bool is_inside(const GreyView& picture, const Point& at) {
  return at.x >= 0 && at.y >= 0 && at.x < picture.width - 1 && at.y < picture.height - 1;
}

/// From the frame's own coordinates, 0 to 1 between its outer corners, to the picture: the projective map of
/// a square to a quadrangle (Heckbert 1989, Fundamentals of Texture Mapping and Image Warping,
/// section 2.2.3).
class Projection {
 public:
  explicit Projection(const Place& q) {
    const double dx1 = q[1].x - q[2].x, dx2 = q[3].x - q[2].x;
    const double dy1 = q[1].y - q[2].y, dy2 = q[3].y - q[2].y;
    const double sx = q[0].x - q[1].x + q[2].x - q[3].x, sy = q[0].y - q[1].y + q[2].y - q[3].y;
    const double divisor = dx1 * dy2 - dx2 * dy1;
    if (std::abs(divisor) < 1e-9) return;
    g_ = (sx * dy2 - dx2 * sy) / divisor;
    h_ = (dx1 * sy - sx * dy1) / divisor;
    a_ = q[1].x - q[0].x + g_ * q[1].x;
    b_ = q[3].x - q[0].x + h_ * q[3].x;
    c_ = q[0].x;
    d_ = q[1].y - q[0].y + g_ * q[1].y;
    e_ = q[3].y - q[0].y + h_ * q[3].y;
    f_ = q[0].y;
    is_valid_ = true;
  }
  [[nodiscard]] bool is_valid() const { return is_valid_; }
  [[nodiscard]] Point at(double u, double v) const {
    const double w = g_ * u + h_ * v + 1;
    return {(a_ * u + b_ * v + c_) / w, (d_ * u + e_ * v + f_) / w};
  }

 private:
  double a_ = 0, b_ = 0, c_ = 0, d_ = 0, e_ = 0, f_ = 0, g_ = 0, h_ = 0;
  bool is_valid_ = false;
};

/// Row and column in cells of the frame, whose outer edge is 0; NaN outside the picture.
float mean_at(const GreyView& picture, const Projection& projection, double row, double column) {
  constexpr std::array kOffsets{-0.22, 0.0, 0.22};
  float sum = 0;
  for (const double down : kOffsets) {
    for (const double across : kOffsets) {
      const Point at = projection.at((column + across) / kFrameColumns, (row + down) / kFrameRows);
      if (!is_inside(picture, at)) return std::nanf("");
      sum += value_at(picture, at.x, at.y);
    }
  }
  return sum / static_cast<float>(kOffsets.size() * kOffsets.size());
}

float middle_of(std::vector<float> values) {
  const auto low = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 8);
  std::nth_element(values.begin(), low, values.end());
  const float dark = *low;
  const auto high = values.end() - 1 - static_cast<std::ptrdiff_t>(values.size() / 8);
  std::nth_element(values.begin(), high, values.end());
  return (dark + *high) / 2;
}

/// How much of a cell its neighbours at one side have: where cells are random, as those of a code are, the
/// mean product of neighbours is twice that share.
float share_of_neighbours(const std::vector<float>& grid, int step_row, int step_column) {
  float products = 0, squares = 0;
  for (int row = 1; row <= kRows - step_row; ++row) {
    for (int column = 1; column <= kColumns - step_column; ++column) {
      const auto at = static_cast<std::size_t>(row * kFrameColumns + column);
      const auto next = static_cast<std::size_t>((row + step_row) * kFrameColumns + column + step_column);
      products += grid[at] * grid[next];
      squares += (grid[at] * grid[at] + grid[next] * grid[next]) / 2;
    }
  }
  return squares > 0 ? std::clamp(products / squares / 2, 0.0F, 0.3F) : 0;
}

/// How much of a cell each of its neighbours has, by what a lens and a coding spread.
struct Spread {
  float across = 0, down = 0;
};

/// A picture's cells at a place with the frame's around them, kFrameRows x kFrameColumns, from the middle
/// between bright and dark. Nothing of a place that is not wholly in the picture.
std::vector<float> grid_at(const GreyView& picture, const Projection& projection) {
  std::vector<float> grid;
  grid.reserve(kFrameRows * kFrameColumns);
  for (int row = 0; row < kFrameRows; ++row) {
    for (int column = 0; column < kFrameColumns; ++column) {
      const float mean = mean_at(picture, projection, row + 0.5, column + 0.5);
      if (std::isnan(mean)) return {};
      grid.push_back(mean);
    }
  }
  std::vector<float> inner;
  for (int row = 1; row <= kRows; ++row)
    for (int column = 1; column <= kColumns; ++column)
      inner.push_back(grid[static_cast<std::size_t>(row * kFrameColumns + column)]);
  const float middle = middle_of(inner);
  for (float& value : grid) value -= middle;
  return grid;
}

Spread spread_of(const std::vector<float>& grid) {
  return {share_of_neighbours(grid, 0, 1), share_of_neighbours(grid, 1, 0)};
}

/// The cells within the frame, kRows x kColumns, without what was spread from each to the next ones, the
/// frame among them.
std::vector<float> sharpened(const std::vector<float>& seen, const Spread& spread) {
  std::vector<float> grid = seen;
  // The inverse of the spreading, as a series: each round starts from what was seen.
  constexpr int kRounds = 3;
  for (int round = 0; round < kRounds; ++round) {
    const std::vector<float> before = grid;
    for (int row = 1; row <= kRows; ++row) {
      for (int column = 1; column <= kColumns; ++column) {
        const auto at = static_cast<std::size_t>(row * kFrameColumns + column);
        grid[at] = seen[at] - spread.across * (before[at - 1] + before[at + 1]) -
                   spread.down * (before[at - kFrameColumns] + before[at + kFrameColumns]);
      }
    }
  }
  std::vector<float> cells;
  cells.reserve(kCells);
  for (int row = 1; row <= kRows; ++row)
    for (int column = 1; column <= kColumns; ++column)
      cells.push_back(grid[static_cast<std::size_t>(row * kFrameColumns + column)]);
  return cells;
}

/// What says how well a place fits: the frame, the dark margin around it, and the cells.
struct Look {
  std::vector<float> grid;      // kFrameRows x kFrameColumns, as seen
  std::vector<float> cells;     // kRows x kColumns, sharpened
  float frame = 0, margin = 0;  // means
  float bordered = 0;           // share of the frame's cells that are brighter than the margin beside them
  [[nodiscard]] bool is_whole() const { return !cells.empty(); }
  [[nodiscard]] float between_pairs() const {
    float sum = 0;
    for (std::size_t bit = 0; bit < kCodeBits; ++bit) sum += std::abs(cells[bit] - cells[kCells - 1 - bit]);
    return sum / kCodeBits;
  }
  [[nodiscard]] float score() const { return is_whole() ? between_pairs() + frame - margin : -1e9F; }
};

Look look_at(const GreyView& picture, const Place& place) {
  Look look;
  const Projection projection(place);
  if (!projection.is_valid()) return look;
  float frame = 0, margin = 0;
  int count = 0, bordered = 0;
  const auto edge = [&](double row, double column, double row_outside, double column_outside) {
    const float inside = mean_at(picture, projection, row, column);
    const float outside = mean_at(picture, projection, row_outside, column_outside);
    frame += inside;
    margin += outside;
    bordered += inside > outside + kLeastContrast / 2 ? 1 : 0;
    ++count;
  };
  for (int column = 0; column < kFrameColumns; ++column) {
    edge(0.5, column + 0.5, -0.6, column + 0.5);
    edge(kFrameRows - 0.5, column + 0.5, kFrameRows + 0.6, column + 0.5);
  }
  for (int row = 1; row < kFrameRows - 1; ++row) {
    edge(row + 0.5, 0.5, row + 0.5, -0.6);
    edge(row + 0.5, kFrameColumns - 0.5, row + 0.5, kFrameColumns + 0.6);
  }
  look.frame = frame / static_cast<float>(count);
  look.margin = margin / static_cast<float>(count);
  look.bordered = static_cast<float>(bordered) / static_cast<float>(count);
  if (std::isnan(look.frame) || std::isnan(look.margin)) return look;
  look.grid = grid_at(picture, projection);
  if (!look.grid.empty()) look.cells = sharpened(look.grid, spread_of(look.grid));
  return look;
}

/// Corners to a fraction of a cell, from where they were about.
Place refined(const GreyView& picture, const Place& from) {
  // How all corners move together, and each alone.
  static constexpr std::array<std::array<std::array<double, 2>, 4>, 14> kMoves{
      {{{{1, 0}, {1, 0}, {1, 0}, {1, 0}}},
       {{{0, 1}, {0, 1}, {0, 1}, {0, 1}}},
       {{{-1, 0}, {1, 0}, {1, 0}, {-1, 0}}},
       {{{0, -1}, {0, -1}, {0, 1}, {0, 1}}},
       {{{-1, -1}, {1, -1}, {1, 1}, {-1, 1}}},
       {{{0, -1}, {0, 1}, {0, 1}, {0, -1}}},
       {{{1, 0}, {0, 0}, {0, 0}, {0, 0}}},
       {{{0, 1}, {0, 0}, {0, 0}, {0, 0}}},
       {{{0, 0}, {1, 0}, {0, 0}, {0, 0}}},
       {{{0, 0}, {0, 1}, {0, 0}, {0, 0}}},
       {{{0, 0}, {0, 0}, {1, 0}, {0, 0}}},
       {{{0, 0}, {0, 0}, {0, 1}, {0, 0}}},
       {{{0, 0}, {0, 0}, {0, 0}, {1, 0}}},
       {{{0, 0}, {0, 0}, {0, 0}, {0, 1}}}}};
  Place best = from;
  float score = look_at(picture, best).score();
  const double cell = std::hypot(from[3].x - from[0].x, from[3].y - from[0].y) / kFrameRows;
  for (const double share : {0.5, 0.25, 0.12}) {
    constexpr int kMostRounds = 4;
    bool is_better = true;
    for (int round = 0; is_better && round < kMostRounds; ++round) {
      is_better = false;
      for (const auto& move : kMoves) {
        for (const double step : {share * cell, -share * cell}) {
          Place tried = best;
          for (std::size_t i = 0; i < tried.size(); ++i) {
            tried[i].x += move[i][0] * step;
            tried[i].y += move[i][1] * step;
          }
          const float now = look_at(picture, tried).score();
          if (now <= score) continue;
          score = now;
          best = tried;
          is_better = true;
        }
      }
    }
  }
  return best;
}

/// For each view but the first and each bit, the cell that it is read from.
std::array<std::array<int, kCodeBits>, kViews - 1> cells_of_views() {
  std::array<std::array<int, kCodeBits>, kViews - 1> views{};
  constexpr std::array<std::array<int, 2>, kViews - 1> kDirections{
      {{1, 0}, {1, 1}, {0, 1}, {-1, 1}, {-1, 0}, {-1, -1}, {0, -1}, {1, -1}}};
  for (std::size_t view = 0; view < views.size(); ++view) {
    for (int bit = 0; bit < kCodeBits; ++bit) {
      // From the centre, in shares of half the width and half the height, times 14.
      const int right = 2 * (bit % kColumns) - (kColumns - 1);
      const int down = 2 * (2 * (bit / kColumns) - (kRows - 1));
      const int towards = right * kDirections[view][0] + down * kDirections[view][1];
      // A line through cells themselves leaves one of each pair all the same.
      const bool first = towards > 0 || (towards == 0 && view < views.size() / 2);
      views[view][static_cast<std::size_t>(bit)] = first ? bit : kCells - 1 - bit;
    }
  }
  return views;
}

/// As in Sighting.
double clarity_of(const std::vector<float>& cells, float middle) {
  std::vector<float> apart;
  apart.reserve(cells.size());
  for (const float cell : cells) apart.push_back(std::abs(cell - middle));
  const float mean = std::accumulate(apart.begin(), apart.end(), 0.0F) / kCells;
  const auto near = apart.begin() + kCells / 10;
  std::nth_element(apart.begin(), near, apart.end());
  return mean > 0 ? *near / mean : 0;
}
int opposite_in(const std::vector<float>& cells, float middle) {
  int opposite = 0;
  for (std::size_t bit = 0; bit < kCodeBits; ++bit)
    opposite += (cells[bit] > middle) != (cells[kCells - 1 - bit] > middle) ? 1 : 0;
  return opposite;
}

Sighting sighting_of(const std::vector<float>& cells) {
  static const auto kCellsOfViews = cells_of_views();
  Sighting sighting;
  const float middle = middle_of(cells);
  float bright = 0, dark = 0;
  int count_bright = 0;
  for (const float cell : cells) {
    (cell > middle ? bright : dark) += cell;
    count_bright += cell > middle ? 1 : 0;
  }
  sighting.clarity = clarity_of(cells, middle);
  sighting.opposite = opposite_in(cells, middle);
  if (count_bright > 0 && count_bright < kCells) {
    sighting.contrast =
        bright / static_cast<float>(count_bright) - dark / static_cast<float>(kCells - count_bright);
  }
  for (std::size_t bit = 0; bit < kCodeBits; ++bit) {
    const float here = cells[bit], there = cells[kCells - 1 - bit];
    sighting.words[0] = sighting.words[0] << 1U | (here > there ? 1U : 0U);
  }
  for (std::size_t view = 0; view < kCellsOfViews.size(); ++view) {
    std::vector<float> half;
    for (const int cell : kCellsOfViews[view]) half.push_back(cells[static_cast<std::size_t>(cell)]);
    const float between = middle_of(half);
    std::uint64_t& word = sighting.words[view + 1];
    for (std::size_t bit = 0; bit < kCodeBits; ++bit) {
      const bool is_opposite = kCellsOfViews[view][bit] >= kCodeBits;
      word = word << 1U | ((half[bit] > between) != is_opposite ? 1U : 0U);
    }
  }
  return sighting;
}

constexpr int kOppositeOfPlace = 45;
/// So few are no code's: of anything else a half are opposite, 24 or 25, by chance.
constexpr int kOppositeOfNothing = 36;
constexpr float kBorderedOfPlace = 0.8F;

/// What a place that is known shows. Cells of one code are alike by chance, as if a lens had spread them, and
/// what was spread is misjudged then. Of a code that is seen whole each pair of cells is opposite: that tells
/// what fits better. Nothing where the place is not wholly in the picture.
std::optional<Sighting> best_sighting(const std::vector<float>& grid) {
  if (grid.empty()) return std::nullopt;
  const Sighting estimated = sighting_of(sharpened(grid, spread_of(grid)));
  constexpr int kNearlyAll = kCodeBits - 2;
  if (estimated.opposite >= kNearlyAll) return estimated;
  constexpr std::array kShares{0.0F, 0.06F, 0.12F, 0.18F, 0.24F};
  int most_opposite = estimated.opposite;
  double clearest = estimated.clarity;
  std::vector<float> best;
  for (const float across : kShares) {
    for (const float down : kShares) {
      std::vector<float> tried = sharpened(grid, {across, down});
      const float middle = middle_of(tried);
      const int opposite = opposite_in(tried, middle);
      if (opposite < most_opposite) continue;
      const double clarity = clarity_of(tried, middle);
      if (opposite == most_opposite && clarity <= clearest) continue;
      most_opposite = opposite;
      clearest = clarity;
      best = std::move(tried);
    }
  }
  // Where something covers a side, half the pairs are opposite by chance, whatever was spread.
  if (best.empty() || most_opposite < kOppositeOfPlace) return estimated;
  // How sure it is stays as it was estimated: of many tries one makes a clear code of a plain gradient. Such
  // a code may agree with the ledger, and accuses nobody.
  Sighting sighting = estimated;
  sighting.words = sighting_of(best).words;
  return sighting;
}

bool is_code(const Look& look, const Sighting& sighting) {
  return look.frame - look.margin >= kLeastContrast && look.bordered >= kBorderedOfPlace &&
         sighting.opposite >= kOppositeOfPlace && sighting.contrast >= kLeastContrast;
}
/// By what was spread as it is estimated: of many tries one makes a code of a plain gradient.
bool is_code(const Look& look) { return look.is_whole() && is_code(look, sighting_of(look.cells)); }

/// The place of a code of which the blob at `about` is the frame; nothing where there is none. A lamp's
/// reflection in the display lights the dark margin at a side or a corner, and the blob reaches farther
/// there. `most_opposite`: of all tries, as in Sighting.
std::optional<Place> found_at(const GreyView& picture, const Place& about, int& most_opposite) {
  constexpr double kReach = 1.2;  // cells
  // Which corners are farther out: none, one, or the two of a side.
  constexpr std::array<unsigned, 9> kFarther{0, 1, 2, 4, 8, 3, 6, 12, 9};
  for (const unsigned farther : kFarther) {
    Place start = about;
    for (std::size_t i = 0; i < start.size(); ++i) {
      if ((farther >> i & 1U) == 0) continue;
      const Point &along = about[i ^ 1U], &across = about[3 - i], &corner = about[i];
      const bool is_alone = std::has_single_bit(farther);
      const bool moves_along = is_alone || farther == 6 || farther == 9;
      const bool moves_across = is_alone || farther == 3 || farther == 12;
      if (moves_along) {
        start[i].x += (along.x - corner.x) / kFrameColumns * kReach;
        start[i].y += (along.y - corner.y) / kFrameColumns * kReach;
      }
      if (moves_across) {
        start[i].x += (across.x - corner.x) / kFrameRows * kReach;
        start[i].y += (across.y - corner.y) / kFrameRows * kReach;
      }
    }
    const Place place = refined(picture, start);
    const Look look = look_at(picture, place);
    if (look.is_whole()) {
      const Sighting sighting = sighting_of(look.cells);
      if (is_code(look, sighting)) return place;
      most_opposite = std::max(most_opposite, sighting.opposite);
    }
    // What has no dark margin at most of its edge is no code from wherever one starts.
    constexpr float kPromising = 0.7F;
    if (farther == 0 && look.bordered < kPromising) return std::nullopt;
  }
  return std::nullopt;
}

/// Connected bright pixels, as far as they say where a quadrangle's corners are.
struct Blob {
  // Farthest to the left, right, top, bottom, and to the four corners.
  Point left{1e9, 0}, right{-1e9, 0}, top{0, 1e9}, bottom{0, -1e9};
  Point top_left{1e9, 1e9}, bottom_right{-1e9, -1e9}, top_right{-1e9, 1e9}, bottom_left{1e9, -1e9};

  void add(double x, double y) {
    const Point at{x, y};
    if (x < left.x) left = at;
    if (x > right.x) right = at;
    if (y < top.y) top = at;
    if (y > bottom.y) bottom = at;
    if (x + y < top_left.x + top_left.y) top_left = at;
    if (x + y > bottom_right.x + bottom_right.y) bottom_right = at;
    if (x - y > top_right.x - top_right.y) top_right = at;
    if (x - y < bottom_left.x - bottom_left.y) bottom_left = at;
  }
  void add(const Blob& other) {
    for (const Point& at : {other.left, other.right, other.top, other.bottom, other.top_left,
                            other.bottom_right, other.top_right, other.bottom_left})
      add(at.x, at.y);
  }
};

double area_of(const Place& place) {
  double area = 0;
  for (std::size_t i = 0; i < place.size(); ++i) {
    const Point& a = place[i];
    const Point& b = place[(i + 1) % place.size()];
    area += a.x * b.y - b.x * a.y;
  }
  return area / 2;
}

/// Where a code could lie of which the blob is the frame.
std::optional<Place> place_of(const Blob& blob, int height) {
  const Place upright{blob.top_left, blob.top_right, blob.bottom_right, blob.bottom_left};
  const Place tilted{blob.left, blob.top, blob.right, blob.bottom};
  Place place = area_of(upright) >= area_of(tilted) ? upright : tilted;
  const auto side = [&](std::size_t i) {
    const Point &a = place[i], &b = place[(i + 1) % 4];
    return std::hypot(b.x - a.x, b.y - a.y);
  };
  if (side(0) + side(2) < side(1) + side(3)) std::rotate(place.begin(), place.begin() + 1, place.end());
  const double across = (side(0) + side(2)) / 2, down = (side(1) + side(3)) / 2;
  constexpr double kNarrowest = 1.1, kWidest = 2.6;  // 16:9, seen from the side
  if (down < PictureFinder::kLeastHeight - 2 || down > height / 2.0 || across < kNarrowest * down ||
      across > kWidest * down)
    return std::nullopt;
  // Pixels' centres, half a pixel within the edge.
  const Point centre{(place[0].x + place[1].x + place[2].x + place[3].x) / 4,
                     (place[0].y + place[1].y + place[2].y + place[3].y) / 4};
  for (Point& corner : place) {
    const double length = std::hypot(corner.x - centre.x, corner.y - centre.y);
    if (length < 1) return std::nullopt;
    corner.x += (corner.x - centre.x) / length * 0.7;
    corner.y += (corner.y - centre.y) / length * 0.7;
  }
  return place;
}

/// Blobs of pixels that are brighter than what is around them.
std::vector<Blob> bright_blobs(const GreyView& picture) {
  const int width = picture.width, height = picture.height;
  constexpr int kRadius = 12, kBrighter = 6;
  struct Run {
    int begin = 0, end = 0;
    std::size_t blob = 0;
  };
  std::vector<std::size_t> parents;
  std::vector<Blob> blobs;
  const auto root_of = [&](std::size_t of) {
    while (parents[of] != of) of = parents[of] = parents[parents[of]];
    return of;
  };
  // Sums of columns over the rows around the one that is looked at.
  std::vector<std::uint32_t> columns(static_cast<std::size_t>(width), 0);
  std::vector<std::uint32_t> sums(static_cast<std::size_t>(width) + 1, 0);
  const auto add_row = [&](int row, bool remove) {
    const std::uint8_t* const samples = picture.samples + row * picture.stride;
    for (int x = 0; x < width; ++x) {
      std::uint32_t& sum = columns[static_cast<std::size_t>(x)];
      sum = remove ? sum - samples[x] : sum + samples[x];
    }
  };
  for (int row = 0; row < std::min(kRadius, height); ++row) add_row(row, false);
  std::vector<Run> above, here;
  for (int y = 0; y < height; ++y) {
    if (y + kRadius < height) add_row(y + kRadius, false);
    if (y - kRadius - 1 >= 0) add_row(y - kRadius - 1, true);
    std::partial_sum(columns.begin(), columns.end(), sums.begin() + 1);
    const std::uint32_t rows =
        static_cast<std::uint32_t>(std::min(y + kRadius, height - 1) - std::max(y - kRadius, 0) + 1);
    const std::uint8_t* const samples = picture.samples + y * picture.stride;
    here.clear();
    std::size_t over = 0;
    for (int x = 0; x < width; ++x) {
      const int from = std::max(x - kRadius, 0), to = std::min(x + kRadius + 1, width);
      const std::uint32_t sum = sums[static_cast<std::size_t>(to)] - sums[static_cast<std::size_t>(from)];
      const std::uint32_t count = rows * static_cast<std::uint32_t>(to - from);
      if ((samples[x] - std::uint32_t{kBrighter}) * count <= sum || samples[x] < kBrighter) continue;
      if (here.empty() || here.back().end != x) here.push_back({x, x, SIZE_MAX});
      here.back().end = x + 1;
    }
    for (Run& run : here) {
      while (over < above.size() && above[over].end < run.begin) ++over;
      for (std::size_t i = over; i < above.size() && above[i].begin <= run.end; ++i) {
        const std::size_t other = root_of(above[i].blob);
        if (run.blob == SIZE_MAX) {
          run.blob = other;
        } else if (const std::size_t own = root_of(run.blob); own != other) {
          blobs[own].add(blobs[other]);
          parents[other] = own;
        }
      }
      if (run.blob == SIZE_MAX) {
        run.blob = blobs.size();
        parents.push_back(run.blob);
        blobs.emplace_back();
      }
      Blob& blob = blobs[root_of(run.blob)];
      blob.add(run.begin, y);
      blob.add(run.end - 1, y);
    }
    std::swap(above, here);
  }
  std::vector<Blob> roots;
  for (std::size_t i = 0; i < blobs.size(); ++i) {
    if (parents[i] == i) roots.push_back(blobs[i]);
  }
  return roots;
}

Point centre_of(const Place& place) {
  return {(place[0].x + place[1].x + place[2].x + place[3].x) / 4,
          (place[0].y + place[1].y + place[2].y + place[3].y) / 4};
}

bool overlap(const Place& a, const Place& b) {
  const Point centre = centre_of(a), other = centre_of(b);
  return std::hypot(centre.x - other.x, centre.y - other.y) <
         std::hypot(a[2].x - a[0].x, a[2].y - a[0].y) / 3;
}

}  // namespace

PictureFinder::PictureFinder(std::span<const Place> known)
    : places_(known.begin(),
              known.begin() + static_cast<std::ptrdiff_t>(std::min(known.size(), kMostPlaces))) {}

// A code becomes another one each second, and a half of its cells with it: cells of a contrast that can be
// read then differ by 5 in the mean.
bool PictureFinder::looks_as_refused(const Refused& now) const {
  constexpr double kMostMoved = 2;  // pixels
  constexpr float kMostChanged = 2;
  return std::ranges::any_of(refused_, [&](const Refused& before) {
    for (std::size_t i = 0; i < now.about.size(); ++i) {
      if (std::hypot(now.about[i].x - before.about[i].x, now.about[i].y - before.about[i].y) > kMostMoved)
        return false;
    }
    float changed = 0;
    for (std::size_t i = 0; i < now.cells.size(); ++i) changed += std::abs(now.cells[i] - before.cells[i]);
    return changed <= kMostChanged * static_cast<float>(now.cells.size()) &&
           std::abs(now.frame - before.frame) <= kMostChanged &&
           std::abs(now.margin - before.margin) <= kMostChanged;
  });
}

void PictureFinder::search(const GreyView& picture) {
  if (picture.width < 4 * kLeastHeight || picture.height < 2 * kLeastHeight) return;
  constexpr int kMostRefined = 24;
  constexpr std::size_t kMostRefused = 64;
  int refined_places = 0;
  const auto keep = [&](const Place& found) {
    std::erase_if(places_, [&](const Place& known) { return overlap(known, found); });
    if (places_.size() >= kMostPlaces) places_.erase(places_.begin());
    places_.push_back(found);
  };
  // Those that show a code as they are need no second look.
  std::vector<Place> shown;
  for (const Place& known : std::vector<Place>(places_)) {
    if (!is_code(look_at(picture, known))) continue;
    keep(known);
    shown.push_back(known);
  }
  std::vector<Refused> refused;
  for (const Blob& blob : bright_blobs(picture)) {
    const std::optional<Place> about = place_of(blob, picture.height);
    if (!about) continue;
    if (std::any_of(shown.begin(), shown.end(), [&](const Place& known) { return overlap(known, *about); }))
      continue;
    const Look look = look_at(picture, *about);
    constexpr float kLeastEdge = 5;
    if (!look.is_whole() || look.frame - look.margin < kLeastEdge || look.between_pairs() < kLeastEdge)
      continue;
    Refused now{*about, look.cells, look.frame, look.margin};
    if (looks_as_refused(now)) {
      if (refused.size() < kMostRefused) refused.push_back(std::move(now));
      continue;
    }
    if (++refined_places > kMostRefined) break;
    int most_opposite = 0;
    const std::optional<Place> place = found_at(picture, *about, most_opposite);
    if (place) {
      keep(*place);
      shown.push_back(*place);
    } else if (most_opposite <= kOppositeOfNothing) {
      refused.push_back(std::move(now));
    }
  }
  refused_ = std::move(refused);
}

std::vector<Sighting> PictureFinder::read(const GreyView& picture) const {
  std::vector<Sighting> sightings;
  for (std::size_t i = 0; i < places_.size(); ++i) {
    const Projection projection(places_[i]);
    if (!projection.is_valid()) continue;
    std::optional<Sighting> sighting = best_sighting(grid_at(picture, projection));
    if (!sighting) continue;
    sighting->place = i;
    sightings.push_back(*sighting);
  }
  return sightings;
}

}  // namespace kiroku::light

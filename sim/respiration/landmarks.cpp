#include "sim/respiration/landmarks.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <optional>

#include "base/error.h"
#include "sim/mesh/length_unit.h"
#include "sim/model/body_model.h"
#include "sim/respiration/number_table.h"

namespace kiroku::sim {
namespace {

std::vector<std::string_view> words_of(std::string_view line) {
  constexpr std::string_view kSpace = " \t\r,;";
  std::vector<std::string_view> words;
  for (std::size_t from = line.find_first_not_of(kSpace); from != std::string_view::npos;) {
    const std::size_t end = std::min(line.find_first_of(kSpace, from), line.size());
    words.push_back(line.substr(from, end - from));
    from = line.find_first_not_of(kSpace, end);
  }
  return words;
}

}  // namespace

std::vector<Vector3> parse_landmarks_m(std::string_view text, const std::string& name) {
  std::vector<Vector3> points;
  std::optional<std::size_t> told;
  bool elastix = false;
  std::size_t number = 0;
  const auto fail = [&](const std::string& what) -> void {
    throw Error("cannot use " + name + ", line " + std::to_string(number) + ": " + what);
  };
  while (!text.empty()) {
    const std::size_t end = std::min(text.find('\n'), text.size());
    const std::vector<std::string_view> words = words_of(text.substr(0, end));
    text.remove_prefix(std::min(end + 1, text.size()));
    ++number;
    if (words.empty() || words.front().front() == '#') continue;
    if (points.empty() && !elastix && words.size() == 1 && words[0] == "point") {
      elastix = true;
      continue;
    }
    if (words.size() == 1 && words[0] == "index")
      fail("it counts voxels; give the points in millimetres (\"point\")");
    if (elastix && !told) {
      const auto count = words.size() == 1 ? number_of(words[0]) : std::nullopt;
      if (!count || *count < 0 || *count != std::floor(*count))
        fail("the number of points is expected here, below \"point\"");
      told = static_cast<std::size_t>(count.value_or(0));
      continue;
    }
    Vector3 point;
    if (words.size() != 3) fail("it has " + std::to_string(words.size()) + " words where x y z are expected");
    for (std::size_t axis = 0; axis < 3; ++axis) {
      const auto value = number_of(words[axis]);
      if (!value) fail("'" + std::string(words[axis]) + "' is no number");
      point[static_cast<Eigen::Index>(axis)] = value.value_or(0) / kMmPerM;
    }
    points.push_back(point);
  }
  if (told && *told != points.size()) {
    throw Error("cannot use " + name + ": it says that it has " + std::to_string(*told) + " points and has " +
                std::to_string(points.size()));
  }
  return points;
}

std::vector<Vector3> read_landmarks_m(const std::filesystem::path& file) {
  return parse_landmarks_m(read_document(file), file.string());
}

LandmarkPairs read_landmark_pairs(const std::filesystem::path& fixed, const std::filesystem::path& moving) {
  LandmarkPairs pairs{read_landmarks_m(fixed), read_landmarks_m(moving)};
  if (pairs.fixed_m.size() != pairs.moving_m.size()) {
    throw Error(fixed.string() + " has " + std::to_string(pairs.fixed_m.size()) + " landmarks and " +
                moving.string() + " has " + std::to_string(pairs.moving_m.size()) +
                ": each must have its partner on the same line of the other");
  }
  if (pairs.fixed_m.empty()) throw Error(fixed.string() + " and " + moving.string() + " hold no landmark");
  return pairs;
}

Spread spread_of(std::vector<double> lengths) {
  Spread spread;
  spread.count = lengths.size();
  if (lengths.empty()) return spread;
  std::ranges::sort(lengths);
  const auto count = static_cast<double>(lengths.size());
  spread.mean = std::accumulate(lengths.begin(), lengths.end(), 0.0) / count;
  double squares = 0;
  for (const double length : lengths) squares += (length - spread.mean) * (length - spread.mean);
  spread.deviation = lengths.size() > 1 ? std::sqrt(squares / (count - 1)) : 0;
  const auto percentile = [&](double part) {
    return lengths[static_cast<std::size_t>(std::lround(part * (count - 1)))];
  };
  spread.median = percentile(0.5);
  spread.percentile_95 = percentile(0.95);
  spread.greatest = lengths.back();
  return spread;
}

}  // namespace kiroku::sim

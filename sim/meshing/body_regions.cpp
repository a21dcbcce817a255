#include "sim/meshing/body_regions.h"

#include <algorithm>
#include <charconv>
#include <cmath>

#include "base/error.h"

namespace kiroku::sim {
namespace {

template <typename Number>
std::optional<Number> number_of(std::string_view text) {
  Number number{};
  const auto [end, failure] = std::from_chars(text.data(), text.data() + text.size(), number);
  if (failure != std::errc() || end != text.data() + text.size()) return std::nullopt;
  return number;
}

std::optional<LabelRange> label_range_of(std::string_view text) {
  const std::size_t dash = text.find('-');
  const auto first = number_of<std::uint16_t>(text.substr(0, dash));
  const auto last = dash == std::string_view::npos ? first : number_of<std::uint16_t>(text.substr(dash + 1));
  if (!first || !last || *first == 0 || *last < *first) return std::nullopt;
  return LabelRange{*first, *last};
}

/// "1-3, 5": labels that occur, in runs.
std::string runs_of(const std::vector<bool>& occurs) {
  std::string text;
  for (std::size_t label = 1; label < occurs.size(); ++label) {
    if (!occurs[label]) continue;
    std::size_t last = label;
    while (last + 1 < occurs.size() && occurs[last + 1]) ++last;
    text +=
        (text.empty() ? "" : ", ") + std::to_string(label) + (last > label ? "-" + std::to_string(last) : "");
    label = last;
  }
  return text.empty() ? "none" : text;
}

}  // namespace

HuInterval parse_hu_interval(std::string_view text) {
  // A minus sign may follow the colon, so the first colon parts them.
  const std::size_t colon = text.find(':');
  const auto least = number_of<double>(text.substr(0, colon));
  const auto greatest =
      colon == std::string_view::npos ? std::nullopt : number_of<double>(text.substr(colon + 1));
  if (!least || !greatest || !std::isfinite(*least) || !std::isfinite(*greatest) || *least > *greatest) {
    throw UsageError("the threshold is '" + std::string(text) +
                     "'; it must be two numbers of HU, as in -200:100");
  }
  return {*least, *greatest};
}

RegionLabels parse_region_labels(std::string_view text) {
  const std::size_t equals = text.find('=');
  RegionLabels region{std::string(text.substr(0, equals)), {}};
  std::string_view rest = equals == std::string_view::npos ? "" : text.substr(equals + 1);
  // It stands in a line of a mesh's file, in quotation marks.
  bool sound =
      !region.name.empty() && region.name.find_first_of("\"\n\r") == std::string::npos && !rest.empty();
  while (sound && !rest.empty()) {
    const std::size_t comma = rest.find(',');
    const auto range = label_range_of(rest.substr(0, comma));
    sound = range.has_value() && comma + 1 != rest.size();
    if (range) region.labels.push_back(*range);
    rest = comma == std::string_view::npos ? "" : rest.substr(comma + 1);
  }
  if (!sound) {
    throw UsageError("the region is '" + std::string(text) +
                     "'; it must be a name and labels, as in vessels=64,70-72");
  }
  return region;
}

std::int32_t BodyRegions::add(const std::string& name) {
  const std::int32_t number = names.empty() ? 1 : names.rbegin()->first + 1;
  names.emplace(number, name);
  return number;
}

BodyRegions regions_of_threshold(const Volume& volume, const HuInterval& interval) {
  BodyRegions body{{volume.grid, std::vector<std::uint16_t>(volume.hu.size())}, {}};
  const auto region = static_cast<std::uint16_t>(body.add("body"));
  std::ranges::transform(volume.hu, body.map.labels.begin(), [&](float hu) {
    const auto value = static_cast<double>(hu);
    return value >= interval.least && value <= interval.greatest ? region : std::uint16_t{0};
  });
  return body;
}

BodyRegions regions_of_labels(LabelMap labels, const std::vector<RegionLabels>& regions) {
  std::vector<bool> occurs(65536);
  for (const std::uint16_t label : labels.labels) occurs[label] = true;
  BodyRegions body{std::move(labels), {}};
  if (regions.empty()) {
    for (std::size_t label = 1; label < occurs.size(); ++label) {
      if (occurs[label])
        body.names.emplace(static_cast<std::int32_t>(label), "label " + std::to_string(label));
    }
    return body;
  }
  std::vector<std::uint16_t> region_of(occurs.size());
  for (const RegionLabels& region : regions) {
    const auto number = static_cast<std::uint16_t>(body.add(region.name));
    bool found = false;
    for (const LabelRange& range : region.labels) {
      for (std::size_t label = range.first; label <= range.last; ++label) {
        found = found || occurs[label];
        region_of[label] = number;
      }
    }
    if (!found) {
      throw Error("none of the labels of the region '" + region.name +
                  "' is there within the volume; the labels there are " + runs_of(occurs));
    }
  }
  for (std::uint16_t& label : body.map.labels) label = region_of[label];
  return body;
}

void add_contours(BodyRegions& body, const ContourFile& contours, const VolumeFile& volume) {
  const std::vector<std::size_t> voxels = voxels_within(contours, volume);
  if (voxels.empty())
    throw Error("the contours make no region: no voxel was within those of half the radiologists");
  const auto region = static_cast<std::uint16_t>(body.add("tumour"));
  for (const std::size_t voxel : voxels) body.map.labels[voxel] = region;
}

}  // namespace kiroku::sim

// What of a volume is to be meshed, as one map of regions on the volume's grid. Functions are pure and
// thread-safe.
#pragma once

#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "sim/meshing/organs.h"
#include "sim/volume/contours.h"
#include "sim/volume/volume_reader.h"

namespace kiroku::sim {

struct HuInterval {
  double least = 0, greatest = 0;  // both in it
};
/// "-200:100"; kiroku::UsageError for anything else.
HuInterval parse_hu_interval(std::string_view text);

struct RegionLabels {
  std::string name;
  std::vector<LabelRange> labels;
};
/// "vessels=64,70-72"; kiroku::UsageError for anything else.
RegionLabels parse_region_labels(std::string_view text);

struct BodyRegions {
  LabelMap map;  // regions from 1; 0 is outside
  std::map<std::int32_t, std::string> names;
  /// Adds a region with the next free number; where it is, it replaces what was there.
  std::int32_t add(const std::string& name);
};

/// All voxels of these HU as the region "body".
BodyRegions regions_of_threshold(const Volume& volume, const HuInterval& interval);
/// Labels (on the same grid as the volume) as regions in the order given; where there are none, each label is
/// a region of its own number, "label 5". kiroku::Error for a region none of whose labels occur, with those
/// that do.
BodyRegions regions_of_labels(LabelMap labels, const std::vector<RegionLabels>& regions);
/// What radiologists outlined as the region "tumour", within the body and beside it. kiroku::Error where
/// nothing was agreed upon.
void add_contours(BodyRegions& body, const ContourFile& contours, const VolumeFile& volume);

}  // namespace kiroku::sim

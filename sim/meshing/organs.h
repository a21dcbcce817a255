// Organs by the labels that TotalSegmentator gives them (Wasserthal et al., "TotalSegmentator: Robust
// Segmentation of 104 Anatomic Structures in CT Images", Radiology: AI 5(5), 2023; task "total", version 2).
// Thread-safe.
#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

namespace kiroku::sim {

struct LabelRange {
  std::uint16_t first = 0, last = 0;  // both in it
};

struct Organ {
  std::string_view name;
  LabelRange labels;
  std::size_t pieces = 1;  // of a healthy patient
};
/// In the order of their labels.
const std::vector<Organ>& known_organs();

/// kiroku::UsageError with the names that are known.
const Organ& organ_named(std::string_view name);

}  // namespace kiroku::sim

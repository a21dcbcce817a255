// How tissue looks: colour and opacity by its HU, and how it answers to light. Plain data, made by the
// readers; immutable after.
//
// {"name": "Liver",
//  "points": [{"hu": -20, "color": "#5a1a12", "opacity_per_mm": 0},
//             {"hu": 40, "color": "#8c2f22", "opacity_per_mm": 0.6},
//             {"hu": 200, "color": "#e8c8a8", "opacity_per_mm": 0.9}],
//  "light": {"ambient": 0.25, "diffuse": 0.75, "specular": 0.35, "shininess": 30, "edge_hu_per_mm": [5, 30]}}
#pragma once

#include <array>
#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

namespace kiroku::sim {

/// The HU that a transfer function tells apart: one entry each, what is beyond as at the ends. The range of
/// 12 bits, which scanners write.
inline constexpr int kLeastHu = -1024, kGreatestHu = 3071;
inline constexpr std::size_t kHuEntries = std::size_t{kGreatestHu - kLeastHu} + 1;

struct TransferFunction {
  struct Entry {
    std::array<float, 3> colour{};  // red, green, blue, 0 to 1
    /// Of light that goes through 1 mm, the share exp2(-extinction) comes through.
    float extinction_per_mm = 0;
  };
  std::string name;
  std::vector<Entry> entries;  // (kHuEntries)
  double ambient = 0, diffuse = 1, specular = 0, shininess = 1;
  /// Tissue whose HU change by less than the first is no edge and has no side that light could fall on: it is
  /// lit evenly. From the second on it is shaded wholly.
  std::array<double, 2> edge_hu_per_mm{};

  /// The HU that can be seen at all, from the first to the last.
  [[nodiscard]] std::array<int, 2> visible_hu() const;
  /// Whether any HU from `least` to `greatest` can be seen.
  [[nodiscard]] bool shows(double least_hu, double greatest_hu) const;
};

/// kiroku::Error in one sentence with file and JSON path; also for one that hides everything.
TransferFunction parse_transfer_function(std::string_view text, const std::string& file);

/// The names of those that come with the program, as `transfer/NAME.json` there: "bone", "kidney", …
std::vector<std::string> transfer_function_names();
/// The text of one of these, to be edited. kiroku::UsageError for another name.
std::string transfer_function_text(const std::string& name);
/// One of these by its name, or a file. kiroku::Error as parse_transfer_function(), kiroku::IoError;
/// kiroku::UsageError with the names for what is neither.
TransferFunction find_transfer_function(const std::string& name_or_file);

}  // namespace kiroku::sim

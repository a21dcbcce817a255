#include "sim/volume/contours.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <fstream>
#include <map>
#include <optional>
#include <pugixml.hpp>
#include <set>
#include <sstream>
#include <unordered_map>

#include "base/error.h"

namespace kiroku::sim {
namespace {

std::string trimmed(const std::string& text) {
  constexpr const char* kSpace = " \t\r\n";
  const std::size_t begin = text.find_first_not_of(kSpace);
  return begin == std::string::npos ? "" : text.substr(begin, text.find_last_not_of(kSpace) - begin + 1);
}

/// A whole number and nothing else.
std::optional<int> whole_number(const pugi::xml_node& node) {
  const std::string text = trimmed(node.child_value());
  int value = 0;
  const auto [end, failure] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (text.empty() || failure != std::errc() || end != text.data() + text.size()) return std::nullopt;
  return value;
}

Contour contour_of(const pugi::xml_node& roi, const std::string& name) {
  Contour contour;
  contour.instance_uid = trimmed(roi.child_value("imageSOP_UID"));
  if (contour.instance_uid.empty()) throw Error("cannot read " + name + ": a contour has no imageSOP_UID");
  contour.inclusion = trimmed(roi.child_value("inclusion")) != "FALSE";
  for (const pugi::xml_node& point : roi.children("edgeMap")) {
    const std::optional<int> column = whole_number(point.child("xCoord")),
                             row = whole_number(point.child("yCoord"));
    if (!column || !row) {
      throw Error("cannot read " + name + ": a point of the contour on " + contour.instance_uid +
                  " has no whole xCoord and yCoord");
    }
    contour.points.push_back({*column, *row});
  }
  return contour;
}

/// Pixels within a closed chain of pixels, the chain itself not: what a flood from outside does not reach.
/// Steps to a side do not slip through a chain that is closed by steps across corners.
std::vector<std::array<int, 2>> pixels_within(const std::vector<std::array<int, 2>>& chain) {
  std::array<int, 2> low = chain.front(), high = chain.front();
  for (const auto& point : chain) {
    for (std::size_t axis = 0; axis < 2; ++axis) {
      low[axis] = std::min(low[axis], point[axis] - 1);
      high[axis] = std::max(high[axis], point[axis] + 1);
    }
  }
  const auto width = static_cast<std::size_t>(high[0] - low[0] + 1),
             height = static_cast<std::size_t>(high[1] - low[1] + 1);
  std::vector<char> reached(width * height);
  const auto offset = [&](int column, int row) {
    return static_cast<std::size_t>(column - low[0]) + width * static_cast<std::size_t>(row - low[1]);
  };
  // The straight pixels between points, for chains that skip some.
  for (std::size_t at = 0; at < chain.size(); ++at) {
    const auto& from = chain[at];
    const auto& to = chain[(at + 1) % chain.size()];
    const int steps = std::max({std::abs(to[0] - from[0]), std::abs(to[1] - from[1]), 1});
    for (int step = 0; step <= steps; ++step) {
      const auto between = [&](std::size_t axis) {
        return from[axis] +
               static_cast<int>(std::lround(static_cast<double>((to[axis] - from[axis]) * step) / steps));
      };
      reached[offset(between(0), between(1))] = 1;
    }
  }
  std::vector<std::array<int, 2>> front{low};
  reached[0] = 1;
  while (!front.empty()) {
    const auto [column, row] = front.back();
    front.pop_back();
    for (const auto& [across, down] : {std::array{1, 0}, {-1, 0}, {0, 1}, {0, -1}}) {
      const int next_column = column + across, next_row = row + down;
      if (next_column < low[0] || next_column > high[0] || next_row < low[1] || next_row > high[1]) continue;
      if (reached[offset(next_column, next_row)] != 0) continue;
      reached[offset(next_column, next_row)] = 1;
      front.push_back({next_column, next_row});
    }
  }
  std::vector<std::array<int, 2>> within;
  for (int row = low[1]; row <= high[1]; ++row) {
    for (int column = low[0]; column <= high[0]; ++column) {
      if (reached[offset(column, row)] == 0) within.push_back({column, row});
    }
  }
  return within;
}

}  // namespace

ContourFile parse_contours(const std::string& xml, const std::string& name) {
  pugi::xml_document document;
  const pugi::xml_parse_result parsed = document.load_buffer(xml.data(), xml.size());
  if (!parsed) {
    const auto line = 1 + std::count(xml.begin(), xml.begin() + parsed.offset, '\n');
    throw Error("cannot read " + name + ", line " + std::to_string(line) + ": " + parsed.description());
  }
  const pugi::xml_node root = document.child("LidcReadMessage");
  if (!root) throw Error("cannot read " + name + ": it is no LidcReadMessage");
  ContourFile file;
  file.series_uid = trimmed(root.child("ResponseHeader").child_value("SeriesInstanceUid"));
  for (const pugi::xml_node& session : root.children("readingSession")) {
    Reading& reading = file.readings.emplace_back();
    for (const pugi::xml_node& nodule : session.children("unblindedReadNodule")) {
      for (const pugi::xml_node& roi : nodule.children("roi")) {
        Contour contour = contour_of(roi, name);
        if (contour.points.size() < 2) {
          ++file.points_alone;
        } else {
          reading.contours.push_back(std::move(contour));
        }
      }
    }
  }
  if (std::ranges::all_of(file.readings, [](const Reading& reading) { return reading.contours.empty(); })) {
    throw Error("cannot take a region from " + name + ": it holds no contour of more than one point");
  }
  return file;
}

ContourFile read_contours(const std::filesystem::path& file) {
  std::ifstream in(file, std::ios::binary);
  if (!in) throw UsageError("cannot open " + file.string());
  std::ostringstream text;
  text << in.rdbuf();
  return parse_contours(text.str(), file.string());
}

std::vector<std::size_t> voxels_within(const ContourFile& contours, const VolumeFile& volume) {
  const Grid& grid = volume.volume.grid;
  if (volume.instance_uids.empty()) {
    throw Error("cannot place the contours: they name pictures of a DICOM series, and the volume is " +
                (volume.format == "DICOM" ? std::string("resampled") : "a " + volume.format + " file"));
  }
  std::unordered_map<std::string, std::size_t> slice_of;
  for (std::size_t slice = 0; slice < volume.instance_uids.size(); ++slice)
    slice_of.emplace(volume.instance_uids[slice], slice);
  std::map<std::size_t, std::size_t> votes;
  for (const Reading& reading : contours.readings) {
    std::set<std::size_t> voxels;
    for (const bool inclusion : {true, false}) {
      for (const Contour& contour : reading.contours) {
        if (contour.inclusion != inclusion) continue;
        const auto slice = slice_of.find(contour.instance_uid);
        if (slice == slice_of.end()) {
          throw Error("cannot place the contours: the picture " + contour.instance_uid +
                      " is not in the series " + volume.series_uid +
                      (contours.series_uid.empty() ? "" : "; they are of " + contours.series_uid));
        }
        for (const auto& [column, row] : contour.points) {
          if (column < 0 || row < 0 || static_cast<std::size_t>(column) >= grid.size[0] ||
              static_cast<std::size_t>(row) >= grid.size[1]) {
            throw Error("cannot place the contours: the point (" + std::to_string(column) + ", " +
                        std::to_string(row) + ") is beyond the pictures' " + std::to_string(grid.size[0]) +
                        " x " + std::to_string(grid.size[1]) + " pixels");
          }
        }
        for (const auto& [column, row] : pixels_within(contour.points)) {
          const std::size_t voxel =
              grid.offset(static_cast<std::size_t>(column), static_cast<std::size_t>(row), slice->second);
          if (inclusion) {
            voxels.insert(voxel);
          } else {
            voxels.erase(voxel);
          }
        }
      }
    }
    for (const std::size_t voxel : voxels) ++votes[voxel];
  }
  std::vector<std::size_t> agreed;
  for (const auto& [voxel, count] : votes) {
    if (2 * count >= contours.readings.size()) agreed.push_back(voxel);
  }
  return agreed;
}

}  // namespace kiroku::sim

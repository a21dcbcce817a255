// The way of a tool's tip over the recorded pictures: where a person clicked, and by optical flow in between.
// Objects belong to one thread.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include <Eigen/Core>

#include "archive/format/ledger_entry.h"
#include "media/png.h"
#include "viewer/compare/point_hold.h"

namespace kiroku::compare {

/// Where the tip was in the last picture that is not later.
struct ToolClick {
  std::int64_t time_ns = 0;
  Eigen::Vector2d pixel = Eigen::Vector2d::Zero();
};

struct PathPoint {
  std::int64_t time_ns = 0;  // of a picture
  Eigen::Vector2d pixel = Eigen::Vector2d::Zero();
};

struct RecordedPath {
  std::vector<PathPoint> points;    // in order, one a picture
  std::vector<archive::Span> lost;  // where flow lost the tip, until the next click or the end
  double largest_drift_px = 0;      // between where flow had come to and the next click
};

/// Between two clicks the tip is followed from the first one; by how much it has drifted off the second is
/// taken back evenly over the time between them. After the last click it is followed as long as it can be.
class ToolPathRecorder {
 public:
  explicit ToolPathRecorder(std::vector<ToolClick> clicks);

  /// Every picture of the recording from before the first click on, in order of time; all of one size.
  void take(std::int64_t time_ns, const media::PictureView& picture);
  /// After the last picture.
  RecordedPath finish();

 private:
  void click(const ToolClick& at);
  void close_stretch(const std::optional<Eigen::Vector2d>& truth);

  std::vector<ToolClick> clicks_;
  std::size_t next_click_ = 0;
  std::vector<std::uint8_t> before_;
  media::PictureView before_view_;
  std::int64_t before_ns_ = 0, last_ns_ = 0;
  std::unique_ptr<PointHold> hold_;
  std::vector<PathPoint> stretch_;  // since the last click
  std::optional<std::int64_t> lost_since_ns_;
  RecordedPath path_;
};

/// How far two ways are apart.
struct Distance {
  std::size_t pictures = 0;
  double mean_px = 0, largest_px = 0;
  void add(double px);
};

}  // namespace kiroku::compare

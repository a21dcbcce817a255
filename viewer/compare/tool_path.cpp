#include "viewer/compare/tool_path.h"

#include <algorithm>
#include <utility>

namespace kiroku::compare {

ToolPathRecorder::ToolPathRecorder(std::vector<ToolClick> clicks) : clicks_(std::move(clicks)) {
  std::ranges::stable_sort(clicks_, {}, &ToolClick::time_ns);
}

void ToolPathRecorder::take(std::int64_t time_ns, const media::PictureView& picture) {
  while (next_click_ < clicks_.size() && clicks_[next_click_].time_ns < time_ns && !before_.empty())
    click(clicks_[next_click_++]);
  last_ns_ = time_ns;
  if (hold_) {
    hold_->follow(picture);
    if (const auto& at = hold_->points().front()) {
      stretch_.push_back({time_ns, *at});
    } else {
      lost_since_ns_ = time_ns;
      close_stretch({});
    }
  }
  // What follows only needs the picture before where a click may still be about it.
  if (next_click_ == clicks_.size()) return;
  before_.assign(picture.samples.begin(), picture.samples.end());
  before_view_ = {picture.width, picture.height, picture.channels, before_};
  before_ns_ = time_ns;
}

void ToolPathRecorder::click(const ToolClick& at) {
  if (hold_) close_stretch(at.pixel);
  if (lost_since_ns_ && before_ns_ > *lost_since_ns_) path_.lost.push_back({*lost_since_ns_, before_ns_});
  lost_since_ns_.reset();
  hold_ = std::make_unique<PointHold>(before_view_, std::span(&at.pixel, 1));
  stretch_.push_back({before_ns_, at.pixel});
}

void ToolPathRecorder::close_stretch(const std::optional<Eigen::Vector2d>& truth) {
  hold_.reset();
  if (truth && stretch_.size() > 1) {
    const Eigen::Vector2d drift = *truth - stretch_.back().pixel;
    const std::int64_t from_ns = stretch_.front().time_ns;
    const double all_ns = double(stretch_.back().time_ns - from_ns);
    path_.largest_drift_px = std::max(path_.largest_drift_px, drift.norm());
    for (PathPoint& point : stretch_) point.pixel += drift * (double(point.time_ns - from_ns) / all_ns);
    stretch_.pop_back();  // the click itself begins the next stretch
  } else if (truth) {
    stretch_.clear();  // clicked twice in one picture: the later one counts
  }
  path_.points.insert(path_.points.end(), stretch_.begin(), stretch_.end());
  stretch_.clear();
}

RecordedPath ToolPathRecorder::finish() {
  while (next_click_ < clicks_.size() && !before_.empty()) click(clicks_[next_click_++]);
  close_stretch({});
  if (lost_since_ns_) path_.lost.push_back({*lost_since_ns_, last_ns_});
  return std::move(path_);
}

void Distance::add(double px) {
  ++pictures;
  mean_px += (px - mean_px) / double(pictures);
  largest_px = std::max(largest_px, px);
}

}  // namespace kiroku::compare

#include "trainer/hand/hand_motion.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <optional>
#include <utility>

#include "base/error.h"
#include "base/number_text.h"

namespace kiroku::trainer {
namespace {

constexpr std::size_t kMostFingersOfAMotion = 16, kMostMoments = 10'000'000, kNumbersOfAPose = 7;
constexpr std::string_view kFirstLine = "kiroku-hand-motion 1", kFirstLineWithWrist = "kiroku-hand-motion 2";

sim::Pose between(const sim::Pose& from, const sim::Pose& to, double share) {
  return {from.position_m + share * (to.position_m - from.position_m),
          from.orientation.slerp(share, to.orientation).normalized()};
}

/// Where a time lies: so far behind a moment, 0 to 1 of the way to the next, which may be the same.
struct Between {
  std::size_t before = 0, next = 0;
  double share = 0;
};
Between place_of(double time_s, const std::vector<double>& times_s) {
  const auto after = std::ranges::upper_bound(times_s, time_s);
  if (after == times_s.begin()) return {};
  const auto next = static_cast<std::size_t>(after - times_s.begin());
  if (after == times_s.end()) return {next - 1, next - 1, 0};
  return {next - 1, next, (time_s - times_s[next - 1]) / (times_s[next] - times_s[next - 1])};
}

sim::Pose pose_of(const double* n) {
  return {sim::Vector3(n[0], n[1], n[2]), Eigen::Quaterniond(n[3], n[4], n[5], n[6])};
}

void add_pose(std::string& text, const sim::Pose& pose) {
  const Eigen::Quaterniond& q = pose.orientation;
  for (const double number :
       {pose.position_m.x(), pose.position_m.y(), pose.position_m.z(), q.w(), q.x(), q.y(), q.z()})
    text += " " + exact_text(number);
}

/// The numbers of a line, nothing where it has something else.
std::optional<std::vector<double>> numbers_of(std::string_view line) {
  std::vector<double> numbers;
  for (const char *at = line.data(), *const end = at + line.size();;) {
    while (at != end && (*at == ' ' || *at == '\t')) ++at;
    if (at == end) return numbers;
    double number = 0;
    const auto [after, failed] = std::from_chars(at, end, number);
    if (failed != std::errc() || !std::isfinite(number)) return std::nullopt;
    numbers.push_back(number);
    at = after;
  }
}

}  // namespace

std::vector<sim::Pose> HandMotion::at(double time_s) const {
  const auto [before, next, share] = place_of(time_s, times_s);
  std::vector<sim::Pose> all = poses[before];
  if (next == before) return all;
  for (std::size_t finger = 0; finger < fingers; ++finger)
    all[finger] = between(all[finger], poses[next][finger], share);
  return all;
}

std::optional<sim::Pose> HandMotion::wrist_at(double time_s) const {
  if (wrists.empty()) return std::nullopt;
  const auto [before, next, share] = place_of(time_s, times_s);
  if (next == before || !wrists[before] || !wrists[next]) return wrists[before];
  return between(*wrists[before], *wrists[next], share);
}

HandMotion parse_hand_motion(std::string_view text, const std::string& file) {
  HandMotion motion;
  std::size_t line_number = 0;
  bool may_have_wrist = false;
  const auto refuse = [&](const std::string& why) {
    throw Error(file + ", line " + std::to_string(line_number) + ": " + why);
  };
  for (std::size_t begin = 0; begin < text.size();) {
    const std::size_t end = std::min(text.find('\n', begin), text.size());
    std::string_view line = text.substr(begin, end - begin);
    if (line.ends_with('\r')) line.remove_suffix(1);
    begin = end + 1;
    ++line_number;
    if (line_number == 1) {
      may_have_wrist = line == kFirstLineWithWrist;
      if (line != kFirstLine && !may_have_wrist)
        refuse("this is no hand motion: it must begin with '" + std::string(kFirstLine) + "' or '" +
               std::string(kFirstLineWithWrist) + "'");
      continue;
    }
    if (line.empty() || line.starts_with('#')) continue;
    if (motion.fingers == 0) {
      constexpr std::string_view kKey = "fingers ";
      const auto count = line.starts_with(kKey) ? numbers_of(line.substr(kKey.size())) : std::nullopt;
      if (!count || count->size() != 1 || count->front() < 1 ||
          count->front() > double{kMostFingersOfAMotion} || count->front() != std::floor(count->front()))
        refuse("'fingers N' is expected, N from 1 to 16");
      motion.fingers = static_cast<std::size_t>(count->front());
      continue;
    }
    const auto numbers = numbers_of(line);
    const std::size_t expected = 1 + kNumbersOfAPose * motion.fingers;
    const bool has_wrist = may_have_wrist && numbers && numbers->size() == expected + kNumbersOfAPose;
    if (!numbers || (numbers->size() != expected && !has_wrist))
      refuse("a moment of " + std::to_string(motion.fingers) + " fingers is " + std::to_string(expected) +
             " finite numbers: seconds, then x y z and w x y z of each" +
             (may_have_wrist ? ", and seven more where there is a wrist" : ""));
    if (numbers->front() < 0 || (!motion.times_s.empty() && numbers->front() <= motion.times_s.back()))
      refuse("times are seconds from 0 on, each later than the one before");
    std::vector<sim::Pose> poses(motion.fingers);
    for (std::size_t finger = 0; finger < motion.fingers; ++finger) {
      poses[finger] = pose_of(numbers->data() + 1 + kNumbersOfAPose * finger);
      if (!poses[finger].sound())
        refuse("the quaternion of finger " + std::to_string(finger + 1) + " is not of length 1");
    }
    if (motion.times_s.size() == kMostMoments) refuse("a hand motion has at most 10 million moments");
    motion.times_s.push_back(numbers->front());
    motion.poses.push_back(std::move(poses));
    if (!may_have_wrist) continue;
    motion.wrists.push_back(has_wrist ? std::optional(pose_of(numbers->data() + expected)) : std::nullopt);
    if (has_wrist && !motion.wrists.back()->sound()) refuse("the quaternion of the wrist is not of length 1");
  }
  if (motion.times_s.empty()) throw Error(file + " is a hand motion without a moment: record one first");
  return motion;
}

std::string text_of(const HandMotion& motion) {
  const bool has_wrist = std::ranges::any_of(motion.wrists, &std::optional<sim::Pose>::has_value);
  std::string text = std::string(has_wrist ? kFirstLineWithWrist : kFirstLine) + "\nfingers " +
                     std::to_string(motion.fingers) + "\n";
  for (std::size_t moment = 0; moment < motion.times_s.size(); ++moment) {
    text += exact_text(motion.times_s[moment]);
    for (const sim::Pose& pose : motion.poses[moment]) add_pose(text, pose);
    if (has_wrist && motion.wrists[moment]) add_pose(text, *motion.wrists[moment]);
    text += "\n";
  }
  return text;
}

MotionPlayer::MotionPlayer(HandMotion motion, double period_s)
    : motion_(std::move(motion)), period_s_(period_s) {
  if (motion_.times_s.empty()) throw UsageError("a hand motion without a moment cannot be played");
}

bool MotionPlayer::read(std::span<sim::Pose> poses) {
  const double now_s = static_cast<double>(steps_) * period_s_;
  std::ranges::copy(motion_.at(now_s), poses.begin());
  wrist_ = motion_.wrist_at(now_s);
  return true;
}

void MotionPlayer::write(std::span<const sim::Vector3> /*forces_n*/) { ++steps_; }

MotionRecorder::MotionRecorder(sim::HapticDevice& device, double period_s, double longest_s)
    : device_(device), period_s_(period_s) {
  motion_.fingers = device.tools();
  const auto moments = static_cast<std::size_t>(longest_s / kLeastSeconds) + 1;
  motion_.times_s.resize(moments);
  motion_.poses.assign(moments, std::vector<sim::Pose>(device.tools()));
  motion_.wrists.resize(moments);
}

MotionRecorder::MotionRecorder(sim::HapticDevice& device, double period_s, double longest_s,
                               sim::SchedulerClock& clock)
    : MotionRecorder(device, period_s, longest_s) {
  clock_ = &clock;
}

double MotionRecorder::now_s() {
  if (!clock_) return static_cast<double>(steps_) * period_s_;
  const std::chrono::nanoseconds now = clock_->now();
  if (!begun_) begun_ = now;
  return std::chrono::duration<double>(now - *begun_).count();
}

bool MotionRecorder::read(std::span<sim::Pose> poses) {
  const double now_s = this->now_s();
  if (!device_.read(poses)) return false;
  // Half a period: the step nearest to when one is due.
  const bool due = kept_ == 0 || now_s - motion_.times_s[kept_ - 1] > kLeastSeconds - period_s_ / 2;
  if (due && kept_ < motion_.times_s.size()) {
    motion_.times_s[kept_] = now_s;
    std::ranges::copy(poses, motion_.poses[kept_].begin());
    motion_.wrists[kept_] = device_.has_wrist() ? std::optional(device_.wrist()) : std::nullopt;
    ++kept_;
  }
  return true;
}

void MotionRecorder::write(std::span<const sim::Vector3> forces_n) {
  ++steps_;
  device_.write(forces_n);
}

HandMotion MotionRecorder::motion() const {
  HandMotion kept = motion_;
  kept.times_s.resize(kept_);
  kept.poses.resize(kept_);
  kept.wrists.resize(kept_);
  return kept;
}

}  // namespace kiroku::trainer

#include "apps/sim/moving_frames.h"

#include <algorithm>
#include <cmath>
#include <string>

#include "base/error.h"
#include "base/number_text.h"
#include "sim/mesh/pvd_reader.h"

namespace kiroku::apps {
namespace {

namespace fs = std::filesystem;

fs::path list_in(const fs::path& folder) {
  std::vector<fs::path> lists;
  if (fs::is_directory(folder)) {
    for (const auto& entry : fs::directory_iterator(folder)) {
      if (entry.path().extension() == ".pvd") lists.push_back(entry.path());
    }
  }
  if (lists.empty()) {
    throw UsageError("--frames is '" + folder.string() +
                     "', where there is no list of frames (.pvd): name the folder that sim respire wrote");
  }
  if (lists.size() > 1) {
    throw UsageError("--frames is '" + folder.string() + "', which has " + std::to_string(lists.size()) +
                     " lists of frames (.pvd): leave one there");
  }
  return lists.front();
}

}  // namespace

MovingFrames::MovingFrames(const fs::path& folder, bool repeats, const Read& read) : repeats_(repeats) {
  for (const sim::ListedFrame& frame : sim::read_pvd(list_in(folder))) {
    times_s_.push_back(frame.time_s);
    displacements_m_.push_back(read(frame.file));
  }
  if (!repeats_) return;
  if (times_s_.size() < 2)
    throw Error("cannot repeat the frames of " + folder.string() + ": there is one of them");
  times_s_.push_back(2 * times_s_.back() - times_s_[times_s_.size() - 2]);
  displacements_m_.push_back(displacements_m_.front());
}

double MovingFrames::duration_s() const { return times_s_.back() - times_s_.front(); }

std::vector<sim::Vector3> MovingFrames::displacement_m(double time_s) const {
  if (repeats_) {
    const double since = std::fmod(time_s - times_s_.front(), duration_s());
    time_s = times_s_.front() + (since < 0 ? since + duration_s() : since);
  }
  if (!(time_s >= times_s_.front() && time_s <= times_s_.back())) {
    throw Error("no frame is known for " + number_text(time_s, 6) + " s: --frames goes from " +
                number_text(times_s_.front(), 6) + " to " + number_text(times_s_.back(), 6) +
                " s; give --repeat if that is one breath, which follows itself, or --start");
  }
  const auto after = std::ranges::lower_bound(times_s_, time_s);
  const auto i = static_cast<std::size_t>(after - times_s_.begin());
  if (times_s_[i] == time_s) return displacements_m_[i];
  const double part = (time_s - times_s_[i - 1]) / (times_s_[i] - times_s_[i - 1]);
  std::vector<sim::Vector3> between(displacements_m_[i].size());
  std::ranges::transform(displacements_m_[i - 1], displacements_m_[i], between.begin(),
                         [part](const sim::Vector3& a, const sim::Vector3& b) -> sim::Vector3 {
                           return (1 - part) * a + part * b;
                         });
  return between;
}

}  // namespace kiroku::apps

#include "sim/respiration/timed_path.h"

#include <algorithm>
#include <cmath>

#include "sim/mesh/length_unit.h"
#include "sim/model/body_model.h"
#include "sim/respiration/number_table.h"

namespace kiroku::sim {
namespace {

/// `part` of the way from one to the other.
Vector3 between(const Vector3& from, const Vector3& to, double part) { return (1 - part) * from + part * to; }

}  // namespace

std::optional<Vector3> TimedPath::place_at(double time_s) const {
  const auto after = std::ranges::lower_bound(times_s, time_s);
  if (after == times_s.end()) return std::nullopt;
  const auto i = static_cast<std::size_t>(after - times_s.begin());
  if (times_s[i] == time_s) return points_m[i];
  if (i == 0) return std::nullopt;
  return between(points_m[i - 1], points_m[i], (time_s - times_s[i - 1]) / (times_s[i] - times_s[i - 1]));
}

Vector3 TimedPath::place_in_breath(double time_s) const {
  const double step_s = times_s.back() - times_s[times_s.size() - 2];
  const double duration_s = times_s.back() - times_s.front() + step_s;
  const double since_s = std::fmod(time_s - times_s.front(), duration_s);
  const double in_breath_s = times_s.front() + (since_s < 0 ? since_s + duration_s : since_s);
  if (const auto place = place_at(in_breath_s)) return *place;
  return between(points_m.back(), points_m.front(), (in_breath_s - times_s.back()) / step_s);
}

TimedPath read_timed_path(const std::filesystem::path& file) {
  return parse_timed_path(read_document(file), file.string());
}

TimedPath parse_timed_path(std::string_view text, const std::string& name) {
  const NumberTable table = NumberTable::parse(text, name);
  const bool metres = !table.column("x_mm") && table.column("x_m");
  const std::string unit = metres ? "_m" : "_mm";
  const std::size_t time = table.needed_column("time_s"), x = table.needed_column("x" + unit),
                    y = table.needed_column("y" + unit), z = table.needed_column("z" + unit);
  TimedPath path;
  for (std::size_t row = 0; row < table.rows(); ++row) {
    if (row > 0 && !(table.at(row, time) > path.times_s.back())) {
      table.fail(row, "is not later than the one before");
    }
    path.times_s.push_back(table.at(row, time));
    path.points_m.push_back(Vector3(table.at(row, x), table.at(row, y), table.at(row, z)) /
                            (metres ? 1 : kMmPerM));
  }
  if (table.rows() < 2) table.fail(0, "begins a path of fewer than two places");
  return path;
}

}  // namespace kiroku::sim

#include "viewer/playback/case_pointing.h"

#include <algorithm>
#include <functional>
#include <map>
#include <tuple>

#include "archive/format/pointing_stream.h"
#include "base/error.h"
#include "media/plaintext_lines.h"
#include "media/vital_sample.h"

namespace kiroku::playback {
namespace {

/// As long as an arrow stays on the screen.
constexpr std::int64_t kPauseNs = 1'500'000'000;

void for_each_point(const CaseMedia& media, std::int64_t from_ns, std::int64_t to_ns,
                    const std::function<void(media::PointingLine line)>& visit) {
  const std::string stream(archive::kPointingStream);
  const auto& streams = media.recording().opening().streams;
  if (std::ranges::none_of(streams, archive::is_pointing)) return;
  for (const archive::SegmentEntry& entry : media.recording().segments(stream, from_ns, to_ns)) {
    if (media.recording().is_erased(entry)) continue;
    media::for_each_line(media.open(entry), entry.file.file, media::kMaximumVitalLineBytes, !entry.complete,
                         [&](std::uint64_t number, std::string_view text) {
                           auto line = media::parse_pointing_line(text);
                           if (!line) {
                             throw Error("line " + std::to_string(number) + " of " + entry.file.file +
                                         " says nothing of where somebody pointed");
                           }
                           if (from_ns <= line->time_ns && line->time_ns < to_ns) visit(std::move(*line));
                         });
  }
}

}  // namespace

std::vector<media::PointingLine> pointing_of(const CaseMedia& media, std::int64_t from_ns,
                                             std::int64_t to_ns) {
  std::vector<media::PointingLine> points;
  for_each_point(media, from_ns, to_ns, [&](media::PointingLine line) { points.push_back(std::move(line)); });
  return points;
}

std::vector<PointingStroke> pointing_strokes(const CaseMedia& media) {
  std::vector<PointingStroke> strokes;
  std::map<std::tuple<std::string, std::string, std::string>, std::size_t> newest;
  for_each_point(media, INT64_MIN, INT64_MAX, [&](const media::PointingLine& line) {
    const auto who = std::tuple(line.at.by, line.at.role, line.at.stream);
    const auto known = newest.find(who);
    if (known != newest.end() && line.time_ns - strokes[known->second].end_ns <= kPauseNs) {
      strokes[known->second].end_ns = line.time_ns;
      ++strokes[known->second].points;
      return;
    }
    newest[who] = strokes.size();
    strokes.push_back({line.time_ns, line.time_ns, line.at.by, line.at.role, line.at.stream, 1});
  });
  return strokes;
}

}  // namespace kiroku::playback

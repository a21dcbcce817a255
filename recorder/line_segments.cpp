#include "recorder/line_segments.h"

#include <algorithm>
#include <utility>

#include "base/error.h"

namespace kiroku::recorder {

LineSegments::LineSegments(const LaneContext& context, std::size_t stream_index, archive::StreamInfo info,
                           Failed failed)
    : context_(context),
      output_(context.store, stream_index, std::move(info), context.facts),
      failed_(std::move(failed)) {}

void LineSegments::fail(const std::exception& error) {
  if (gap_cause_) return;
  gap_cause_ = gap_cause_for(error);
  failed_(error);
}

void LineSegments::seal(const std::vector<std::string>& lines, std::uint64_t dropped, std::int64_t now_ns) {
  if (lines.empty() || gap_cause_) return;
  const std::int64_t end_ns = std::max(now_ns, sealed_until_ns_ + 1);
  try {
    output_.begin(sealed_until_ns_, sealed_until_ns_, "1/1000000000");
    for (const std::string& line : lines) output_.write(bytes_of(line));
    output_.end({end_ns, lines.size(), dropped});
    sealed_until_ns_ = end_ns;
  } catch (const std::exception& error) {
    fail(error);
    try {
      output_.give_up({end_ns, 0, 0});
    } catch (const std::exception& second) {
      context_.problems.report(second.what());
    }
  }
}

void LineSegments::finish(std::int64_t close_ns) {
  try {
    output_.drain();
  } catch (const std::exception& error) {
    fail(error);
  }
  if (gap_cause_) {
    const std::int64_t since_ns = output_.claimed_until_ns();
    context_.facts.push(archive::CaseEntryBody(
        archive::GapEntry{output_.info().name, {since_ns, std::max(close_ns, since_ns)}, *gap_cause_}));
  }
}

}  // namespace kiroku::recorder

#include "recorder/vitals_lane.h"

#include <algorithm>
#include <array>
#include <string_view>

#include "base/error.h"
#include "recorder/segmenter.h"
#include "recorder/source/source.h"

namespace kiroku::recorder {
namespace {

/// After so long without a line a monitor is taken to be silent.
constexpr std::int64_t kSilenceNs = 10'000'000'000;

/// Notices that a person should hear of while the case runs.
/// What was measured before the case is none of them: monitors repeat the last value of a cuff.
constexpr std::array<std::string_view, 8> kTold{"connection-refused", "sender-refused",   "training-message",
                                                "archived-message",   "several-messages", "several-beds",
                                                "several-patients",   "place-not-stated"};

}  // namespace

VitalsLane::VitalsLane(const LaneContext& context, std::size_t stream_index, archive::StreamInfo info,
                       const SourceAddress& address, std::unique_ptr<VitalSource> source,
                       std::shared_ptr<VitalsTap> tap)
    : context_(context),
      unpaced_(address.unpaced()),
      source_(std::move(source)),
      tap_(std::move(tap)),
      output_(context.store, stream_index, std::move(info), context.facts),
      segmenter_(*this, context.segment_duration) {}

VitalsLane::~VitalsLane() {
  stop();
  if (thread_.joinable()) thread_.join();
}

void VitalsLane::start() {
  thread_ = std::thread([this] { read(); });
}

void VitalsLane::stop() {
  stopping_ = true;
  source_->interrupt();
}

LaneStatus VitalsLane::status() const {
  // What waits for arrivals may be silent for long though its connection stands.
  const bool live = live_ && (!source_->is_live() || context_.clock.now_ns() - last_ns_ < kSilenceNs);
  return {live,
          samples_,
          0,
          output_.segments(),
          output_.bytes(),
          last_ns_,
          output_.claimed_until_ns(),
          source_->refused(),
          0,
          0,
          "",
          false,
          {},
          {},
          0,
          source_->elsewhere()};
}

std::optional<VitalLine> VitalsLane::next_line() {
  try {
    return source_->next();
  } catch (const std::exception& error) {
    // The source is damaged: what it gave is kept, and the rest of the case goes on.
    context_.problems.report(error.what());
    return {};
  }
}

void VitalsLane::wait_for(std::int64_t time_ns) {
  while (context_.clock.now_ns() < time_ns && !stopping_) {
    // Wakes at each segment's end, so that a segment becomes durable when its time is over, not when the next
    // sample comes.
    const std::int64_t boundary = next_boundary(context_.clock.now_ns(), context_.segment_duration);
    wait_until(context_.clock, std::min(time_ns, boundary), stopping_);
    advance_to(std::min(context_.clock.now_ns(), time_ns));
  }
}

bool VitalsLane::take_next() {
  const std::optional<VitalLine> line = next_line();
  if (!line) return wait_for_arrivals();
  const std::int64_t time_ns = media::time_ns_of(*line);
  const bool beyond = context_.end_ns && time_ns >= *context_.end_ns;
  if (!unpaced_) wait_for(beyond ? *context_.end_ns : time_ns);
  // What a live source has taken was acknowledged to its device, and is recorded though the end was asked
  // for.
  if (stopping_ && !source_->is_live()) return false;
  if (beyond) {
    reached_end_ = true;
    if (source_->is_live()) {
      context_.problems.report("'" + name() +
                               "' took messages after the end of the case; they are not in it");
    }
    return false;
  }
  if (const auto* const notice = std::get_if<media::VitalNotice>(&*line)) tell(*notice);
  live_ = true;
  pass_over_sleep(time_ns);
  split_before(time_ns);
  segmenter_.add(*line);
  segment_since_ns_ = segmenter_.start_ns();
  if (tap_) tap_->offer(*line);
  ++samples_;
  last_ns_ = time_ns;
  return true;
}

void VitalsLane::advance_to(std::int64_t until_ns) {
  pass_over_sleep(until_ns);
  split_before(until_ns);
  segmenter_.advance_to(until_ns);
  segment_since_ns_ = segmenter_.start_ns();
}

void VitalsLane::split_before(std::int64_t next_ns) { segmenter_.split(split_ns_, next_ns); }

void VitalsLane::pass_over_sleep(std::int64_t until_ns) {
  if (output_.info().timing != "arrival") return;
  const std::int64_t since_ns = segmenter_.floor_ns();
  if (until_ns <= since_ns || !context_.sleeps.slept_within(since_ns, until_ns)) return;
  const std::int64_t end_ns = segmenter_.pass_over(until_ns);
  context_.facts.push(
      archive::CaseEntryBody(archive::GapEntry{name(), {end_ns, until_ns}, archive::GapCause::kSuspended}));
}

void VitalsLane::tell(const media::VitalNotice& notice) {
  if (std::ranges::find(kTold, notice.notice) == kTold.end()) return;
  // Before the address stands what the sender wrote.
  const std::size_t at = notice.source.rfind('@');
  context_.problems.report("'" + name() + "': " + notice.text +
                           (at == std::string::npos ? "" : " (" + notice.source.substr(at + 1) + ")"));
}

bool VitalsLane::wait_for_arrivals() {
  const std::optional<std::int64_t> quiet_until_ns = source_->quiet_until_ns();
  if (!quiet_until_ns) return false;
  advance_to(std::min(*quiet_until_ns, context_.end_ns.value_or(*quiet_until_ns)));
  reached_end_ = context_.end_ns && *quiet_until_ns >= *context_.end_ns;
  return !reached_end_;
}

void VitalsLane::read() {
  if (tap_) tap_->begin();
  try {
    while (take_next()) {
    }
  } catch (const std::exception& error) {
    fail(error);
  }
  live_ = false;
  ended_ = true;
}

void VitalsLane::fail(const std::exception& error) {
  failed_ = true;
  context_.problems.end_session(close_reason_for(error), error.what());
  try {
    output_.give_up({last_ns_ + 1, samples_ - samples_before_segment_, 0});
  } catch (const std::exception& second) {
    context_.problems.report(second.what());
  }
  gap_cause_ = gap_cause_for(error);
}

std::int64_t VitalsLane::end_of_stream(std::int64_t close_ns) const {
  if (reached_end_) return *context_.end_ns;
  // What stated its own times ends where they end.
  if (unpaced_) return last_ns_ + 1;
  return std::min(close_ns, context_.end_ns.value_or(close_ns));
}

void VitalsLane::finish(std::int64_t close_ns) {
  stop();
  if (thread_.joinable()) thread_.join();
  if (!failed_) {
    try {
      pass_over_sleep(end_of_stream(close_ns));
      segmenter_.finish(end_of_stream(close_ns));
      output_.drain();
    } catch (const std::exception& error) {
      fail(error);
    }
  }
  const bool waits = !unpaced_ && close_ns - end_of_stream(close_ns) > kLongestUnstatedEndNs;
  if (!gap_cause_ && waits) gap_cause_ = archive::GapCause::kPaused;
  if (gap_cause_) {
    const std::int64_t since_ns = output_.claimed_until_ns();
    context_.facts.push(archive::CaseEntryBody(
        archive::GapEntry{name(), {since_ns, std::max(close_ns, since_ns)}, *gap_cause_}));
  }
}

void VitalsLane::begin_segment(std::uint64_t, std::int64_t start_ns) {
  samples_before_segment_ = samples_;
  output_.begin(start_ns, start_ns, "1/1000000000");
}

void VitalsLane::write(ByteView lines) { output_.write(lines); }

void VitalsLane::end_segment(std::int64_t end_ns, std::uint64_t samples) {
  output_.end({end_ns, samples, 0});
}

}  // namespace kiroku::recorder

#include "recorder/pre_roll.h"

#include <algorithm>

namespace kiroku::recorder {
namespace {

const archive::GapEntry* gap_in(const Fact& fact) {
  const auto* body = std::get_if<archive::CaseEntryBody>(&fact);
  return body == nullptr ? nullptr : std::get_if<archive::GapEntry>(body);
}

}  // namespace

PreRoll::PreRoll(archive::StandbyFolder& folder, std::size_t streams, std::chrono::nanoseconds keep)
    : folder_(folder), keep_ns_(keep.count()), gone_(streams) {}

void PreRoll::add(Fact fact) {
  const std::lock_guard guard(mutex_);
  facts_.push_back(std::move(fact));
}

void PreRoll::trim(std::int64_t now_ns) {
  const std::lock_guard guard(mutex_);
  if (begins_ns_) return;
  const std::int64_t oldest_ns = now_ns - keep_ns_;
  // Streams end their segments at different times: each fact is looked at, not only the first ones.
  for (auto fact = facts_.begin(); fact != facts_.end();) {
    const auto* segment = std::get_if<StandbySegment>(&*fact);
    const archive::GapEntry* gap = gap_in(*fact);
    const bool too_old = (segment != nullptr && segment->entry.span.end_ns <= oldest_ns) ||
                         (gap != nullptr && gap->span.end_ns <= oldest_ns);
    if (!too_old) {
      ++fact;
      continue;
    }
    if (segment != nullptr) discard(*segment);
    fact = facts_.erase(fact);
  }
}

void PreRoll::discard(const StandbySegment& segment) {
  folder_.discard(segment.entry.file);
  archive::StreamTotal& gone = gone_.at(segment.stream_index);
  gone.segments += 1;
  gone.frames += segment.entry.frames;
  gone.dropped += segment.entry.dropped;
  gone.bytes += segment.entry.file.bytes;
}

std::int64_t PreRoll::decide(std::int64_t now_ns, std::int64_t not_before_ns) {
  const std::lock_guard guard(mutex_);
  std::int64_t begins_ns = now_ns;
  for (auto fact = facts_.begin(); fact != facts_.end();) {
    const auto* segment = std::get_if<StandbySegment>(&*fact);
    if (segment != nullptr && segment->entry.span.start_ns < not_before_ns) {
      discard(*segment);
      left_out_.segments += 1;
      left_out_.duration_ns = std::max(left_out_.duration_ns, not_before_ns - segment->entry.span.start_ns);
      fact = facts_.erase(fact);
      continue;
    }
    if (segment != nullptr) begins_ns = std::min(begins_ns, segment->entry.span.start_ns);
    ++fact;
  }
  not_before_ns_ = not_before_ns;
  begins_ns_ = begins_ns;
  return begins_ns;
}

bool PreRoll::keeps(const StandbySegment& segment) {
  const std::lock_guard guard(mutex_);
  if (segment.entry.span.start_ns >= not_before_ns_) return true;
  discard(segment);
  return false;
}

void PreRoll::reconsider() {
  const std::lock_guard guard(mutex_);
  begins_ns_.reset();
}

std::vector<archive::StreamTotal> PreRoll::gone() const {
  const std::lock_guard guard(mutex_);
  return gone_;
}

std::vector<Fact> PreRoll::take() {
  const std::lock_guard guard(mutex_);
  std::vector<Fact> facts(std::make_move_iterator(facts_.begin()), std::make_move_iterator(facts_.end()));
  facts_.clear();
  return facts;
}

std::filesystem::path PreRoll::path_of(const archive::FileReference& file) const {
  return folder_.path_of(file);
}

void PreRoll::number(StandbySegment& segment) const {
  const std::lock_guard guard(mutex_);
  segment.entry.index -= gone_.at(segment.stream_index).segments;
}

std::optional<archive::GapEntry> PreRoll::within_case(archive::GapEntry gap) const {
  const std::lock_guard guard(mutex_);
  gap.span.start_ns = std::max(gap.span.start_ns, begins_ns_.value_or(0));
  if (gap.span.end_ns <= gap.span.start_ns) return {};
  return gap;
}

PreRoll::Amount PreRoll::left_out() const {
  const std::lock_guard guard(mutex_);
  return left_out_;
}

PreRoll::Amount PreRoll::amount() const {
  const std::lock_guard guard(mutex_);
  Amount amount;
  std::int64_t start_ns = INT64_MAX;
  std::int64_t end_ns = 0;
  for (const Fact& fact : facts_) {
    const auto* segment = std::get_if<StandbySegment>(&fact);
    if (segment == nullptr) continue;
    ++amount.segments;
    start_ns = std::min(start_ns, segment->entry.span.start_ns);
    end_ns = std::max(end_ns, segment->entry.span.end_ns);
  }
  if (amount.segments > 0) amount.duration_ns = end_ns - start_ns;
  return amount;
}

}  // namespace kiroku::recorder

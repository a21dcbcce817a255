#include "recorder/stream_output.h"

#include <algorithm>

#include "base/error.h"

namespace kiroku::recorder {
namespace {

// Format 1 asks for one second; what waits to be sealed adds to what a power cut costs, and both together
// stay within that.
constexpr std::chrono::milliseconds kSyncInterval{250};
// Sealed segments that wait for the disk keep their files open. Of a camera it is half a minute of a disk
// that does nothing; a source that is read as fast as it goes would have hundreds.
constexpr std::size_t kMostHanded = 16;

}  // namespace

StreamOutput::StreamOutput(SegmentStore& store, std::size_t stream_index, archive::StreamInfo info,
                           FactQueue& facts)
    : store_(store), stream_index_(stream_index), info_(std::move(info)), facts_(facts), finisher_([this] {
        run();
      }) {}

StreamOutput::~StreamOutput() {
  {
    const std::lock_guard guard(mutex_);
    stopping_ = true;
  }
  changed_.notify_all();
  finisher_.join();
}

void StreamOutput::begin(std::int64_t start_ns, std::int64_t first_pts, std::string time_base,
                         std::string_view profile) {
  const std::string its_own(profile == info_.profile ? std::string_view() : profile);
  SegmentStore::Begun begun = store_.begin(stream_index_, start_ns, its_own);
  current_ = std::move(begun.segment);
  open_since_ns_ = start_ns;
  in_standby_ = begun.in_standby;
  entry_ = {};
  entry_.stream = info_.name;
  entry_.index = begun.index;
  entry_.span.start_ns = start_ns;
  entry_.first_pts = first_pts;
  entry_.time_base = std::move(time_base);
  entry_.counts_samples = info_.kind != "video";
  entry_.profile = its_own;
  const std::lock_guard guard(mutex_);
  growing_ = current_;
  synced_bytes_ = 0;
}

void StreamOutput::write(ByteView plaintext) { current_->write(plaintext); }

std::uint64_t StreamOutput::open_bytes() const { return current_ ? current_->plaintext_bytes() : 0; }

archive::SegmentEntry StreamOutput::entry_for(const Ending& ending) const {
  archive::SegmentEntry entry = entry_;
  // What was cut off before its first picture or sample ends where it begins.
  entry.span.end_ns = std::max(ending.end_ns, entry.span.start_ns);
  entry.frames = ending.frames;
  entry.dropped = ending.dropped;
  return entry;
}

void StreamOutput::end(const Ending& ending) {
  current_->seal();
  {
    std::unique_lock lock(mutex_);
    changed_.wait(lock, [&] { return failure_ || handed_.size() < kMostHanded; });
    if (failure_) std::rethrow_exception(failure_);
    growing_.reset();
    handed_.push_back({std::move(current_), entry_for(ending), in_standby_});
  }
  current_.reset();
  open_since_ns_ = INT64_MAX;
  changed_.notify_all();
}

void StreamOutput::give_up(const Ending& ending) {
  const std::shared_ptr<archive::SegmentWriter> segment = std::move(current_);
  current_.reset();
  open_since_ns_ = INT64_MAX;
  {
    std::unique_lock lock(mutex_);
    growing_.reset();
    // Segments are entered in order, and none is salvaged while its data is being synced.
    changed_.wait(lock, [&] { return (failure_ || handed_.empty()) && !busy_; });
    // After a failed flush nobody knows what the disk holds: nothing more is claimed.
    if (failure_ || !segment) return;
  }
  if (const std::optional<archive::FileReference> kept = segment->salvage()) {
    archive::SegmentEntry entry = entry_for(ending);
    entry.file = *kept;
    entry.complete = false;
    tell(std::move(entry), in_standby_);
  }
}

void StreamOutput::tell(archive::SegmentEntry entry, bool in_standby) {
  ++segments_;
  bytes_ += entry.file.bytes;
  claimed_until_ns_ = entry.span.end_ns;
  if (in_standby) {
    facts_.push(StandbySegment{stream_index_, std::move(entry)});
  } else {
    facts_.push(archive::CaseEntryBody(std::move(entry)));
  }
}

void StreamOutput::drain() {
  std::unique_lock lock(mutex_);
  changed_.wait(lock, [&] { return failure_ || (handed_.empty() && !busy_); });
  if (failure_) std::rethrow_exception(failure_);
}

void StreamOutput::run() {
  std::unique_lock lock(mutex_);
  for (;;) {
    changed_.wait_for(lock, kSyncInterval, [&] { return stopping_ || !handed_.empty(); });
    if (failure_) {
      // Nothing more is claimed after a failed fsync; what waits stays as .part, unclaimed.
      if (stopping_) return;
      handed_.clear();
      changed_.notify_all();
      continue;
    }
    if (handed_.empty() && stopping_) return;
    busy_ = true;
    try {
      if (!handed_.empty()) {
        Handed next = std::move(handed_.front());
        handed_.pop_front();
        lock.unlock();
        next.entry.file = next.segment->commit();
        tell(std::move(next.entry), next.in_standby);
        lock.lock();
      } else if (growing_ && growing_->bytes() != synced_bytes_) {
        const std::shared_ptr<archive::SegmentWriter> segment = growing_;
        synced_bytes_ = segment->bytes();
        lock.unlock();
        segment->sync();
        lock.lock();
      }
    } catch (...) {
      if (!lock.owns_lock()) lock.lock();
      failure_ = std::current_exception();
    }
    busy_ = false;
    changed_.notify_all();
  }
}

}  // namespace kiroku::recorder

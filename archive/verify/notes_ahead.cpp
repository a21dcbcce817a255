#include "archive/verify/notes_ahead.h"

#include <algorithm>
#include <system_error>
#include <utility>

namespace kiroku::archive {

NotesAhead::NotesAhead(std::vector<std::uint64_t> sizes, std::size_t threads, Open open)
    : sizes_(std::move(sizes)), open_(std::move(open)) {
  constexpr std::size_t kOfThread = 32, kMost = 256;
  threads = std::min(threads, kMost / kOfThread);
  places_.resize(threads * kOfThread);
  for (std::size_t i = 1; i < threads; ++i) {
    try {
      workers_.emplace_back([this] { work(); });
    } catch (const std::system_error&) {
      // The machine lets no more begin. Whoever asks opens notes, too.
      break;
    }
  }
}

NotesAhead::~NotesAhead() {
  {
    const std::lock_guard lock(mutex_);
    stopped_ = true;
  }
  room_.notify_all();
}

void NotesAhead::open_next(std::unique_lock<std::mutex>& lock) {
  const std::size_t index = begun_++;
  lock.unlock();
  Place opened{true, std::nullopt, nullptr};
  try {
    opened.note = open_(sizes_[index]);
  } catch (...) {
    opened.failure = std::current_exception();
  }
  lock.lock();
  place_of(index) = std::move(opened);
}

void NotesAhead::work() {
  std::unique_lock lock(mutex_);
  for (;;) {
    room_.wait(lock, [this] { return stopped_ || has_room(); });
    if (stopped_) {
      return;
    }
    open_next(lock);
    ready_.notify_one();
  }
}

std::optional<ReadNote> NotesAhead::take(std::uint64_t size) {
  const auto at = std::lower_bound(sizes_.begin(), sizes_.end(), size);
  if (at == sizes_.end() || *at != size) {
    return std::nullopt;
  }
  const auto wanted = static_cast<std::size_t>(at - sizes_.begin());
  std::unique_lock lock(mutex_);
  Place taken;
  while (given_ <= wanted) {
    Place& next = place_of(given_);
    if (next.ready) {
      taken = std::exchange(next, Place{});
      ++given_;
      // Threads that wait for room are woken together, while there is still something to give.
      if (begun_ - given_ == places_.size() / 2) {
        room_.notify_all();
      }
    } else if (has_room()) {
      open_next(lock);
    } else {
      ready_.wait(lock, [&] { return next.ready; });
    }
  }
  if (taken.failure) {
    std::rethrow_exception(taken.failure);
  }
  return std::move(taken.note);
}

}  // namespace kiroku::archive

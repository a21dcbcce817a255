#include "viewer/playback/read_ahead.h"

#include <exception>
#include <sys/resource.h>
#include <unistd.h>
#include <utility>

namespace kiroku::playback {
namespace {

constexpr std::size_t kMostTasks = 6;
constexpr int kNiceness = 10;

}  // namespace

ReadAhead::~ReadAhead() {
  {
    const std::lock_guard guard(mutex_);
    stopping_ = true;
  }
  changed_.notify_all();
  if (thread_.joinable()) thread_.join();
}

void ReadAhead::add(std::function<void()> task) {
  const std::lock_guard guard(mutex_);
  tasks_.push_front(std::move(task));
  if (tasks_.size() > kMostTasks) tasks_.pop_back();
  if (!thread_.joinable()) thread_ = std::thread([this] { run(); });
  changed_.notify_all();
}

void ReadAhead::run() {
  // Linux gives each thread a niceness of its own; where it refuses, the work is done all the same.
  (void)::setpriority(PRIO_PROCESS, static_cast<id_t>(::gettid()), kNiceness);
  std::unique_lock guard(mutex_);
  for (;;) {
    changed_.wait(guard, [this] { return stopping_ || !tasks_.empty(); });
    if (stopping_) return;
    const std::function<void()> task = std::move(tasks_.front());
    tasks_.pop_front();
    guard.unlock();
    try {
      task();
    } catch (const std::exception&) {
      // told to whoever asks for it
    }
    guard.lock();
  }
}

}  // namespace kiroku::playback

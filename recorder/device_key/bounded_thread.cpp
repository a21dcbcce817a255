#include "recorder/device_key/bounded_thread.h"

#include <condition_variable>
#include <system_error>
#include <utility>

namespace kiroku::recorder {

struct BoundedThread::Shared {
  std::mutex mutex;
  std::condition_variable changed;
  std::function<void()> work;  // taken out when it is done
  bool ended = false;
};

BoundedThread::BoundedThread(std::chrono::milliseconds longest_wait)
    : longest_wait_(longest_wait), shared_(std::make_shared<Shared>()) {}

BoundedThread::~BoundedThread() {
  if (!worker_.joinable()) return;
  bool hangs = false;
  {
    const std::lock_guard guard(shared_->mutex);
    shared_->ended = true;
    hangs = static_cast<bool>(shared_->work);
  }
  shared_->changed.notify_all();
  if (hangs)
    worker_.detach();
  else
    worker_.join();
}

void BoundedThread::serve(const std::shared_ptr<Shared>& shared) {
  std::unique_lock lock(shared->mutex);
  while (true) {
    shared->changed.wait(lock, [&] { return shared->ended || shared->work; });
    if (shared->ended) return;
    const std::function<void()> work = shared->work;
    lock.unlock();
    work();
    lock.lock();
    shared->work = nullptr;
    shared->changed.notify_all();
  }
}

std::string BoundedThread::run(std::function<void()> work) {
  const auto deadline = std::chrono::steady_clock::now() + longest_wait_;
  const std::string within = " within " + std::to_string(longest_wait_.count()) + " ms";
  const std::unique_lock turn(turn_, deadline);
  if (!turn.owns_lock()) return "it did not answer earlier requests" + within;
  std::unique_lock lock(shared_->mutex);
  if (shared_->work) return "it has not answered an earlier request yet";
  try {
    if (!worker_.joinable()) worker_ = std::thread(serve, shared_);
  } catch (const std::system_error& error) {
    return std::string("no thread could be started that asks it: ") + error.what();
  }
  shared_->work = std::move(work);
  shared_->changed.notify_all();
  if (shared_->changed.wait_until(lock, deadline, [&] { return !shared_->work; })) return {};
  return "it did not answer" + within;
}

}  // namespace kiroku::recorder

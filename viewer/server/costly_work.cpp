#include "viewer/server/costly_work.h"

#include <sys/resource.h>
#include <unistd.h>
#include <utility>

namespace kiroku::viewer {
namespace {

/// Added to nice(2) of whoever makes this: a flood of sign-ins takes what the processor has left.
constexpr int kNicer = 5;

void yield_to_others() {
  const auto self = static_cast<id_t>(::gettid());
  (void)::setpriority(PRIO_PROCESS, self, ::getpriority(PRIO_PROCESS, self) + kNicer);
}

}  // namespace

CostlyWork::CostlyWork(const Limits& limits) : limits_(limits) {
  for (std::size_t i = 0; i < limits_.threads; ++i) threads_.emplace_back([this] { run(); });
}

CostlyWork::~CostlyWork() { stop(); }

bool CostlyWork::offer(bool goes_first, const std::string& who, std::function<void()> work) {
  {
    const std::lock_guard guard(mutex_);
    std::deque<Item>& queue = goes_first ? first_ : others_;
    const auto of_this = of_one_.find(who);
    const bool is_too_many = of_this != of_one_.end() && of_this->second >= limits_.of_one;
    if (is_stopping_ || is_too_many || queue.size() >= limits_.waiting) return false;
    ++of_one_[who];
    queue.push_back({who, std::move(work)});
  }
  changed_.notify_one();
  return true;
}

void CostlyWork::stop() {
  {
    const std::lock_guard guard(mutex_);
    is_stopping_ = true;
  }
  changed_.notify_all();
  for (std::thread& thread : threads_) thread.join();
  threads_.clear();
  first_.clear();
  others_.clear();
}

void CostlyWork::run() {
  yield_to_others();
  std::unique_lock lock(mutex_);
  for (;;) {
    changed_.wait(lock, [this] { return is_stopping_ || !first_.empty() || !others_.empty(); });
    if (is_stopping_) return;
    std::deque<Item>& queue = first_.empty() ? others_ : first_;
    Item item = std::move(queue.front());
    queue.pop_front();
    lock.unlock();
    item.work();
    item.work = {};
    lock.lock();
    const auto of_this = of_one_.find(item.who);
    if (--of_this->second == 0) of_one_.erase(of_this);
  }
}

}  // namespace kiroku::viewer

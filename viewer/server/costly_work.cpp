#include "viewer/server/costly_work.h"

#include <algorithm>
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
    const bool is_too_many = of_this != of_one_.end() && of_this->second.all >= limits_.of_one;
    if (is_stopping_ || is_too_many || queue.size() >= limits_.waiting) return false;
    ++of_one_[who].all;
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

bool CostlyWork::take_next(Item& next) {
  for (std::deque<Item>* const queue : {&first_, &others_}) {
    const auto found = std::ranges::find_if(
        *queue, [this](const Item& each) { return of_one_[each.who].being_done < limits_.done_of_one; });
    if (found == queue->end()) continue;
    next = std::move(*found);
    queue->erase(found);
    ++of_one_[next.who].being_done;
    return true;
  }
  return false;
}

void CostlyWork::run() {
  yield_to_others();
  std::unique_lock lock(mutex_);
  for (;;) {
    Item item;
    changed_.wait(lock, [&] { return is_stopping_ || take_next(item); });
    if (is_stopping_) return;
    lock.unlock();
    item.work();
    item.work = {};
    lock.lock();
    const auto of_this = of_one_.find(item.who);
    --of_this->second.being_done;
    if (--of_this->second.all == 0) of_one_.erase(of_this);
  }
}

}  // namespace kiroku::viewer

#include "viewer/people/turns.h"

#include <utility>

#include "viewer/http/request.h"

namespace kiroku::viewer {

Turns::Turns(Limits limits, Sentences sentences, const Clock& clock)
    : limits_(limits), sentences_(std::move(sentences)), clock_(clock) {}

const std::string* Turns::refusal_of(const std::string& person) const {
  const auto own = of_person_.find(person);
  if (own != of_person_.end() && own->second >= limits_.of_person) return &sentences_.own;
  return taken_ >= limits_.all ? &sentences_.others : nullptr;
}

void Turns::wait_for_own(const std::string& person, std::unique_lock<std::mutex>& lock) {
  if (limits_.patience <= Clock::Duration::zero()) return;
  const auto own_is_in_the_way = [&] { return refusal_of(person) == &sentences_.own; };
  if (!own_is_in_the_way()) return;
  const std::uint64_t number = waiting_[person] = ++waits_;
  given_back_.notify_all();
  const auto newest = [&] {
    const auto wait = waiting_.find(person);
    return wait != waiting_.end() && wait->second == number;
  };
  clock_.wait_for(given_back_, lock, limits_.patience, [&] { return !newest() || !own_is_in_the_way(); });
  if (!newest()) throw Refusal(503, sentences_.own);
  waiting_.erase(person);
}

Turns::Turn::Turn(Turns& turns, std::string person) : turns_(turns), person_(std::move(person)) {
  std::unique_lock lock(turns_.mutex_);
  turns_.wait_for_own(person_, lock);
  if (const std::string* const refusal = turns_.refusal_of(person_)) throw Refusal(503, *refusal);
  ++turns_.of_person_[person_];
  ++turns_.taken_;
}

Turns::Turn::~Turn() {
  {
    const std::lock_guard guard(turns_.mutex_);
    --turns_.taken_;
    const auto own = turns_.of_person_.find(person_);
    if (--own->second == 0) turns_.of_person_.erase(own);
  }
  turns_.given_back_.notify_all();
}

}  // namespace kiroku::viewer

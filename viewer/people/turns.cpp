#include "viewer/people/turns.h"

#include <utility>

#include "viewer/http/request.h"

namespace kiroku::viewer {

Turns::Turns(Limits limits, Sentences sentences, const Clock& clock)
    : limits_(limits), sentences_(std::move(sentences)), clock_(clock) {}

bool Turns::has_all_of_own(const std::string& person) const {
  const auto own = of_person_.find(person);
  return own != of_person_.end() && own->second >= limits_.of_person;
}

void Turns::refuse_own(const std::string& person) const {
  throw Refusal(sentences_.own_status,
                sentences_.own_names_person ? person + " " + sentences_.own : sentences_.own);
}

void Turns::wait_for_own(const std::string& person, std::unique_lock<std::mutex>& lock) {
  if (limits_.patience <= Clock::Duration::zero()) return;
  if (!has_all_of_own(person)) return;
  const std::uint64_t number = waiting_[person] = ++waits_;
  given_back_.notify_all();
  const auto newest = [&] {
    const auto wait = waiting_.find(person);
    return wait != waiting_.end() && wait->second == number;
  };
  clock_.wait_for(given_back_, lock, limits_.patience, [&] { return !newest() || !has_all_of_own(person); });
  if (!newest()) refuse_own(person);
  waiting_.erase(person);
}

Turns::Turn::Turn(Turns& turns, std::string person) : turns_(turns), person_(std::move(person)) {
  std::unique_lock lock(turns_.mutex_);
  turns_.wait_for_own(person_, lock);
  if (turns_.has_all_of_own(person_)) turns_.refuse_own(person_);
  if (turns_.taken_ >= turns_.limits_.all) throw Refusal(503, turns_.sentences_.others);
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

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

Turns::Turn::Turn(Turns& turns, std::string person) : turns_(turns), person_(std::move(person)) {
  std::unique_lock lock(turns_.mutex_);
  turns_.clock_.wait_for(turns_.given_back_, lock, turns_.limits_.patience,
                         [this] { return turns_.refusal_of(person_) == nullptr; });
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

#include "viewer/people/turns.h"

#include <utility>

#include "viewer/http/request.h"

namespace kiroku::viewer {

Turns::Turns(Limits limits, Sentences sentences) : limits_(limits), sentences_(std::move(sentences)) {}

Turns::Turn::Turn(Turns& turns, std::string person) : turns_(turns), person_(std::move(person)) {
  const std::lock_guard guard(turns_.mutex_);
  const auto own = turns_.of_person_.find(person_);
  if (own != turns_.of_person_.end() && own->second >= turns_.limits_.of_person)
    throw Refusal(503, turns_.sentences_.own);
  if (turns_.taken_ >= turns_.limits_.all) throw Refusal(503, turns_.sentences_.others);
  ++turns_.of_person_[person_];
  ++turns_.taken_;
}

Turns::Turn::~Turn() {
  const std::lock_guard guard(turns_.mutex_);
  --turns_.taken_;
  const auto own = turns_.of_person_.find(person_);
  if (--own->second == 0) turns_.of_person_.erase(own);
}

}  // namespace kiroku::viewer

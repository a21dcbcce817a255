#include <algorithm>
#include <set>

#include "base/ascii.h"
#include "recorder/procedure/procedure_book.h"
#include "recorder/procedure/procedure_matching.h"

namespace kiroku::recorder {

bool ProcedureBook::is_watched(const std::string& place) const {
  return std::ranges::any_of(
      rules_, [&](const ProcedureRule& rule) { return rule.locations.empty() || is_of_room(rule, place); });
}

bool ProcedureBook::is_watched(const Kept& kept) const {
  const auto is_place = [this](const std::string& place) { return is_watched(place); };
  const auto is_key = [this](const auto& each) { return is_watched(each.first); };
  const auto is_here = [&](const Kept& one) {
    return std::ranges::any_of(one.message.places, is_place) || std::ranges::any_of(one.since, is_key) ||
           std::ranges::any_of(one.gone, is_key);
  };
  if (is_here(kept)) return true;
  const auto patient = placed_.find(kept.message.patient);
  return patient != placed_.end() && &patient->second != &kept && is_here(patient->second);
}

void ProcedureBook::lose(LostPlaces& places, const Kept& kept, const ProcedureMoment& first,
                         const ProcedureMoment& last) {
  std::set<std::string> lost;
  for (const std::string& place : kept.message.places) lost.insert(lower_case(place));
  for (const auto& [place, went] : kept.gone) lost.insert(lower_case(place));
  lost.insert("");  // of all places together
  bool is_news = rules_.empty();
  for (const std::string& place : lost) {
    if (!rules_.empty() && !is_watched(place)) continue;
    is_news = true;
    const std::string key = key_of_lost(place, first);
    auto known = places.find(key);
    if (known == places.end() && places.size() >= kMostKept) {
      // Of more days than are kept those of one place become one.
      known =
          std::ranges::find_if(places, [&](const auto& each) { return place_of_lost(each.first) == place; });
      if (known == places.end()) make_room(places);
    }
    if (known == places.end()) {
      places.emplace(key, Lost{first, last});
      continue;
    }
    widen(known->second, {first, last});
  }
  if (is_news) ++not_kept_;
}

void ProcedureBook::widen(Lost& lost, const Lost& by) {
  if (by.first.since_boot < lost.first.since_boot) lost.first = by.first;
  if (by.last.since_boot > lost.last.since_boot) lost.last = by.last;
}

// Of more places than are kept it would be forgotten that something was: then nobody is in doubt.
void ProcedureBook::make_room(LostPlaces& places) {
  const auto same = std::ranges::adjacent_find(places, [](const auto& one, const auto& other) {
    return place_of_lost(one.first) == place_of_lost(other.first);
  });
  if (same != places.end()) {
    const auto next = std::next(same);
    widen(same->second, next->second);
    places.erase(next);
    return;
  }
  const auto is_any = [](const auto& each) { return place_of_lost(each.first) == kAnyPlace; };
  const auto take_one = [&] {
    const auto one = std::ranges::find_if(
        places, [&](const auto& each) { return !place_of_lost(each.first).empty() && !is_any(each); });
    const Lost lost = one->second;
    places.erase(one);
    return lost;
  };
  Lost lost = take_one();
  if (const auto any = std::ranges::find_if(places, is_any); any != places.end()) {
    widen(any->second, lost);
  } else {
    widen(lost, take_one());
    places.emplace(key_of_lost(std::string(kAnyPlace), lost.first), lost);
  }
}

std::string ProcedureBook::key_of_lost(const std::string& place, const ProcedureMoment& first) {
  return place + "\n" + std::to_string(std::chrono::floor<std::chrono::days>(first.since_boot).count());
}

std::string ProcedureBook::place_of_lost(const std::string& key) { return key.substr(0, key.rfind('\n')); }

void ProcedureBook::lose(const Messages& messages, const Kept& kept, const ProcedureMoment& now) {
  if (&messages == &merged_) return;
  if (&messages == &placed_ || &messages == &claims_) {
    lose(lost_placed_, kept, kept.received.at, kept.received.at);
    return;
  }
  const ProcedureMoment& told = kept.received.at;
  if (&messages == &ended_) {
    lose(lost_planned_, kept, told, now);
    return;
  }
  // Further than what arithmetic of times holds nobody plans.
  constexpr std::chrono::hours kFurthest{24 * 3650};
  const auto moment = [&](UtcTime time) {
    const auto from_now = std::clamp<UtcTime::duration>(time - now.utc, -kLongestBefore, kFurthest);
    return ProcedureMoment{now.utc + from_now, now.since_boot + from_now};
  };
  const bool is_unclear = kept.message.is_time_unclear && !kept.message.planned;
  const UtcTime first = is_unclear ? now.utc : planned(kept, now);
  lose(lost_planned_, kept, moment(first), moment(std::max(first, planned_last(kept, now))));
}

bool ProcedureBook::is_lost(const LostPlaces& places, const ProcedureRule& rule,
                            const ProcedureMoment& at) const {
  return std::ranges::any_of(places, [&](const auto& each) {
    const auto& [key, lost] = each;
    const std::string place = place_of_lost(key);
    const bool is_meant = place == kAnyPlace || is_meant_by(rule, place);
    return is_meant && at.by_this_clock(lost.first) - rule.window <= at.utc &&
           at.utc <= at.by_this_clock(lost.last) + rule.window;
  });
}

/// Whoever sends messages makes as many places and visits of one patient as they like.
void ProcedureBook::bound(Kept& kept, const ProcedureMoment& now) {
  while (kept.gone.size() > kMostPlacesBefore) {
    const auto oldest = std::ranges::min_element(kept.gone, {}, [&](const auto& each) {
      return std::pair(is_watched(each.first), each.second.when.number);
    });
    if (is_watched(oldest->first)) {
      // That they were there may be why what is planned for them there is over.
      Kept there{kept.received, {}};
      there.message.places = {oldest->first};
      lose(lost_planned_, there, oldest->second.when.at, now);
    }
    kept.gone.erase(oldest);
  }
  for (auto each = kept.visits.begin(); kept.visits.size() > kMostSenders;) {
    each = each->first == kept.message.sender ? std::next(each) : kept.visits.erase(each);
  }
}

void ProcedureBook::forget_old(Messages& messages, const ProcedureMoment& now) {
  for (auto& [key, kept] : messages) bound(kept, now);
  const auto newest = [&now](const Kept& kept) {
    return std::max(now.by_this_clock(kept.received.at), planned_last(kept, now));
  };
  std::erase_if(messages, [&](const auto& each) { return now.utc - newest(each.second) > kLongestWindow; });
  while (messages.size() > kMostKept) {
    // Of those that concern no watched room, the oldest; of none, the oldest of all. Of appointments those
    // that are planned furthest from now: the next ones were often booked first.
    auto oldest = messages.end(), oldest_of_all = messages.end();
    const bool is_of_plans = &messages == &appointments_ || &messages == &planned_claims_;
    const auto is_older = [&](auto one, auto than) {
      if (than == messages.end()) return true;
      const auto distance = [&](const Kept& kept) {
        return std::chrono::abs(planned_last(kept, now) - now.utc);
      };
      if (is_of_plans && distance(one->second) != distance(than->second))
        return distance(one->second) > distance(than->second);
      return one->second.received.number < than->second.received.number;
    };
    for (auto each = messages.begin(); each != messages.end(); ++each) {
      if (is_older(each, oldest_of_all)) oldest_of_all = each;
      if (is_older(each, oldest) && !is_watched(each->second)) oldest = each;
    }
    const auto forgotten = oldest == messages.end() ? oldest_of_all : oldest;
    // Of a claim whose patient or appointment is there still nothing is lost.
    const bool is_there = (&messages == &claims_ && placed_.contains(forgotten->first)) ||
                          (&messages == &planned_claims_ && appointments_.contains(forgotten->first));
    if (!is_there && (rules_.empty() || oldest == messages.end())) lose(messages, forgotten->second, now);
    // What is known to be lost claims nothing more.
    if (&messages == &placed_) claims_.erase(forgotten->first);
    if (&messages == &appointments_) planned_claims_.erase(forgotten->first);
    messages.erase(forgotten);
  }
}

void ProcedureBook::forget_passed(const ProcedureMoment& now) {
  // Those of no watched room before others.
  const auto forget_oldest = [this](auto& of_places, const auto& age) {
    while (of_places.size() > kMostKept) {
      of_places.erase(std::ranges::min_element(of_places, {}, [&](const auto& each) {
        return std::pair(each.first.empty() || is_watched(each.first), age(each.second));
      }));
    }
  };
  std::erase_if(changes_,
                [&](const auto& each) { return now.since_boot - each.second.since_boot > kLongestWindow; });
  forget_oldest(changes_, [](const ProcedureMoment& at) { return at.since_boot; });
  std::erase_if(passed_, [&](const auto& each) {
    return now.utc - now.by_this_clock(each.second.went.at) > kLongestWindow;
  });
  forget_oldest(passed_, [](const Passed& passed) { return passed.went.number; });
  for (LostPlaces* const places : {&lost_placed_, &lost_planned_}) {
    std::erase_if(*places, [&](const auto& each) {
      return now.since_boot - each.second.last.since_boot > kLongestWindow;
    });
  }
}

}  // namespace kiroku::recorder

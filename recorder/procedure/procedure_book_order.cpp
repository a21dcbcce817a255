#include <algorithm>

#include "base/ascii.h"
#include "recorder/procedure/procedure_book.h"
#include "recorder/procedure/procedure_matching.h"

namespace kiroku::recorder {

template <typename Use>
void ProcedureBook::with_each_arrival(const Use& use) {
  for (Messages* const messages : {&placed_, &appointments_, &ended_, &merged_, &claims_, &planned_claims_}) {
    for (auto& [key, kept] : *messages) {
      use(kept.received);
      for (auto& [place, since] : kept.since) use(since);
      for (auto& [place, went] : kept.gone) use(went.when);
      if (kept.booked) use(*kept.booked);
    }
  }
  for (auto& [place, passed] : passed_) {
    use(passed.came);
    use(passed.went);
  }
}

/// What a sender tells by a clock that was set back is not from before for longer than kLongestBehind.
void ProcedureBook::watch_clock(const ProcedureMessage& message, const ProcedureMoment& received) {
  if (!message.told) return;
  if (clocks_.size() >= kMostSenders && !clocks_.contains(message.sender)) clocks_.clear();
  SenderClock& clock = clocks_.try_emplace(message.sender, SenderClock{*message.told}).first->second;
  if (*message.told + kSameMoment >= clock.newest) {
    clock = {std::max(clock.newest, *message.told)};
    return;
  }
  if (!clock.behind_since) clock.behind_since = received.since_boot;
  if (received.since_boot - *clock.behind_since < kLongestBehind) return;
  clock = {*message.told};
  with_each_arrival([&](Arrival& each) {
    if (each.sender == message.sender) each.happened.reset();
  });
  for (Messages* const messages : {&placed_, &appointments_, &ended_, &claims_, &planned_claims_}) {
    for (auto& [key, kept] : *messages) {
      if (kept.message.sender != message.sender) continue;
      kept.message.told.reset();
      kept.moved.reset();
    }
  }
}

ProcedureBook::Arrival ProcedureBook::arrival_of(const ProcedureMessage& message,
                                                 const ProcedureMoment& received) {
  Arrival arrival{++arrivals_, received, message.sender, message.happened};
  if (!message.happened) return arrival;
  std::optional<Arrival> next;  // the first of what happened after it
  with_each_arrival([&](const Arrival& each) {
    const bool is_later =
        each.sender == message.sender && each.happened && *each.happened - *message.happened > kSameMoment;
    if (is_later && (!next || each.number < next->number)) next = each;
  });
  if (!next) return arrival;
  // What a sender calls centuries is none of this clock's.
  const auto earlier = std::min<UtcTime::duration>(*next->happened - *message.happened, kLongestBefore);
  arrival.number = next->number;
  arrival.at = {
      std::max(next->at.utc - earlier, received.utc - kLongestBefore),
      std::max<Clock::Duration>(next->at.since_boot - earlier, received.since_boot - kLongestBefore)};
  with_each_arrival([&](Arrival& each) { each.number += each.number >= arrival.number ? 1U : 0U; });
  return arrival;
}

ProcedureBook::Likeness ProcedureBook::lateness(const ProcedureMessage& message) const {
  if (!message.told) return Likeness::kNone;
  bool is_known = false, is_late = false, is_perhaps = false;
  for (const Messages* const messages : {&placed_, &appointments_, &ended_}) {
    for (const auto& [key, kept] : *messages) {
      const ProcedureMessage& known = kept.message;
      if (is_of_appointment(known) != is_of_appointment(message)) continue;
      Likeness alike =
          is_of_appointment(message) ? same_appointment(message, known) : likeness(message, known);
      // Of another appointment of the number it is no earlier news.
      if (is_of_appointment(message) && alike == Likeness::kPerhaps) alike = Likeness::kNone;
      const bool is_newer =
          known.sender == message.sender && known.told && *known.told - *message.told > kSameMoment;
      is_known = is_known || alike == Likeness::kSure;
      is_late = is_late || (is_newer && alike == Likeness::kSure);
      is_perhaps = is_perhaps || (is_newer && alike == Likeness::kPerhaps);
    }
  }
  if (is_late) return Likeness::kSure;
  return is_perhaps && !is_known ? Likeness::kPerhaps : Likeness::kNone;
}

void ProcedureBook::doubt(const ProcedureMessage& message, const Arrival& received) {
  using Kind = ProcedureMessage::Kind;
  bool is_news = false;
  if (is_of_appointment(message)) {
    if (message.kind != Kind::kCancels && !message.is_over) return;
    for (auto& [key, kept] : appointments_) {
      if (same_appointment(message, kept.message) == Likeness::kNone) continue;
      kept.doubt = Doubt::kToldLate;
      is_news = true;
    }
  } else if (message.kind == Kind::kLeaves || message.kind == Kind::kDeparts || message.moves) {
    for (const std::string& patient : known_as(message, false)) {
      Kept& kept = placed_.find(patient)->second;
      const bool is_elsewhere =
          !message.places.empty() && !share_a_place(message.places, kept.message.places);
      if (message.kind == Kind::kDeparts && is_elsewhere) continue;
      // A move before they came is how they came.
      const bool is_since = message.happened && (!kept.moved || *message.happened > *kept.moved);
      if (message.kind == Kind::kPlaces && (!is_elsewhere || !is_since)) continue;
      kept.doubt = Doubt::kToldLate;
      is_news = true;
      note_change("", received);
      for (const auto& [place, came] : kept.since) note_change(place, received);
    }
  }
  if (is_news) ++ended_late_;
}

void ProcedureBook::note_change(const std::string& place, const Arrival& when) {
  for (const std::string& each : {lower_case(place), std::string()}) {
    const auto [known, added] = changes_.try_emplace(each, when.at);
    if (!added && known->second.since_boot < when.at.since_boot) known->second = when.at;
  }
}

void ProcedureBook::note_end(const ProcedureMessage& over, const Arrival& when) {
  for (const std::string& place : rooms_of(over)) {
    if (!is_there_another(over.patient, place)) note_change(place, when);
  }
}

bool ProcedureBook::is_there_another(const std::string& patient, const std::string& place) const {
  return std::ranges::any_of(placed_, [&](const auto& other) {
    return other.first != patient && std::ranges::any_of(other.second.since, [&](const auto& came) {
             return same_but_for_case(came.first, place);
           });
  });
}

}  // namespace kiroku::recorder

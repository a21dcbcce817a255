#include "light/light_judge.h"

#include <algorithm>
#include <bit>

#include "light/light_code.h"

namespace kiroku::light {
namespace {

// Bits of kCodeBits that may differ, so that of 100,000 seconds of noise none is read as a code: random words
// differ from one of the some 100 codes of seven seconds by so few once in 10^5 (of all cells, at a place
// that showed a code before) and in 10^6 (of eight halves).
constexpr int kMostOfAll = 6, kMostOfHalf = 4;
// So near to one code is one of a random sighting's nine words once in 6 * 10^11.
constexpr int kMostOfExact = 1;
// Of the some million codes of a day no random word is so near, and opposite in so many pairs.
constexpr int kMostOfOld = 3, kOppositeOfOld = 40;
// Nobody is to be accused by what is hard to read.
constexpr int kOppositeOfForeign = 47, kLeastOfForeign = 12;
constexpr double kClarityOfForeign = 0.4;

int distance(std::uint64_t a, std::uint64_t b) {
  const int differ = std::popcount(a ^ b);
  return std::min(differ, kCodeBits - differ);  // a code may hang upside down
}

std::int64_t floor_second(std::int64_t utc_ns) {
  constexpr std::int64_t kSecond = 1'000'000'000;
  return utc_ns / kSecond - (utc_ns % kSecond < 0 ? 1 : 0);
}

/// So many pictures of a second must show the same; a slow camera has one alone.
std::uint64_t enough_of(std::uint64_t pictures) { return std::min<std::uint64_t>(pictures, 2); }

// Of hours of noise one stretch is taken for a code of its time; two of one recording hardly ever are.
constexpr std::uint64_t kEnoughOfSound = 2;

constexpr std::size_t kMostWords = 200;  // of a second that are kept apart

void count(std::map<std::uint64_t, std::uint64_t>& words, std::uint64_t word) {
  if (words.size() < kMostWords || words.contains(word)) ++words[word];
}

/// The word that most pictures show, where those are a third of them and enough.
std::optional<std::uint64_t> most_shown(const std::map<std::uint64_t, std::uint64_t>& words,
                                        std::uint64_t pictures) {
  const auto most = std::max_element(words.begin(), words.end(),
                                     [](const auto& a, const auto& b) { return a.second < b.second; });
  if (most == words.end() || most->second < enough_of(pictures) || 3 * most->second < pictures)
    return std::nullopt;
  return most->first;
}

}  // namespace

std::string_view answer_name(LightAnswer answer) {
  switch (answer) {
    case LightAnswer::kAgrees:
      return "agrees";
    case LightAnswer::kInPart:
      return "in-part";
    case LightAnswer::kDisagrees:
      return "disagrees";
    case LightAnswer::kNotSeen:
      return "not-seen";
    case LightAnswer::kNoPictures:
      return "no-pictures";
  }
  return "no-pictures";
}

std::string_view second_light_name(SecondLight light) {
  switch (light) {
    case SecondLight::kAgrees:
      return "agrees";
    case SecondLight::kOld:
      return "old";
    case SecondLight::kForeign:
      return "foreign";
    case SecondLight::kUnread:
      return "unread";
  }
  return "unread";
}

LightJudge::Match LightJudge::nearest(const Sighting& sighting, std::span<const LedgerCode> around) const {
  Match best;
  int least = kCodeBits;
  for (const LedgerCode& code : around) {
    if (!is_shown(code)) continue;
    for (std::size_t view = 0; view < sighting.words.size(); ++view) {
      const int differ = distance(sighting.words[view], code.code);
      if (differ > (view == 0 ? kMostOfAll : kMostOfHalf) || differ >= least) continue;
      best = {&code, differ <= kMostOfExact};
      least = differ;
    }
  }
  return best;
}

const LedgerCode* LightJudge::anywhere(std::uint64_t word) const {
  for (const LedgerCode& code : ledger_.codes()) {
    if (is_shown(code) && distance(word, code.code) <= kMostOfOld) return &code;
  }
  return nullptr;
}

const LedgerCode* LightJudge::old_in(const Second& second) const {
  if (!is_sound()) {
    const std::optional<std::uint64_t> strange = most_shown(second.strange, second.pictures);
    return strange ? anywhere(*strange) : nullptr;
  }
  // Sound has no pictures to count: each word that was heard was heard once.
  for (const auto& [word, heard] : second.strange) {
    if (const LedgerCode* code = anywhere(word)) return code;
  }
  return nullptr;
}

void LightJudge::add(std::int64_t case_ns, std::span<const Sighting> sightings) {
  ++report_.pictures;
  const std::optional<std::int64_t> utc_ns = ledger_.utc_ns_at(case_ns);
  if (!utc_ns) return;
  const std::int64_t utc = floor_second(*utc_ns);
  if (second_ && second_->utc != utc) close();
  if (!second_) {
    second_ = Second();
    second_->utc = utc;
    second_->first_ns = case_ns;
  }
  Second& now = *second_;
  now.last_ns = case_ns;
  ++now.pictures;
  now.is_crowded = around(utc).size() > kMostNearby;
  for (const Sighting& sighting : sightings) consider(sighting, *utc_ns, now);
}

void LightJudge::hear(std::int64_t begin_ns, std::int64_t end_ns, std::span<const TimedSighting> heard) {
  ++report_.pictures;
  second_ = Second();
  Second& now = *second_;
  now.first_ns = begin_ns;
  now.last_ns = end_ns;
  now.pictures = 1;
  for (const TimedSighting& one : heard) {
    const std::optional<std::int64_t> utc_ns = ledger_.utc_ns_at(one.case_ns);
    if (!utc_ns) continue;
    if (consider(one.sighting, *utc_ns, now)) now.exact_ns = one.case_ns;
  }
  close();
}

bool LightJudge::consider(const Sighting& sighting, std::int64_t utc_ns, Second& now) {
  const auto nearby = around(floor_second(utc_ns));
  now.is_crowded = now.is_crowded || nearby.size() > kMostNearby;
  if (now.is_crowded) return false;
  const Match match = nearest(sighting, nearby);
  if (const LedgerCode* code = match.code) {
    ++now.near[code->second];
    if (match.is_exact) ++now.exact[code->entries];
    if (!latest_shown_ || code->second > *latest_shown_) {
      latest_shown_ = code->second;
      report_.delays_ns.push_back(utc_ns - code->second * 1'000'000'000);
    }
    return match.is_exact;
  }
  if (sighting.opposite < kOppositeOfOld) return false;
  count(now.strange, sighting.words[0]);
  if (sighting.opposite >= kOppositeOfForeign && sighting.clarity >= kClarityOfForeign &&
      std::none_of(nearby.begin(), nearby.end(), [&](const LedgerCode& code) {
        return is_shown(code) && distance(sighting.words[0], code.code) < kLeastOfForeign;
      }))
    count(now.clear, sighting.words[0]);
  return false;
}

void LightJudge::note(SecondLight light, const Second& second, std::optional<std::int64_t> shown) {
  if (!report_.stretches.empty() && report_.more_stretches == 0) {
    LightStretch& last = report_.stretches.back();
    constexpr std::int64_t kNext = 2'000'000'000;
    const bool goes_on = last.light == light && second.first_ns - last.end_ns < kNext;
    if (goes_on) {
      last.end_ns = second.last_ns;
      ++last.seconds;
      return;
    }
  }
  if (report_.stretches.size() >= kMostStretches) {
    ++report_.more_stretches;
    return;
  }
  report_.stretches.push_back({light, second.first_ns, second.last_ns, 1, shown});
}

void LightJudge::close() {
  const Second second = std::move(*second_);
  second_.reset();
  ++report_.seconds;
  std::uint64_t most = 0;
  for (const auto& [shown, pictures] : second.near) most = std::max(most, pictures);
  const std::optional<std::uint64_t> clear = most_shown(second.clear, second.pictures);
  if (most >= enough_of(second.pictures)) {
    ++report_.agreeing;
    if (clear) ++report_.beside_foreign;
    std::uint64_t entries = 0;
    for (const auto& [made_of, pictures] : second.exact)
      if (pictures >= enough_of(second.pictures)) entries = made_of;
    if (entries > 0) {
      ++report_.exact;
      report_.exact_entries = entries;
      report_.exact_shown_ns = second.exact_ns.value_or(second.first_ns);
    }
    return;
  }
  if (const LedgerCode* code = old_in(second)) {
    ++report_.old;
    note(SecondLight::kOld, second, code->second);
    return;
  }
  if (clear) {
    ++report_.foreign;
    note(SecondLight::kForeign, second, std::nullopt);
    return;
  }
  ++report_.unread;
  if (second.is_crowded) ++report_.crowded;
  note(SecondLight::kUnread, second, std::nullopt);
}

LightReport LightJudge::finish() {
  if (second_) close();
  std::sort(report_.delays_ns.begin(), report_.delays_ns.end());
  const auto share = [&](std::uint64_t of) {
    return static_cast<double>(of) / static_cast<double>(report_.seconds);
  };
  const bool is_chance = is_sound() && report_.exact == 0 && report_.agreeing < kEnoughOfSound;
  report_.answer = report_.seconds == 0                   ? LightAnswer::kNoPictures
                   : report_.old + report_.foreign > 0    ? LightAnswer::kDisagrees
                   : report_.agreeing == 0 || is_chance   ? LightAnswer::kNotSeen
                   : share(report_.agreeing) < kNearlyAll ? LightAnswer::kInPart
                                                          : LightAnswer::kAgrees;
  if (is_sound() && report_.answer == LightAnswer::kNotSeen) report_.delays_ns.clear();
  return std::move(report_);
}

}  // namespace kiroku::light

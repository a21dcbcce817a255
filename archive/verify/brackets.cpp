#include "archive/verify/brackets.h"

#include <algorithm>
#include <chrono>
#include <optional>
#include <set>
#include <utility>

namespace kiroku::archive {

namespace {

constexpr std::int64_t kNsPerMicrosecond = 1'000;

std::chrono::microseconds rounded_up(std::int64_t ns) {
  return std::chrono::microseconds((ns + kNsPerMicrosecond - 1) / kNsPerMicrosecond);
}

}  // namespace

UtcTime StampedToken::earliest() const { return gen_time - rounded_up(accuracy_ns); }
UtcTime StampedToken::latest() const {
  const bool whole_seconds = gen_time == std::chrono::floor<std::chrono::seconds>(gen_time);
  return gen_time + (accuracy_ns == 0 && whole_seconds ? std::chrono::microseconds(std::chrono::seconds(1))
                                                       : rounded_up(accuracy_ns));
}

std::vector<Bracket> brackets_of(const std::vector<StampedToken>& tokens, std::uint64_t first,
                                 std::uint64_t end) {
  std::set<std::uint64_t> borders{first, end};
  for (const StampedToken& token : tokens) {
    borders.insert(std::clamp(token.entry, first, end));
    borders.insert(std::clamp(token.checkpoint, first, end));
  }
  std::vector<const StampedToken*> by_entry;
  std::vector<const StampedToken*> by_checkpoint;
  for (const StampedToken& token : tokens) {
    by_entry.push_back(&token);
    by_checkpoint.push_back(&token);
  }
  std::sort(by_entry.begin(), by_entry.end(),
            [](const auto* a, const auto* b) { return a->entry < b->entry; });
  std::sort(by_checkpoint.begin(), by_checkpoint.end(),
            [](const auto* a, const auto* b) { return a->checkpoint < b->checkpoint; });
  // From the back: the earliest time before which everything up to a checkpoint was there.
  std::vector<const StampedToken*> soonest(by_checkpoint.size());
  const StampedToken* best = nullptr;
  for (std::size_t i = by_checkpoint.size(); i-- > 0;) {
    if (best == nullptr || by_checkpoint[i]->latest() < best->latest()) {
      best = by_checkpoint[i];
    }
    soonest[i] = best;
  }

  std::vector<Bracket> brackets;
  const auto rest_on = [](Bracket& bracket, const StampedToken& token) {
    if (bracket.time != TimeProof::kSelfIssued)
      bracket.time = token.outside ? TimeProof::kExternal : TimeProof::kSelfIssued;
  };
  const StampedToken* newest = nullptr;
  std::size_t entered = 0;
  std::size_t covering = 0;
  for (auto border = borders.begin(); border != borders.end() && *border < end; ++border) {
    while (entered < by_entry.size() && by_entry[entered]->entry <= *border) {
      if (newest == nullptr || newest->earliest() < by_entry[entered]->earliest()) {
        newest = by_entry[entered];
      }
      ++entered;
    }
    while (covering < by_checkpoint.size() && by_checkpoint[covering]->checkpoint <= *border) {
      ++covering;
    }
    Bracket bracket;
    bracket.first_entry = *border;
    bracket.last_entry = *std::next(border) - 1;
    if (newest != nullptr) {
      bracket.not_before = newest->earliest();
      bracket.authority_before = newest->authority;
      rest_on(bracket, *newest);
    }
    if (covering < soonest.size()) {
      bracket.not_after = soonest[covering]->latest();
      bracket.authority_after = soonest[covering]->authority;
      rest_on(bracket, *soonest[covering]);
    }
    // Clocks of two authorities that differ: what either says lies between both.
    if (bracket.not_before && bracket.not_after && *bracket.not_after < *bracket.not_before) {
      std::swap(bracket.not_before, bracket.not_after);
      std::swap(bracket.authority_before, bracket.authority_after);
    }
    brackets.push_back(std::move(bracket));
  }
  return brackets;
}

}  // namespace kiroku::archive

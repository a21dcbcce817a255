#include "viewer/study/order.h"

#include <algorithm>
#include <array>
#include <cstdint>
#include <cstring>
#include <limits>
#include <numeric>

#include "base/bytes.h"
#include "base/error.h"
#include "crypto/encoding.h"
#include "crypto/secret.h"

namespace kiroku::study {
namespace {

std::vector<std::size_t> counted(std::size_t count) {
  std::vector<std::size_t> numbers(count);
  std::iota(numbers.begin(), numbers.end(), std::size_t{0});
  return numbers;
}

/// Of the first half, so many to be seen again, evenly of all codings.
std::vector<std::size_t> chosen_again(const std::vector<Place>& order, std::size_t codings,
                                      std::size_t repeats, const RandomBelow& random) {
  std::vector<std::vector<std::size_t>> by_coding(codings);
  std::vector<std::size_t> first_half = counted((order.size() + 1) / 2);
  shuffle(first_half, random);
  for (const std::size_t at : first_half) by_coding[order[at].coding].push_back(at);
  std::vector<std::size_t> turns = counted(codings), chosen;
  shuffle(turns, random);
  while (chosen.size() < repeats) {
    for (const std::size_t coding : turns) {
      if (by_coding[coding].empty() || chosen.size() == repeats) continue;
      chosen.push_back(by_coding[coding].back());
      by_coding[coding].pop_back();
    }
  }
  return chosen;
}

}  // namespace

RandomBelow system_random() {
  return [](std::size_t count) {
    constexpr std::uint64_t kLargest = std::numeric_limits<std::uint64_t>::max();
    // Above it, the first numbers would be likelier than the others.
    const std::uint64_t fair = kLargest - kLargest % count;
    for (;;) {
      std::array<std::byte, sizeof(std::uint64_t)> bytes{};
      crypto::fill_random(bytes);
      std::uint64_t number = 0;
      std::memcpy(&number, bytes.data(), sizeof number);
      if (number < fair) return static_cast<std::size_t>(number % count);
    }
  };
}

std::vector<Place> make_order(std::size_t clips, std::size_t codings, std::size_t repeats,
                              const RandomBelow& random) {
  const std::size_t all = clips * codings;
  if (repeats > all / 2) {
    throw UsageError("of " + std::to_string(all) + " films at most " + std::to_string(all / 2) +
                     " can be seen again, and " + std::to_string(repeats) + " are asked for");
  }
  std::vector<std::size_t> of_clips = counted(clips), of_codings = counted(codings);
  shuffle(of_clips, random);
  shuffle(of_codings, random);
  std::vector<Place> order;
  for (std::size_t block = 0; block < codings; ++block) {
    std::vector<Place> places;
    for (std::size_t i = 0; i < clips; ++i)
      places.push_back({of_clips[i], of_codings[(i + block) % codings]});
    shuffle(places, random);
    if (!order.empty() && clips > 1 && places.front().clip == order.back().clip)
      std::swap(places.front(), places[1 + random(clips - 1)]);
    std::ranges::copy(places, std::back_inserter(order));
  }
  const std::size_t half = (all + 1) / 2, apart = all / 4;
  struct Again {
    Place place;
    std::size_t seen_at;
  };
  std::vector<Again> again;
  for (const std::size_t at : chosen_again(order, codings, repeats, random)) again.push_back({order[at], at});
  for (const auto& [place, seen_at] : again) {
    // The more of these a place has, the better; among the best, chance.
    std::vector<std::size_t> best;
    int most = -1;
    for (std::size_t at = half; at <= order.size(); ++at) {
      const bool follows = order[at - 1].clip == place.clip;
      const bool precedes = at < order.size() && order[at].clip == place.clip;
      const int worth = (follows || precedes ? 0 : 2) + (at >= seen_at + apart ? 1 : 0);
      if (worth > most) best.clear();
      if (worth >= most) best.push_back(at);
      most = std::max(most, worth);
    }
    order.insert(order.begin() + static_cast<std::ptrdiff_t>(best[random(best.size())]), place);
  }
  return order;
}

std::string random_name(std::size_t bytes) {
  Bytes random(bytes);
  crypto::fill_random(random);
  return crypto::to_hex(random);
}

std::string reader_code(const RandomBelow& random) {
  constexpr std::string_view kLetters = "23456789ABCDEFGHJKMNPQRSTUVWXYZ";
  constexpr int kHalf = 4;
  std::string code;
  for (int i = 0; i < 2 * kHalf; ++i) {
    if (i == kHalf) code += '-';
    code += kLetters[random(kLetters.size())];
  }
  return code;
}

}  // namespace kiroku::study

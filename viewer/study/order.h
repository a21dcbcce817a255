// Who sees which film when, and what random names are made of. Thread-safe as far as `random` is.
#pragma once

#include <cstddef>
#include <functional>
#include <string>
#include <vector>

namespace kiroku::study {

/// A whole number below `count`, each as likely; `count` is not zero.
using RandomBelow = std::function<std::size_t(std::size_t count)>;
/// Of the system's random generator. Thread-safe.
RandomBelow system_random();

template <typename Items>
void shuffle(Items& items, const RandomBelow& random) {
  for (std::size_t left = items.size(); left > 1; --left) std::swap(items[left - 1], items[random(left)]);
}

/// A clip in a coding, both counted from 0.
struct Place {
  std::size_t clip = 0, coding = 0;
  friend bool operator==(const Place&, const Place&) = default;
};

/// In which order one reader sees every clip in every coding, and `repeats` of them once more.
///
/// As many blocks as there are codings: each has every clip once, and every coding as often as the others, or
/// once more. The order within a block is random. What is seen again was seen in the first half, each coding
/// as often as the others or once more, and comes back in the second half at a random place, if it can at
/// least a quarter of all later. No clip follows itself where that can be avoided. kiroku::UsageError for
/// more repeats than half of what there is.
std::vector<Place> make_order(std::size_t clips, std::size_t codings, std::size_t repeats,
                              const RandomBelow& random);

/// So many random bytes in hexadecimal digits, of the system's generator.
std::string random_name(std::size_t bytes);
/// A reader's code of letters and digits that are not taken for each other: "7KQM-3XWD".
std::string reader_code(const RandomBelow& random);

}  // namespace kiroku::study

#include "archive/verify/notes_ahead.h"

#include <algorithm>
#include <atomic>
#include <cstdint>
#include <numeric>
#include <optional>
#include <set>
#include <string>
#include <thread>
#include <vector>

#include <gtest/gtest.h>

#include "base/error.h"

namespace kiroku::archive {
namespace {

std::vector<std::uint64_t> sizes_up_to(std::uint64_t last) {
  std::vector<std::uint64_t> sizes(last);
  std::iota(sizes.begin(), sizes.end(), 1U);
  return sizes;
}

ReadNote note_that_says(std::uint64_t size) {
  ReadNote note{};
  note.opened.text = std::to_string(size);
  return note;
}

class NotesAheadOf : public ::testing::TestWithParam<std::size_t> {};

TEST_P(NotesAheadOf, GivesEveryNoteOnceToWhoeverAsksInOrder) {
  constexpr std::uint64_t kLast = 2'000;
  std::vector<std::atomic<int>> opened(kLast + 1);
  NotesAhead ahead(sizes_up_to(kLast), GetParam(), [&](std::uint64_t size) {
    ++opened[size];
    return std::optional(note_that_says(size));
  });
  for (std::uint64_t size = 1; size <= kLast; ++size) {
    const std::optional<ReadNote> note = ahead.take(size);
    ASSERT_TRUE(note) << size;
    EXPECT_EQ(note->opened.text, std::to_string(size));
  }
  for (std::uint64_t size = 1; size <= kLast; ++size) EXPECT_EQ(opened[size], 1) << size;
  EXPECT_FALSE(ahead.take(kLast)) << "twice";
}

TEST_P(NotesAheadOf, GivesUpThoseThatNobodyAskedForAndHasNoOthers) {
  const std::vector<std::uint64_t> sizes = sizes_up_to(1'000);
  NotesAhead ahead(sizes, GetParam(), [](std::uint64_t size) {
    return size % 7 == 0 ? std::nullopt : std::optional(note_that_says(size));
  });
  EXPECT_FALSE(ahead.take(1'001)) << "is none of the sizes";
  for (const std::uint64_t size : {1U, 3U, 7U, 500U, 999U, 1'000U}) {
    const std::optional<ReadNote> note = ahead.take(size);
    EXPECT_EQ(note.has_value(), size % 7 != 0) << size;
    if (note) {
      EXPECT_EQ(note->opened.text, std::to_string(size));
    }
  }
  EXPECT_FALSE(ahead.take(2)) << "was left out";
}

TEST_P(NotesAheadOf, ThrowsWhereTheNoteIsAskedForAndNowhereElse) {
  NotesAhead ahead(sizes_up_to(200), GetParam(), [](std::uint64_t size) -> std::optional<ReadNote> {
    if (size == 100) throw Error("no more memory");
    return note_that_says(size);
  });
  for (std::uint64_t size = 1; size <= 200; ++size) {
    if (size == 100) {
      EXPECT_THROW(ahead.take(size), Error);
    } else {
      EXPECT_TRUE(ahead.take(size)) << size;
    }
  }
}

// Whoever signs notes of 128 KiB must not have all of them in memory.
TEST_P(NotesAheadOf, KeepsSoManyWaitingAndNoMore) {
  constexpr std::uint64_t kLast = 3'000, kMost = 256;
  std::atomic<std::uint64_t> taken{0}, farthest{0};
  NotesAhead ahead(sizes_up_to(kLast), GetParam(), [&](std::uint64_t size) {
    const std::uint64_t before = taken;
    std::uint64_t known = farthest;
    while (known < size - before && !farthest.compare_exchange_weak(known, size - before)) {
    }
    return std::optional(note_that_says(size));
  });
  for (std::uint64_t size = 1; size <= kLast; ++size) {
    ASSERT_TRUE(ahead.take(size));
    taken = size;
  }
  EXPECT_LE(farthest, kMost + 1) << "one more while it is being handed over";
}

TEST_P(NotesAheadOf, EndsWhileMuchIsLeft) {
  std::atomic<std::uint64_t> opened{0};
  {
    NotesAhead ahead(sizes_up_to(100'000), GetParam(), [&](std::uint64_t size) {
      ++opened;
      return std::optional(note_that_says(size));
    });
    EXPECT_TRUE(ahead.take(1));
  }
  EXPECT_LT(opened, 100'000U);
}

INSTANTIATE_TEST_SUITE_P(Threads, NotesAheadOf, ::testing::Values(1U, 2U, 3U, 8U, 64U, 9999U));

}  // namespace
}  // namespace kiroku::archive

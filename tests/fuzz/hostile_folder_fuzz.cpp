// Folders that are dear to verify, put together from the forms of tests/support/hostile_case.h as the input
// says, and measured: the processor time must stay below a bound for each byte, must not grow faster than the
// folder, and so must memory. Bounds are ten times the goal (docs/results/reliability.md), since this runs
// under sanitizers beside others. What is beyond them ends the program.
//
// The input: byte 0 chooses what is made, byte 1 how many streams `open` names, byte 2 after how many steps
// the excerpt begins; then steps of two bytes, the form of lines and how much of it; after a step 255 the
// rest is a line as it stands.
#include <algorithm>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <ctime>
#include <span>
#include <string>

#include "tests/support/heap_count.h"
#include "tests/support/hostile_case.h"
#include "tests/support/temporary_folder.h"

namespace {

using namespace kiroku;  // NOLINT(google-build-using-namespace)

constexpr double kSecondsAtMost = 0.5;
constexpr double kSecondsPerByte = 1e-6;     // 10 s of 10 MB
constexpr std::size_t kMemory = 48'000'000;  // lines of 1 MiB read into values
constexpr std::size_t kMemoryPerByte = 2;
constexpr double kGrowth = 3;  // of time, where the folder is twice as large; 2 is linear, 4 quadratic
constexpr double kComparedFrom = 1.0;  // seconds: less is too little to compare

constexpr std::uint64_t kMostBytes = 8'000'000;
constexpr std::uint64_t kStepUnit = 32'000;
constexpr std::uint64_t kMostNotes = 10'000;  // a second of Ed25519
constexpr std::uint8_t kRawLine = 255;

enum What : std::uint8_t { kCase, kExcerpt, kForm, kWhats };

struct Cost {
  double seconds = 0;
  std::size_t memory = 0;
  std::uint64_t bytes = 0;
};

void write_steps(const std::filesystem::path& parent, std::span<const std::uint8_t> input,
                 std::uint64_t scale) {
  const auto& forms = test::hostile_lines();
  const bool excerpt = input[0] % kWhats == kExcerpt;
  test::HostileCase of(parent, 1 + input[1]);
  std::uint64_t left = kMostBytes * scale / 2;
  std::size_t step = 0;
  bool begun = false;
  for (std::span<const std::uint8_t> rest = input.subspan(3); rest.size() >= 2;
       rest = rest.subspan(2), ++step) {
    if (excerpt && !begun && step == input[2]) {
      begun = true;
      of.begin_excerpt();
    }
    if (rest[0] == kRawLine) {
      std::string line(reinterpret_cast<const char*>(rest.data()) + 1, rest.size() - 1);
      std::replace(line.begin(), line.end(), '\n', ' ');
      of.raw(line);
      break;
    }
    const std::uint64_t bytes = std::min(left, rest[1] * kStepUnit * scale / 2);
    if (bytes == 0) {
      break;
    }
    left -= bytes;
    forms[rest[0] % forms.size()].append(of, bytes);
  }
  of.finish();
}

/// Of the folder that the input asks for: whole (scale 2) or half as large (1).
Cost cost_of(std::span<const std::uint8_t> input, std::uint64_t scale) {
  const test::TemporaryFolder folder(test::quick_parent());
  if (input[0] % kWhats == kForm) {
    const auto& forms = test::hostile_forms();
    forms[input[1] % forms.size()].write(folder.path(),
                                         std::min(kMostBytes, input[2] * kStepUnit) * scale / 2);
  } else {
    write_steps(folder.path(), input, scale);
  }
  Cost cost;
  cost.bytes = test::contents_below(folder.path()).sent();
  const auto processor_time = [] {
    timespec time{};
    ::clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &time);
    return static_cast<double>(time.tv_sec) + static_cast<double>(time.tv_nsec) / 1e9;
  };
  test::start_heap_peak();
  const double begin = processor_time();
  test::verify_hostile(folder.path());
  cost.seconds = processor_time() - begin;
  cost.memory = test::heap_peak();
  return cost;
}

void require(bool holds, const char* what, const Cost& cost) {
  if (!holds) {
    std::fprintf(stderr, "%s: %.2f s and %zu bytes of memory for a folder of %llu bytes\n", what,
                 cost.seconds, cost.memory, static_cast<unsigned long long>(cost.bytes));
    std::abort();
  }
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  if (size < 5) {
    return 0;
  }
  test::HostileCase::most_notes = kMostNotes;
  const std::span<const std::uint8_t> input(data, size);
  const Cost whole = cost_of(input, 2);
  const auto bytes = static_cast<double>(whole.bytes);
  require(whole.seconds < kSecondsAtMost + kSecondsPerByte * bytes, "too slow", whole);
  require(whole.memory < kMemory + kMemoryPerByte * whole.bytes, "too much memory", whole);
  if (whole.seconds > kComparedFrom) {
    const Cost half = cost_of(input, 1);
    const double growth = bytes / static_cast<double>(half.bytes) * kGrowth / 2;
    require(whole.seconds < growth * half.seconds, "time grows faster than the folder", whole);
  }
  return 0;
}

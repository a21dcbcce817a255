// A sound card for machines that have none: an I/O plug-in of alsa-lib (sound_card.cpp), so that what is
// tested reads it through alsa-lib as it reads a card. How many samples the card has taken, and what is wrong
// with it, stands in a file that a test and the card share; the test may be another process.
#pragma once

#include <atomic>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <fcntl.h>
#include <filesystem>
#include <fstream>
#include <numbers>
#include <stdexcept>
#include <string>
#include <sys/mman.h>
#include <unistd.h>

#include "tests/support/build_paths.h"

namespace kiroku::test {

enum class CardFault : std::int32_t {
  kNone,
  kUnplugged,  // open streams end, and there is no such device
  kSilent,     // takes no sample any more
  kOverrun,    // reads are too late, again and again
  kStuck       // whoever opens it does not come back
};

struct SoundCardPage {
  /// Samples that the card has taken since it was plugged in; of one that runs by itself, not written.
  std::atomic<std::int64_t> taken = 0;
  /// Runs by the machine's clock, at its rate but for so many parts of a million; else a test moves `taken`.
  std::atomic<bool> runs = false;
  std::atomic<std::int32_t> wrong_by_ppm = 0;
  /// The count that a driver states jumps by so many samples, up to so many behind what was taken.
  std::atomic<std::int32_t> transferred_at_once = 1;
  std::atomic<CardFault> fault = CardFault::kNone;
  /// What it runs by: CLOCK_MONOTONIC when its count was 0, set by the first that opens it.
  std::atomic<std::int64_t> plugged_ns = 0;
  std::atomic<std::int32_t> openings = 0;
};

/// What sample number `sample` of the card is: a beep of 50 ms at the beginning of each of its seconds.
inline std::int16_t card_sample(std::int64_t sample, int rate) {
  const auto in_second = static_cast<int>(sample % rate);
  if (in_second >= rate / 20) return 0;
  return static_cast<std::int16_t>(20'000 * std::sin(2 * std::numbers::pi * 1'000 * in_second / rate));
}

/// A card with the ALSA name "card"; "null" is ALSA's own that has no clock. Thread-safe but for
/// ALSA_CONFIG_PATH, which is the tester's to set before there are threads.
class SoundCard {
 public:
  /// `heard`: a FIFO of raw PCM, 16 bits, one channel, from which the card takes what it hears in the place
  /// of beeps, a tenth as loud and under noise; silence of the FIFO is noise alone.
  explicit SoundCard(const std::filesystem::path& folder, const std::filesystem::path& heard = {})
      : configuration_(folder / "asound.conf") {
    const std::string page = (folder / "card").string();
    const int file = ::open(page.c_str(), O_RDWR | O_CREAT | O_CLOEXEC, 0600);
    if (file < 0 || ::ftruncate(file, sizeof(SoundCardPage)) != 0)
      throw std::runtime_error("no page for a sound card");
    void* const memory = ::mmap(nullptr, sizeof(SoundCardPage), PROT_READ | PROT_WRITE, MAP_SHARED, file, 0);
    ::close(file);
    if (memory == MAP_FAILED) throw std::runtime_error("no page for a sound card");
    page_ = new (memory) SoundCardPage();
    std::ofstream(configuration_) << "pcm_type.played { lib \"" << built_file("sound_card") << "\" }\n"
                                  << "pcm.null { type null }\n"
                                  << "pcm.card { type played page \"" << page << "\" heard \""
                                  << heard.string() << "\" }\n";
  }
  ~SoundCard() { ::munmap(page_, sizeof(SoundCardPage)); }
  SoundCard(const SoundCard&) = delete;
  SoundCard& operator=(const SoundCard&) = delete;

  /// For ALSA_CONFIG_PATH.
  [[nodiscard]] const std::filesystem::path& configuration() const { return configuration_; }
  SoundCardPage& operator*() const { return *page_; }
  SoundCardPage* operator->() const { return page_; }

 private:
  std::filesystem::path configuration_;
  SoundCardPage* page_ = nullptr;
};

}  // namespace kiroku::test

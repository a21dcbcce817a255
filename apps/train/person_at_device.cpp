#include "apps/train/person_at_device.h"

#include <algorithm>
#include <chrono>
#include <iostream>
#include <thread>
#include <utility>

#include "base/error.h"
#include "sim/haptics/rate_scheduler.h"
#include "sim/haptics/udp_device.h"
#include "trainer/hand/safe_device.h"
#include "trainer/haptic_rate/held_forces.h"

namespace kiroku::apps {
namespace {

using std::chrono::steady_clock;

constexpr double kRateHz = 2000;
constexpr auto kPatience = std::chrono::seconds(30);

bool answered_yes() {
  for (std::string line; std::getline(std::cin, line);) {
    if (line == "y" || line == "yes") return true;
    if (line == "n" || line == "no") return false;
    std::cerr << "y for vibrating, n for continuous: " << std::flush;
  }
  throw UsageError("the answers ended before the experiment did, so that nothing is kept");
}

}  // namespace

PersonAtDevice::PersonAtDevice(const trainer::Plate& plate, UdpAddress address)
    : plate_(plate), address_(std::move(address)) {}

bool PersonAtDevice::feels_vibration(const trainer::Fingers& fingers, double rate_hz) {
  sim::UdpDevice device(fingers.count(), address_.address, address_.port);
  trainer::SafeDevice safe(device, 1 / kRateHz);
  // However this ends, no force stays on a finger.
  const trainer::AtRest at_rest(safe);
  const auto seconds = std::chrono::duration<double>(std::max(4.0, 4 / rate_hz));
  sim::MonotonicClock clock;
  trainer::MotionRecorder recorder(safe, 1 / kRateHz,
                                   std::chrono::duration<double>(kPatience + seconds).count() + 1, clock);
  sim::HapticContact contact(plate_.contact(), trainer::Plate::fingers(fingers.count()));
  trainer::HeldForces held(contact, rate_hz);
  sim::ForceLoopOptions options;
  options.rate_hz = kRateHz;
  std::cerr << "Press with " << (fingers.named() ? "the " : "") << fingers.in_words()
            << " between 0.5 and 1 N ... " << std::flush;
  {
    sim::ForceLoop loop(recorder, held, options);
    auto touched = steady_clock::time_point::max();
    const auto begun = steady_clock::now();
    // What the fingers come near to has to be known in time; thirty times a second is enough for a hand.
    while (steady_clock::now() < touched || steady_clock::now() - touched < seconds) {
      const bool touches = !contact.refresh().contacts.empty();
      if (touches && touched == steady_clock::time_point::max()) touched = steady_clock::now();
      if (!touches && touched == steady_clock::time_point::max() && steady_clock::now() - begun > kPatience) {
        throw Error("nothing touched the plate within 30 s: no device sends to UDP port " +
                    std::to_string(device.port()) + " of " + address_.address +
                    ", or its fingers stay above z = 0");
      }
      std::this_thread::sleep_for(std::chrono::milliseconds(30));
      (void)loop.statistics();  // throws what the loop failed by
    }
    loop.stop();
  }
  safe.come_to_rest();
  motion_ = recorder.motion();
  std::cerr << "vibrating? (y/n) " << std::flush;
  return answered_yes();
}

}  // namespace kiroku::apps

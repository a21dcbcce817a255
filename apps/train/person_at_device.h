// A person at a haptic device and a terminal, as the subject of the haptic-rate experiment.
#pragma once

#include <string>

#include "apps/train/udp_hand.h"
#include "trainer/hand/hand_motion.h"
#include "trainer/haptic_rate/rate_subject.h"

namespace kiroku::apps {

/// Forces come in real time (2 kHz, limited by SafeDevice), questions and answers by the terminal. Not
/// thread-safe.
class PersonAtDevice : public trainer::RateSubject {
 public:
  PersonAtDevice(const trainer::Plate& plate, UdpAddress address);
  /// kiroku::Error where no pose comes within 30 seconds, kiroku::UsageError where the terminal is closed.
  bool feels_vibration(const trainer::Fingers& fingers, double rate_hz) override;
  /// What the hand did in the last feels_vibration(), as the device gave it and SafeDevice believed it, with
  /// its wrist where it has one: from when poses are waited for until the question, in real time.
  [[nodiscard]] const trainer::HandMotion& motion() const { return motion_; }

 private:
  const trainer::Plate& plate_;
  UdpAddress address_;
  trainer::HandMotion motion_;
};

}  // namespace kiroku::apps

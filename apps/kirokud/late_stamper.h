// Time-stamps that did not come while a case was recorded, asked for later.
#pragma once

#include <condition_variable>
#include <mutex>
#include <thread>

#include "apps/kiroku/authorities.h"
#include "apps/kiroku/home.h"
#include "apps/kiroku/recording_setup.h"
#include "recorder/late_stamping.h"

namespace kiroku::apps {

/// Works off the stamping queue, for cases that were closed while no authority answered, until it is
/// destroyed.
class LateStamper {
 public:
  /// The three outlive it.
  LateStamper(const Home& home, const Authorities& authorities, const WritableHome& shared);
  ~LateStamper();
  LateStamper(const LateStamper&) = delete;
  LateStamper& operator=(const LateStamper&) = delete;

 private:
  void run();

  const Home& home_;
  recorder::LateStamping stamping_;
  std::mutex mutex_;
  std::condition_variable changed_;
  bool ending_ = false;
  std::thread thread_;
};

}  // namespace kiroku::apps

// Telling when the device's key in hardware does not sign: recording goes on without it, and somebody has to
// know at once.
#pragma once

#include <mutex>
#include <string>

#include "crypto/hardware_key.h"

namespace kiroku::apps {

class HardwareWatch {
 public:
  /// `key` outlives it, and may be null: there is none.
  explicit HardwareWatch(const crypto::HardwareSigner* key) : key_(key) {}
  /// Has it sign at the first call, and then now and then; writes to the journal when it falls silent, for
  /// another reason, and when it signs again. While a case is `recorded`, one that signed when it was last
  /// asked is left alone: the case's own checkpoints would wait for it. Called each second, by one thread;
  /// waits a bounded time.
  void look(bool recorded);
  /// Why it did not sign when it was last asked, one sentence; empty where it did. Thread-safe.
  [[nodiscard]] std::string silent() const;

 private:
  const crypto::HardwareSigner* key_;
  int ticks_left_ = 0;
  bool was_asked_ = false;
  mutable std::mutex mutex_;
  std::string silent_;
};

}  // namespace kiroku::apps

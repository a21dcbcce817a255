// Finished facts on their way to the one writer of the ledger.
#pragma once

#include <chrono>
#include <condition_variable>
#include <mutex>
#include <utility>
#include <variant>
#include <vector>

#include "archive/writing/case_writer.h"
#include "recorder/authority_contact.h"

namespace kiroku::recorder {

/// A finished segment that lies in a standby folder; `entry` numbers it as it is numbered there.
struct StandbySegment {
  std::size_t stream_index = 0;
  archive::SegmentEntry entry;
};

using Fact = std::variant<archive::CaseEntryBody, AuthorityAnswer, StandbySegment>;

/// Unbounded: facts are few and small. Thread-safe.
class FactQueue {
 public:
  void push(Fact fact) {
    {
      const std::lock_guard guard(mutex_);
      facts_.push_back(std::move(fact));
    }
    arrived_.notify_one();
  }
  /// Everything that arrived, at the latest after `patience`; may be empty. Also returns when wake() is
  /// called.
  std::vector<Fact> take(std::chrono::nanoseconds patience) {
    std::unique_lock lock(mutex_);
    arrived_.wait_for(lock, patience, [&] { return !facts_.empty() || woken_; });
    woken_ = false;
    return std::exchange(facts_, {});
  }
  void wake() {
    {
      const std::lock_guard guard(mutex_);
      woken_ = true;
    }
    arrived_.notify_one();
  }

 private:
  std::mutex mutex_;
  std::condition_variable arrived_;
  std::vector<Fact> facts_;
  bool woken_ = false;
};

}  // namespace kiroku::recorder

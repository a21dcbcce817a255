// The one writer of a case's ledger during a session.
#pragma once

#include <atomic>
#include <chrono>
#include <map>
#include <memory>
#include <string>
#include <thread>

#include "archive/case_writer.h"
#include "recorder/clock_watch.h"
#include "recorder/fact_queue.h"
#include "recorder/lane.h"
#include "recorder/stamper.h"

namespace kiroku::recorder {

/// Appends the facts that lanes and authorities hand over, states the clock, and signs and stamps checkpoints
/// at their times, on a thread of its own from start() to finish().
class Scribe {
 public:
  Scribe(archive::CaseWriter& writer, FactQueue& facts, const CaseClock& clock, Troubles& troubles,
         Stamper& stamper, std::chrono::nanoseconds stamp_interval);
  ~Scribe();
  void start();
  /// All lanes have finished: appends the rest and `close`, has the last state stamped, waits for the
  /// authorities, and signs the last checkpoint. Throws kiroku::Error if the ledger could not be written to
  /// its end.
  void finish(const std::string& close_reason);

  [[nodiscard]] std::uint64_t tokens() const { return tokens_; }
  [[nodiscard]] std::uint64_t missed() const { return missed_; }

 private:
  void run();
  void write(std::vector<Fact> facts);
  void write(const AuthorityAnswer& answer);
  /// What people should hear of an authority's answer.
  void tell(const AuthorityAnswer& answer);

  archive::CaseWriter& writer_;
  FactQueue& facts_;
  const CaseClock& clock_;
  Troubles& troubles_;
  Stamper& stamper_;
  const std::chrono::nanoseconds stamp_interval_;
  ClockWatch clock_watch_;
  std::int64_t next_stamp_ns_ = 0;
  std::map<std::string, std::string> paths_;        // by authority: over which its latest token came
  std::map<std::string, std::int64_t> failing_ns_;  // by authority: case clock since when it fails
  std::atomic<std::uint64_t> tokens_ = 0, missed_ = 0;
  std::atomic<bool> stopping_ = false;
  std::exception_ptr failure_;
  std::thread thread_;
};

}  // namespace kiroku::recorder

// The one writer of a case's ledger during a session.
#pragma once

#include <atomic>
#include <chrono>
#include <map>
#include <memory>
#include <string>
#include <thread>

#include "archive/writing/case_writer.h"
#include "recorder/clock/clock_watch.h"
#include "recorder/fact_queue.h"
#include "recorder/lane.h"
#include "recorder/pre_roll.h"
#include "recorder/stamper.h"

namespace kiroku::recorder {

/// Appends the facts that lanes and authorities hand over, states the clock, and signs and stamps checkpoints
/// at their times, on a thread of its own from start() to finish(). Before begin_case() there is no case:
/// what is handed over is held, as long as the pre-roll wants it.
class LedgerWriter {
 public:
  /// `pre_roll` may be null: then begin_case() is called before start(). All must outlive the object.
  LedgerWriter(FactQueue& facts, const CaseClock& clock, ProblemLog& problems, PreRoll* pre_roll,
               std::chrono::nanoseconds stamp_interval);
  ~LedgerWriter();
  void start();
  /// From now on everything goes into this case; what is held goes first. Once, from any thread. `writer` is
  /// used by this object's thread alone from here on.
  void begin_case(archive::CaseWriter& writer, Stamper& stamper);
  /// There will be no case: ends the thread. What is held stays with the pre-roll.
  void abandon();
  /// Streams that are recorded as they come, and until when they were.
  struct Ended {
    std::vector<std::string> streams;
    std::int64_t at_ns = 0;
  };
  /// All lanes have finished: appends the rest, a gap for each of these streams where the disk took long for
  /// the last files, and `close`; has the last state stamped, waits for the authorities, and signs the last
  /// checkpoint. Throws kiroku::Error if the ledger could not be written to its end.
  void finish(const std::string& close_reason, const Ended& ended);

  [[nodiscard]] std::uint64_t tokens() const { return tokens_; }
  [[nodiscard]] std::uint64_t missed() const { return missed_; }

 private:
  void run();
  void hold();
  /// An entry of the wall clock, where one is due.
  void state_clock();
  void write(std::vector<Fact> facts);
  void write(StandbySegment segment);
  void write(const AuthorityAnswer& answer);
  void state_slow_end(const Ended& ended, const archive::Moment& close);
  /// What people should hear of an authority's answer.
  void tell(const AuthorityAnswer& answer);

  struct Case {
    archive::CaseWriter* writer;
    Stamper* stamper;
  };
  [[nodiscard]] archive::CaseWriter& writer() { return *case_.load()->writer; }
  [[nodiscard]] Stamper& stamper() { return *case_.load()->stamper; }

  FactQueue& facts_;
  const CaseClock& clock_;
  ProblemLog& problems_;
  PreRoll* pre_roll_;
  Case begun_{};
  std::atomic<Case*> case_ = nullptr;  // &begun_ from begin_case() on
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

// A stream of vital signs: reader thread, JSON Lines, durable segments.
#pragma once

#include <atomic>
#include <memory>
#include <thread>

#include "recorder/lane.h"
#include "recorder/source/source_address.h"
#include "recorder/stream_output.h"
#include "recorder/vitals/vital_source.h"
#include "recorder/vitals/vitals_segmenter.h"
#include "recorder/vitals_tap.h"

namespace kiroku::recorder {

class VitalsLane : public Lane, private VitalsSegmentSink {
 public:
  VitalsLane(const LaneContext& context, std::size_t stream_index, archive::StreamInfo info,
             const SourceAddress& address, std::unique_ptr<VitalSource> source,
             std::shared_ptr<VitalsTap> tap = nullptr);
  ~VitalsLane() override;

  void start() override;
  void case_begins(std::int64_t begins_ns) override { source_->case_begins(begins_ns); }
  void stop() override;
  void finish(std::int64_t close_ns) override;
  [[nodiscard]] bool ended() const override { return ended_; }
  [[nodiscard]] bool reached_end() const override { return reached_end_; }
  [[nodiscard]] bool is_unpaced() const override { return unpaced_; }
  void split_at(std::int64_t time_ns) override { split_ns_ = time_ns; }
  [[nodiscard]] bool is_split_at(std::int64_t time_ns) const override { return segment_since_ns_ >= time_ns; }
  [[nodiscard]] LaneStatus status() const override;
  [[nodiscard]] const std::string& name() const override { return output_.info().name; }

 private:
  void read();
  /// Records one line, or waits a little for one; false when nothing more will be recorded.
  bool take_next();
  bool wait_for_arrivals();
  /// Nothing comes any more from before `until_ns`, which is not later than now.
  void advance_to(std::int64_t until_ns);
  /// Where it was asked for: nothing comes any more from before `next_ns`.
  void split_before(std::int64_t next_ns);
  /// Where the machine slept since what came last, states a gap until `until_ns`, likewise.
  void pass_over_sleep(std::int64_t until_ns);
  /// A person should hear of it: who may not send, messages that are not taken, beds and patients that are
  /// mixed.
  void tell(const media::VitalNotice& notice);
  std::optional<VitalLine> next_line();
  /// Waits until the case clock shows `time_ns`, ending segments meanwhile.
  void wait_for(std::int64_t time_ns);
  [[nodiscard]] std::int64_t end_of_stream(std::int64_t close_ns) const;
  void fail(const std::exception& error);
  void begin_segment(std::uint64_t index, std::int64_t start_ns) override;
  void write(ByteView lines) override;
  void end_segment(std::int64_t end_ns, std::uint64_t samples) override;

  LaneContext context_;
  const bool unpaced_;
  std::unique_ptr<VitalSource> source_;
  const std::shared_ptr<VitalsTap> tap_;  // null: nobody looks on
  StreamOutput output_;
  VitalsSegmenter segmenter_;
  std::atomic<bool> stopping_ = false, ended_ = false, reached_end_ = false, live_ = false;
  std::atomic<std::uint64_t> samples_ = 0;
  std::atomic<std::int64_t> last_ns_ = 0;
  std::atomic<std::int64_t> split_ns_ = INT64_MIN, segment_since_ns_ = 0;
  std::uint64_t samples_before_segment_ = 0;
  bool failed_ = false;
  std::optional<archive::GapCause> gap_cause_;  // why nothing more could be recorded
  std::thread thread_;
};

}  // namespace kiroku::recorder

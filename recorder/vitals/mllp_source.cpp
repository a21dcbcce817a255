#include "recorder/vitals/mllp_source.h"

#include <atomic>
#include <condition_variable>
#include <deque>
#include <mutex>
#include <utility>

#include "base/error.h"
#include "recorder/clock/case_clock.h"
#include "recorder/source/source_address.h"
#include "recorder/vitals/hl7_vitals.h"
#include "recorder/vitals/mllp_address.h"
#include "recorder/vitals/mllp_server.h"

namespace kiroku::recorder {
namespace {

/// So often a reader who waits hears that nothing has come.
constexpr std::chrono::milliseconds kPatience{50};

/// So much a line takes while it waits.
std::size_t memory_of(const VitalLine& line) {
  struct Texts {
    std::size_t operator()(const media::VitalSample& sample) const {
      return sample.code.size() + sample.unit.size() + sample.source.size() +
             sample.values.size() * sizeof(double);
    }
    std::size_t operator()(const media::VitalText& text) const {
      return text.code.size() + text.text.size() + text.source.size();
    }
    std::size_t operator()(const media::DeviceAlarm& alarm) const {
      return alarm.code.size() + alarm.text.size() + alarm.about.size() + alarm.phase.size() +
             alarm.state.size() + alarm.priority.size() + alarm.source.size();
    }
    std::size_t operator()(const media::DeviceMessage& message) const {
      return message.bytes.size() + message.source.size();
    }
    std::size_t operator()(const media::DeviceClock& clock) const { return clock.source.size(); }
    std::size_t operator()(const media::VitalNotice& notice) const {
      return notice.notice.size() + notice.text.size() + notice.source.size();
    }
  };
  return sizeof line + std::visit(Texts{}, line);
}

class MllpSource : public VitalSource {
 public:
  MllpSource(const SourceAddress& address, const CaseClock& clock)
      : clock_(clock),
        vitals_(parse_assumed_zone(address.option("zone", "local"), address.stated), mllp_senders(address),
                hl7_places(address)),
        server_(
            mllp_server_options(address),
            [this](std::string_view message, const std::string& peer) { return take(message, peer); },
            [this](const std::string& name, const std::string& text, const std::string& peer) {
              complain(name, text, peer);
            }) {}

  std::optional<VitalLine> next() override {
    if (!started_) {
      started_ = true;
      server_.start();
    }
    if (interrupted_) {
      server_.stop();  // what is in the queue then is all there will be
    }
    std::unique_lock lock(mutex_);
    arrived_.wait_for(lock, kPatience, [this] { return !queue_.empty() || interrupted_; });
    quiet_until_ns_.reset();
    if (queue_.empty() && untold_ > 0) {
      const std::string count = std::to_string(std::exchange(untold_, 0));
      return media::VitalNotice{taking_since_ns_.value_or(clock_.now_ns()), "complaints-left-out",
                                count + " complaints about connections had no room in the queue", ""};
    }
    if (queue_.empty()) {
      if (!interrupted_ || !drained_) {
        drained_ = interrupted_;  // once more after the server has stopped
        quiet_until_ns_ = taking_since_ns_.value_or(clock_.now_ns());
      }
      return std::nullopt;
    }
    VitalLine line = std::move(queue_.front());
    queued_bytes_ -= memory_of(line);
    queue_.pop_front();
    return line;
  }

  [[nodiscard]] std::optional<std::int64_t> quiet_until_ns() const override { return quiet_until_ns_; }
  [[nodiscard]] bool is_live() const override { return true; }
  [[nodiscard]] std::uint64_t refused() const override { return server_.refused() + vitals_.refused(); }
  [[nodiscard]] std::uint64_t elsewhere() const override { return vitals_.elsewhere(); }
  void case_begins(std::int64_t begins_ns) override { vitals_.case_begins(begins_ns); }
  void hear_patients(std::shared_ptr<PatientWatch> watch) override {
    vitals_.hear_patients(std::move(watch));
  }

  void interrupt() noexcept override {
    interrupted_ = true;
    arrived_.notify_all();
  }

 private:
  // Both on the server's thread.
  std::optional<MllpServer::Answer> take(std::string_view message, const std::string& peer) {
    std::int64_t now_ns = 0;
    {
      const std::lock_guard lock(mutex_);
      if (is_full()) return std::nullopt;
      // Until its lines are in the queue nobody may believe that nothing came since now.
      now_ns = clock_.now_ns();
      taking_since_ns_ = now_ns;
    }
    Hl7Vitals::Taken taken;
    try {
      taken = vitals_.take(message, now_ns, utc_now(), peer);
    } catch (const std::exception&) {
      push({});
      throw;
    }
    push(std::move(taken.lines));
    return MllpServer::Answer{std::move(taken.acknowledgement), taken.is_of_sender};
  }

  void complain(const std::string& name, const std::string& text, const std::string& peer) {
    std::int64_t now_ns = 0;
    {
      const std::lock_guard lock(mutex_);
      // Whoever complains cannot wait, as a message can.
      if (is_full()) {
        ++untold_;
        return;
      }
      now_ns = clock_.now_ns();
      taking_since_ns_ = now_ns;
    }
    std::vector<VitalLine> lines;
    lines.emplace_back(media::VitalNotice{now_ns, name, text, "@" + peer});
    push(std::move(lines));
  }

  /// With the mutex held.
  [[nodiscard]] bool is_full() const { return queued_bytes_ >= kMllpQueueBytes; }

  void push(std::vector<VitalLine> lines) {
    {
      const std::lock_guard lock(mutex_);
      taking_since_ns_.reset();
      for (VitalLine& line : lines) {
        queued_bytes_ += memory_of(line);
        queue_.push_back(std::move(line));
      }
    }
    arrived_.notify_one();
  }

  const CaseClock& clock_;
  Hl7Vitals vitals_;  // the server's thread alone, but for refused(), elsewhere() and case_begins()
  bool started_ = false, drained_ = false;
  std::optional<std::int64_t> quiet_until_ns_;
  std::atomic<bool> interrupted_ = false;
  std::mutex mutex_;
  std::condition_variable arrived_;
  std::deque<VitalLine> queue_;
  std::size_t queued_bytes_ = 0;
  std::uint64_t untold_ = 0;  // complaints that found no room since the last that were told
  std::optional<std::int64_t> taking_since_ns_;
  MllpServer server_;  // last: its thread uses the rest
};

}  // namespace

std::unique_ptr<VitalSource> open_mllp_source(const SourceAddress& address, const CaseClock& clock) {
  return std::make_unique<MllpSource>(address, clock);
}

}  // namespace kiroku::recorder

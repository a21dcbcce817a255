#include "recorder/vitals/awaited_source.h"

#include <algorithm>
#include <atomic>
#include <chrono>
#include <mutex>
#include <thread>

#include "base/error.h"
#include "recorder/clock/case_clock.h"

namespace kiroku::recorder {
namespace {

constexpr std::int64_t kRetryNs = 2'000'000'000;
// So often a reader who waits hears that nothing has come.
constexpr std::chrono::milliseconds kPatience{50};

class AwaitedSource : public VitalSource {
 public:
  AwaitedSource(SourceAddress address, const CaseClock& clock, std::string why)
      : address_(std::move(address)), clock_(clock), why_(std::move(why)) {}

  std::optional<VitalLine> next() override {
    if (!told_) {
      told_ = true;
      next_try_ns_ = clock_.now_ns() + kRetryNs;
      return notice(clock_.now_ns(), "source-absent", why_ + "; it is tried again");
    }
    if (source_) return from_source();
    if (!interrupted_ && clock_.now_ns() >= next_try_ns_) {
      next_try_ns_ = clock_.now_ns() + kRetryNs;
      if (open()) {
        return notice(present_since_ns_, "source-present", "source '" + address_.stated + "' is there");
      }
    }
    std::this_thread::sleep_for(kPatience);
    return {};
  }
  [[nodiscard]] std::optional<std::int64_t> quiet_until_ns() const override {
    if (source_) return source_->quiet_until_ns();
    if (interrupted_) return {};
    return clock_.now_ns();
  }
  void interrupt() noexcept override {
    const std::lock_guard guard(mutex_);
    interrupted_ = true;
    if (source_) source_->interrupt();
  }
  void hear_patients(std::shared_ptr<PatientWatch> watch) override { watch_ = std::move(watch); }
  [[nodiscard]] bool is_live() const override { return true; }
  [[nodiscard]] std::uint64_t refused() const override {
    const std::lock_guard guard(mutex_);
    return source_ ? source_->refused() : 0;
  }
  [[nodiscard]] std::uint64_t elsewhere() const override {
    const std::lock_guard guard(mutex_);
    return source_ ? source_->elsewhere() : 0;
  }

 private:
  [[nodiscard]] VitalLine notice(std::int64_t time_ns, const std::string& word,
                                 const std::string& sentence) const {
    return media::VitalNotice{time_ns, word, sentence, address_.stated};
  }
  bool open() {
    try {
      auto opened = open_vital_source(address_, clock_);
      opened->hear_patients(watch_);
      const std::lock_guard guard(mutex_);
      source_ = std::move(opened);
      present_since_ns_ = clock_.now_ns();
      if (interrupted_) source_->interrupt();
      return true;
    } catch (const Error&) {
      return false;  // as the notice says
    }
  }
  std::optional<VitalLine> from_source() {
    std::optional<VitalLine> line = source_->next();
    if (line) media::set_time_ns(*line, std::max(media::time_ns_of(*line), present_since_ns_));
    return line;
  }

  const SourceAddress address_;
  const CaseClock& clock_;
  const std::string why_;
  std::shared_ptr<PatientWatch> watch_;
  mutable std::mutex mutex_;  // guards the pointer against interrupt()
  std::unique_ptr<VitalSource> source_;
  std::atomic<bool> interrupted_ = false;
  bool told_ = false;
  std::int64_t next_try_ns_ = 0, present_since_ns_ = 0;
};

}  // namespace

std::unique_ptr<VitalSource> await_vital_source(const SourceAddress& address, const CaseClock& clock,
                                                const std::string& why) {
  return std::make_unique<AwaitedSource>(address, clock, why);
}

}  // namespace kiroku::recorder

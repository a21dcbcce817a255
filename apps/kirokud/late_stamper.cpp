#include "apps/kirokud/late_stamper.h"

#include <chrono>
#include <exception>
#include <utility>

#include <spdlog/spdlog.h>

#include "apps/kirokud/catalogue_note.h"
#include "archive/storage/file_system.h"
#include "base/printable.h"

namespace kiroku::apps {
namespace {

// What the recovery of cases left to be asked for waits no longer than it must.
constexpr std::chrono::seconds kFirstPause{1};
constexpr std::chrono::seconds kLateStampInterval{15};

}  // namespace

LateStamper::LateStamper(const Home& home, const Authorities& authorities, const WritableHome& shared)
    : home_(home),
      stamping_(authorities.named(), {nullptr, home.archive(), &shared.key, home.device().name(),
                                      shared.log.get(), &shared.trust, shared.queue.get()}),
      thread_([this] { run(); }) {}

LateStamper::~LateStamper() {
  {
    const std::lock_guard guard(mutex_);
    ending_ = true;
  }
  changed_.notify_all();
  thread_.join();
}

void LateStamper::run() {
  std::unique_lock lock(mutex_);
  std::chrono::seconds pause = kFirstPause;
  while (!changed_.wait_for(lock, std::exchange(pause, kLateStampInterval), [this] { return ending_; })) {
    lock.unlock();
    try {
      for (const auto& each : stamping_.work_off(recorder::LateStamping::Patience::kAllPauses).stamped) {
        spdlog::info("case {} is stamped by {} now", each.case_id, each.authority);
        tell_catalogue(home_, home_.archive() / each.case_id);
      }
    } catch (const std::exception& error) {
      spdlog::warn("time-stamps that did not come cannot be asked for now: {}", printable(error.what()));
    }
    lock.lock();
  }
}

}  // namespace kiroku::apps

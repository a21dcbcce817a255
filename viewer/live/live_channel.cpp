#include "viewer/live/live_channel.h"

#include <algorithm>
#include <exception>
#include <optional>
#include <sys/resource.h>
#include <unistd.h>
#include <utility>

#include "viewer/live/live_encoder.h"

namespace kiroku::live {
namespace {

constexpr std::chrono::milliseconds kPatience{200};
/// Below every thread that records (nice(2); on Linux each thread has its own).
constexpr int kNice = 10;

}  // namespace

LiveChannel::LiveChannel(std::shared_ptr<recorder::PictureTap> tap,
                         std::function<void(const std::string&)> tell)
    : tap_(std::move(tap)), tell_(std::move(tell)), thread_([this] { run(); }) {}

LiveChannel::~LiveChannel() {
  {
    const std::lock_guard guard(mutex_);
    ending_ = true;
  }
  changed_.notify_all();
  thread_.join();
}

void LiveChannel::add(std::shared_ptr<Watcher> watcher) {
  {
    const std::lock_guard guard(mutex_);
    places_.push_back({std::move(watcher)});
    newcomer_ = true;
    tap_->watch(true);
  }
  changed_.notify_all();
}

void LiveChannel::remove(const Watcher* watcher) {
  const std::lock_guard guard(mutex_);
  std::erase_if(places_, [&](const Place& place) { return place.watcher.get() == watcher; });
  if (places_.empty()) tap_->watch(false);
}

void LiveChannel::run() {
  (void)::setpriority(PRIO_PROCESS, static_cast<id_t>(::gettid()), kNice);
  std::unique_ptr<LiveEncoder> encoder;
  std::shared_ptr<const Bytes> init;
  std::string codecs, told;
  for (;;) {
    {
      std::unique_lock lock(mutex_);
      if (places_.empty()) encoder.reset();
      changed_.wait(lock, [this] { return ending_ || !places_.empty(); });
      if (ending_) return;
    }
    std::optional<recorder::PictureTap::Picture> picture = tap_->take(kPatience);
    if (!picture) continue;
    bool want_key = false;
    {
      const std::lock_guard guard(mutex_);
      want_key = std::exchange(newcomer_, false);
    }
    std::vector<Fragment> fragments;
    try {
      if (!encoder || !encoder->can_take(*picture)) {
        encoder = std::make_unique<LiveEncoder>(*picture);
        init = std::make_shared<const Bytes>(encoder->init().bytes);
        codecs = encoder->init().codecs;
        const std::lock_guard guard(mutex_);
        for (Place& place : places_) place.has_begun = false;
      }
      fragments = encoder->encode(std::move(*picture), want_key);
    } catch (const std::exception& error) {
      // Once, not with each picture.
      if (std::exchange(told, error.what()) != error.what()) {
        tell_(std::string("live pictures are left out: ") + error.what());
      }
      encoder.reset();
    }
    const std::lock_guard guard(mutex_);
    // A picture of two fields still waits for the next, and the newcomer for its key frame.
    if (fragments.empty()) newcomer_ = newcomer_ || want_key;
    for (Fragment& fragment : fragments) {
      const auto bytes = std::make_shared<const Bytes>(std::move(fragment.bytes));
      for (Place& place : places_) {
        if ((!place.has_begun || place.waits_for_key) && !fragment.is_key) continue;
        place.has_begun = place.has_begun || place.watcher->begin(init, codecs);
        place.waits_for_key = !place.has_begun || !place.watcher->take(bytes, fragment.time_ns);
      }
    }
  }
}

}  // namespace kiroku::live

// A server beside recording that is opened again until it is there: its port may be another program's for a
// while, or its certificate come late.
#pragma once

#include <chrono>
#include <exception>
#include <functional>
#include <future>
#include <memory>
#include <string>
#include <sys/resource.h>
#include <unistd.h>
#include <utility>

#include "base/clock.h"
#include "recorder/back_off.h"

namespace kiroku::apps {

/// What is begun on a thread whose threads go behind recording: whoever watches or asks by a network waits
/// first.
template <typename Make>
auto begin_behind_the_recording(Make make) {
  constexpr int kNiceOfOthers = 10;  // nice(2); on Linux each thread has its own, and inherits it
  return std::async(std::launch::async, [make = std::move(make)] {
    (void)::setpriority(PRIO_PROCESS, static_cast<id_t>(::gettid()), kNiceOfOthers);
    return make();
  });
}

/// What a KeptServer tells, each a sentence for people.
struct KeptServerListener {
  std::function<void(const std::string& sentence)> without;  // what recording goes on without, and why
  std::function<void(const std::string& sentence)> no_more;  // such a sentence holds no more
};

/// From one thread. The server is destroyed with it; an attempt that is under way is waited for then.
template <typename Server>
class KeptServer {
 public:
  using Open =
      std::function<std::unique_ptr<Server>()>;  // throws where it cannot be; called by other threads

  /// Opens it, or says that recording goes on without `what`. Nothing is ever opened by a null `open`.
  KeptServer(std::string what, Open open, KeptServerListener listener, const Clock& clock)
      : what_(std::move(what)), open_(std::move(open)), listener_(std::move(listener)), clock_(&clock) {
    if (!open_) return;
    begin();
    if (attempt_.valid()) take();
  }

  /// Call each second or so; never waits for an attempt.
  void tend() {
    if (server_ || !open_) return;
    if (attempt_.valid()) {
      if (attempt_.wait_for(std::chrono::seconds(0)) == std::future_status::ready) take();
    } else if (clock_->now() >= pause_.next()) {
      begin();
    }
  }

  [[nodiscard]] bool is_there() const { return server_ != nullptr; }

 private:
  /// A machine that has no thread left ends no recorder for it.
  void begin() {
    try {
      attempt_ = begin_behind_the_recording(open_);
    } catch (const std::exception& error) {
      failed(error.what());
    }
  }

  void take() {
    try {
      server_ = attempt_.get();
      if (!told_.empty()) listener_.no_more(std::exchange(told_, ""));
    } catch (const std::exception& error) {
      failed(error.what());
    }
  }

  void failed(const std::string& why) {
    pause_.failed(clock_->now(), {});
    const std::string sentence = "recording goes on without " + what_ + ": " + why;
    if (sentence == told_) return;
    if (!told_.empty()) listener_.no_more(told_);
    told_ = sentence;
    listener_.without(sentence);
  }

  std::string what_;
  Open open_;
  KeptServerListener listener_;
  const Clock* clock_;
  std::string told_;
  recorder::BackOff pause_{{.first = std::chrono::seconds(5), .longest = std::chrono::minutes(1)}, 0};
  std::unique_ptr<Server> server_;
  std::future<std::unique_ptr<Server>> attempt_;
};

}  // namespace kiroku::apps

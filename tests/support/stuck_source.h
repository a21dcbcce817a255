// A camera whose driver does not come back: a thread that opens, reads or closes it waits in a system call
// that no interruption ends, until the test lets it go.
#pragma once

#include <array>
#include <atomic>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <unistd.h>
#include <utility>

#include "base/error.h"
#include "recorder/source/source_guard.h"

namespace kiroku::test {

/// Where threads wait: reading an empty pipe. Threads that it holds when it is destroyed are let go.
class StuckDriver {
 public:
  StuckDriver() {
    if (::pipe(ends_->data()) != 0) throw Error("no pipe can be made");
  }
  ~StuckDriver() { release(); }
  StuckDriver(const StuckDriver&) = delete;
  StuckDriver& operator=(const StuckDriver&) = delete;

  /// What a thread calls.
  [[nodiscard]] auto wait() const {
    return [ends = ends_, waiting = waiting_] {
      ++*waiting;
      char byte = 0;
      (void)!::read(ends->front(), &byte, 1);
      --*waiting;
    };
  }
  /// Threads that wait now.
  [[nodiscard]] int waiting() const { return *waiting_; }
  /// Those that wait come back, and nobody waits from now on.
  void release() {
    if (ends_->back() >= 0) ::close(std::exchange(ends_->back(), -1));
  }

 private:
  // Shared with threads that outlive the test; so its reading end stays open.
  std::shared_ptr<std::array<int, 2>> ends_ = std::make_shared<std::array<int, 2>>();
  std::shared_ptr<std::atomic<int>> waiting_ = std::make_shared<std::atomic<int>>(0);
};

/// Gives `pictures` of a synthetic camera, live, and then waits in the driver. `stuck` of "opening" and
/// "closing" makes it wait there.
inline recorder::SourceGuard::Maker stuck_camera(const StuckDriver& driver, int pictures,
                                                 std::string stuck = "reading") {
  class Camera : public recorder::Source {
   public:
    Camera(std::unique_ptr<recorder::Source> inner, std::function<void()> wait, int pictures, bool closing)
        : inner_(std::move(inner)), wait_(std::move(wait)), pictures_(pictures), closing_(closing) {}
    ~Camera() override {
      if (closing_) wait_();
    }
    Camera(const Camera&) = delete;
    Camera& operator=(const Camera&) = delete;
    [[nodiscard]] recorder::PictureFormat format() const override { return inner_->format(); }
    [[nodiscard]] recorder::Rational frame_rate() const override { return inner_->frame_rate(); }
    [[nodiscard]] bool is_live() const override { return true; }
    std::optional<recorder::TimedFrame> read() override {
      if (interrupted()) return {};
      if (pictures_-- > 0) {
        auto frame = inner_->read();
        if (frame) frame->lost_before = 0;  // what was due before it was opened
        return frame;
      }
      if (closing_) throw Error("the cable was pulled");
      wait_();
      throw Error("the driver came back without a picture");
    }

   private:
    const std::unique_ptr<recorder::Source> inner_;
    const std::function<void()> wait_;
    int pictures_;
    const bool closing_;
  };
  return [wait = std::function<void()>(driver.wait()), pictures, stuck = std::move(stuck)](
             const recorder::SourceAddress&, const recorder::CaseClock& clock,
             const recorder::OpeningTerms&) {
    if (stuck == "opening") wait();
    auto inner =
        recorder::open_source(recorder::parse_source_address("synthetic:pattern?size=64x48&rate=20"), clock);
    return std::make_unique<Camera>(std::move(inner), wait, pictures, stuck == "closing");
  };
}

}  // namespace kiroku::test

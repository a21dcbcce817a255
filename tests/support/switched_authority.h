// An authority behind a switch, for outages. Its members may be changed from any thread while it is
// asked.
#pragma once

#include <atomic>
#include <chrono>
#include <memory>
#include <optional>
#include <utility>

#include "timestamp/client.h"

namespace kiroku::test {

class SwitchedAuthority : public timestamp::StampSource {
 public:
  explicit SwitchedAuthority(std::shared_ptr<timestamp::StampSource> inner) : inner_(std::move(inner)) {}
  Bytes ask(ByteView query) override {
    ++requests;
    held.wait(true);
    if (!up) {
      const std::chrono::seconds pause(leave_alone_for_s);
      throw timestamp::AuthorityError("the authority is not there",
                                      pause.count() > 0 ? std::optional(pause) : std::nullopt);
    }
    return inner_->ask(query);
  }
  /// Lets go whoever asks while `held` is set.
  void release() {
    held = false;
    held.notify_all();
  }
  [[nodiscard]] std::string path() const override { return "over wwan0"; }

  std::atomic<bool> up = true;
  std::atomic<bool> held = false;  // it answers nobody before release()
  std::atomic<int> requests = 0;
  std::atomic<int> leave_alone_for_s = 0;  // what it asks for while it is not up; 0: nothing

 private:
  std::shared_ptr<timestamp::StampSource> inner_;
};

}  // namespace kiroku::test

// A breathing workbench over one WebSocket (docs/reference/viewer.md, "Breathing").
#pragma once

#include <atomic>
#include <functional>
#include <memory>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "viewer/breathing/breathing_messages.h"
#include "viewer/breathing/breathing_room.h"
#include "viewer/http/socket.h"

namespace kiroku::viewer {

/// One model that is sealed in a thread of its own: authorities may take longer to answer than a connection
/// lives that is not read. Thread-safe.
class BackgroundSeal {
 public:
  /// `work` gives the messages to send, and throws nothing. It is over before they are sent: who has read
  /// them may ask for the next.
  BackgroundSeal(std::function<std::vector<std::string>()> work, std::shared_ptr<SocketOutput> output)
      : thread_([this, work = std::move(work), output = std::move(output)] {
          const std::vector<std::string> messages = work();
          over_ = true;
          for (const std::string& message : messages) output->send_text(message);
        }) {}
  /// Waits for it: what is being sealed is sealed.
  ~BackgroundSeal() { thread_.join(); }
  BackgroundSeal(const BackgroundSeal&) = delete;
  BackgroundSeal& operator=(const BackgroundSeal&) = delete;

  [[nodiscard]] bool over() const { return over_; }

 private:
  std::atomic<bool> over_ = false;
  std::thread thread_;  // last, as it uses all above
};

class BreathingSocket : public SocketHandler {
 public:
  /// `room` must outlive it. `person` as
  /// Session::person(). Refusal 503 where all places are taken.
  BreathingSocket(BreathingRoom& room, const std::string& person, std::shared_ptr<SocketOutput> output);
  void receive(const SocketMessage& message) override;

 private:
  /// `input`: the number of the message that asks for it, which what is told of a saved model names.
  void save(std::uint64_t input, const SaveMotion& wanted);
  void begin_seal(std::uint64_t input, const SaveMotion& wanted);
  /// The messages that tell of it.
  [[nodiscard]] std::vector<std::string> seal(std::uint64_t input, const SaveMotion& wanted) const;
  void tell(const std::string& sentence) const;
  void begin_fit(const FitDeed& deed);
  [[nodiscard]] BreathingListener listener();

  BreathingRoom& room_;
  const std::string person_;
  std::shared_ptr<SocketOutput> output_;
  std::unique_ptr<Turns::Turn> place_;
  std::uint64_t last_input_ = 0;
  // Last: over before what they use.
  std::unique_ptr<LiveBreathing> live_;
  std::unique_ptr<BackgroundFit> fit_;
  std::unique_ptr<BackgroundSeal> seal_;
};

}  // namespace kiroku::viewer

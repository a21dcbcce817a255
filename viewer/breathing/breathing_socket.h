// A breathing workbench over one WebSocket (docs/reference/viewer.md, "Breathing").
#pragma once

#include <memory>
#include <string>

#include "viewer/breathing/breathing_messages.h"
#include "viewer/breathing/breathing_room.h"
#include "viewer/http/socket.h"

namespace kiroku::viewer {

class BreathingSocket : public SocketHandler {
 public:
  /// `room` must outlive it. `person` as
  /// Session::person(). Refusal 503 where all places are taken.
  BreathingSocket(BreathingRoom& room, const std::string& person, std::shared_ptr<SocketOutput> output);
  void receive(const SocketMessage& message) override;

 private:
  void save(const SaveMotion& wanted);
  void seal(const SaveMotion& wanted);
  void tell_saved(const SaveMotion& wanted, const std::string& file, const SealedModel* seal);
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
};

}  // namespace kiroku::viewer

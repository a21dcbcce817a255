// Planning over one WebSocket (docs/reference/viewer.md, "Planning").
#pragma once

#include <functional>
#include <memory>
#include <mutex>
#include <string>

#include "viewer/http/socket.h"
#include "viewer/planning/planning_messages.h"
#include "viewer/planning/planning_room.h"

namespace kiroku::viewer {

class PlanningSocket : public SocketHandler {
 public:
  /// Puts the opening of a plan into the appliance log, or throws a Refusal: then nothing of it is shown.
  /// Called on a thread of its own.
  using EnterOpening = std::function<void(const std::string& plan)>;

  /// `room` must outlive it. `person` as Session::person().
  PlanningSocket(PlanningRoom& room, std::string person, std::shared_ptr<SocketOutput> output,
                 EnterOpening enter);
  void receive(const SocketMessage& message) override;

 private:
  void open(const OpenMessage& message);
  void save(const SaveMessage& message);
  [[nodiscard]] PlanningListener listener();

  PlanningRoom& room_;
  const std::string person_;
  std::shared_ptr<SocketOutput> output_;
  EnterOpening enter_;
  std::unique_ptr<Turns::Turn> place_;
  std::uint64_t last_input_ = 0;
  std::unique_ptr<LivePlanning> planning_;  // last: over before what it uses
};

}  // namespace kiroku::viewer

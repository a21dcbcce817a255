// Planning over one WebSocket (docs/viewer.md, "Planning").
#pragma once

#include <memory>
#include <mutex>
#include <string>

#include "viewer/planning/planning_messages.h"
#include "viewer/planning/planning_room.h"
#include "viewer/server/socket.h"

namespace kiroku::viewer {

class PlanningSocket : public SocketHandler {
 public:
  /// `room` must outlive it.
  PlanningSocket(PlanningRoom& room, std::shared_ptr<SocketOutput> output);
  void receive(const SocketMessage& message) override;

 private:
  void open(const OpenMessage& message);
  void save(const SaveMessage& message);
  [[nodiscard]] PlanningListener listener();

  PlanningRoom& room_;
  std::shared_ptr<SocketOutput> output_;
  std::unique_ptr<PlanningRoom::Place> place_;
  std::uint64_t last_input_ = 0;
  std::unique_ptr<LivePlanning> planning_;  // last: over before what it uses
};

}  // namespace kiroku::viewer

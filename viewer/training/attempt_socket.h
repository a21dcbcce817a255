// One attempt over one WebSocket (docs/explanation/training.md, "The page").
#pragma once

#include <memory>
#include <optional>

#include "viewer/http/socket.h"
#include "viewer/training/attempt_messages.h"
#include "viewer/training/training_room.h"

namespace kiroku::viewer {

/// Its end breaks off an attempt that runs, and waits until that is kept.
class AttemptSocket : public SocketHandler {
 public:
  /// `room` must outlive it.
  AttemptSocket(TrainingRoom& room, TrainingUser user, std::shared_ptr<SocketOutput> output);
  void receive(const SocketMessage& message) override;

 private:
  void begin(const BeginMessage& message);
  /// Refusal 409 of somebody simulated, 403 where the user may not train as this trainee.
  [[nodiscard]] trainer::Trainee require_may_train(const trainer::TrainingDatabase& results,
                                                   const std::string& name) const;
  [[nodiscard]] trainer::LiveListener listener(std::int64_t attempt, const trainer::ExclusionRecord& record,
                                               bool shows_press, std::size_t tests_before);

  TrainingRoom& room_;
  TrainingUser user_;
  std::shared_ptr<SocketOutput> output_;
  std::unique_ptr<AttemptFiles> files_;            // until the attempt is over
  std::unique_ptr<Turns::Turn> place_;             // until the attempt is over
  std::unique_ptr<trainer::LiveAttempt> attempt_;  // last: over before what it uses
};

}  // namespace kiroku::viewer

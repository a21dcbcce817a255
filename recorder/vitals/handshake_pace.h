// Which addresses may begin a TLS handshake, whose cost is a signature on the thread that takes the monitors'
// messages. An address that delivered a message once waits for nothing; another one waits after connections
// that brought none. All addresses of one IPv6 /64 have a bound of their own, a wide one: whoever takes
// another address each time keeps the neighbours waiting, and not out. Not thread-safe.
#pragma once

#include <set>
#include <string>

#include "base/attempt_guard.h"

namespace kiroku::recorder {

class HandshakePace {
 public:
  using Time = AttemptGuard::Clock::time_point;
  HandshakePace(AttemptLimits of_address, AttemptLimits of_network);

  [[nodiscard]] bool must_wait(const std::string& address, Time now) const;
  /// A connection of this address ended, and brought no message.
  void note_failure(const std::string& address, Time now);
  void note_message(const std::string& address);

 private:
  AttemptGuard addresses_, networks_;
  std::set<std::string> monitors_;  // the first ones that delivered a message
};

}  // namespace kiroku::recorder

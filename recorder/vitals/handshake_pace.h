// Which addresses may begin a TLS handshake, whose cost is a signature on the thread that takes the monitors'
// messages. An address that delivered a message once waits for nothing; another one waits after connections
// that brought none. All such addresses of one IPv6 /64 share some handshakes a second: one machine that has
// an address for each connection takes them from its neighbours, and no more. Not thread-safe.
#pragma once

#include <cstddef>
#include <map>
#include <set>
#include <string>

#include "base/attempt_guard.h"

namespace kiroku::recorder {

class HandshakePace {
 public:
  using Time = AttemptGuard::Clock::time_point;
  /// `network_each_second`: handshakes of one network's addresses that delivered nothing yet.
  HandshakePace(AttemptLimits of_address, std::size_t network_each_second);

  /// Where it is true, one of the network's is used up.
  [[nodiscard]] bool may_begin(const std::string& address, Time now);
  /// A connection of this address ended, and brought no message.
  void note_failure(const std::string& address, Time now) { addresses_.failed(address, now); }
  void note_message(const std::string& address);

 private:
  [[nodiscard]] bool take_of_network(const std::string& network, Time now);
  struct Second {
    Time begin;
    std::size_t taken = 0;
  };
  AttemptGuard addresses_;
  const std::size_t network_each_second_;
  std::map<std::string, Second> networks_;
  std::set<std::string> monitors_;  // the first ones that delivered a message
};

}  // namespace kiroku::recorder

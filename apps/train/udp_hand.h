// A hand on the network, as the option --hand names it.
#pragma once

#include <cstdint>
#include <optional>
#include <string>

namespace kiroku::apps {

struct UdpAddress {
  std::string address = "127.0.0.1";
  std::uint16_t port = 0;
};
/// "udp:PORT" or "udp:ADDRESS:PORT"; nothing for what does not begin with "udp:". kiroku::UsageError for a
/// port that is none.
std::optional<UdpAddress> udp_address(const std::string& hand);

}  // namespace kiroku::apps

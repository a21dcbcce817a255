#include "apps/train/udp_hand.h"

#include "apps/sim/number_option.h"

namespace kiroku::apps {

std::optional<UdpAddress> udp_address(const std::string& hand) {
  const std::string scheme = "udp:";
  if (!hand.starts_with(scheme)) return std::nullopt;
  UdpAddress found;
  std::string port = hand.substr(scheme.size());
  if (const std::size_t colon = port.rfind(':'); colon != std::string::npos) {
    found.address = port.substr(0, colon);
    port = port.substr(colon + 1);
  }
  constexpr std::size_t kGreatestPort = 65535;
  found.port = static_cast<std::uint16_t>(parse_count(port, "the port of --hand " + hand, 1, kGreatestPort));
  return found;
}

}  // namespace kiroku::apps

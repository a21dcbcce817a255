#include "apps/train/udp_hand.h"

#include "apps/sim/number_option.h"
#include "base/error.h"

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

std::optional<PluginAddress> plugin_address(const std::string& hand) {
  const std::string scheme = "plugin:";
  if (!hand.starts_with(scheme)) return std::nullopt;
  const std::string rest = hand.substr(scheme.size());
  const std::size_t colon = rest.find(':');
  PluginAddress found{rest.substr(0, colon), colon == std::string::npos ? "" : rest.substr(colon + 1)};
  if (found.library.empty()) throw UsageError("--hand " + hand + " names no plug-in: give plugin:PATH");
  return found;
}

}  // namespace kiroku::apps

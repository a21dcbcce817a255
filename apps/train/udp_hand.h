// A hand on the network or at a plug-in, as the option --hand names it.
#pragma once

#include <cstdint>
#include <filesystem>
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

struct PluginAddress {
  std::filesystem::path library;
  std::string argument;
};
/// "plugin:PATH" or "plugin:PATH:ARGUMENT", the path up to the first colon; nothing for what does not begin
/// with "plugin:". kiroku::UsageError where no path follows.
std::optional<PluginAddress> plugin_address(const std::string& hand);

}  // namespace kiroku::apps

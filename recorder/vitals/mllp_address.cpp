#include "recorder/vitals/mllp_address.h"

#include <charconv>

#include "base/error.h"

namespace kiroku::recorder {

MllpServer::Options mllp_server_options(const SourceAddress& address) {
  address.require_options("zone,idle,connections,of_address,allow,sender,locations,certificate,key,clients");
  MllpServer::Options options;
  const bool tls = address.location.starts_with("mllps://");
  std::string rest = address.location.substr(address.location.find("://") + 3);
  while (rest.ends_with('/')) {
    rest.pop_back();
  }
  const std::size_t colon = rest.rfind(':');
  if (colon != std::string::npos && rest.find(']', colon) == std::string::npos) {
    const std::string port = rest.substr(colon + 1);
    const auto [end, error] = std::from_chars(port.data(), port.data() + port.size(), options.port);
    if (error != std::errc() || end != port.data() + port.size()) {
      throw UsageError("source '" + address.stated + "': '" + port + "' is no port");
    }
    rest.resize(colon);
  }
  if (rest.starts_with('[') && rest.ends_with(']')) {
    rest = rest.substr(1, rest.size() - 2);
  }
  options.address = rest.empty() ? "0.0.0.0" : rest;
  options.idle_limit = std::chrono::seconds(integer_option(address, "idle", 3600, 1, 7 * 86'400));
  options.most_connections = static_cast<std::size_t>(integer_option(address, "connections", 64, 1, 1000));
  options.most_of_address = static_cast<std::size_t>(integer_option(address, "of_address", 16, 1, 1000));
  if (const std::string allow = address.option("allow", ""); allow == "any") {
    options.allow_anybody = true;
  } else if (address.options.contains("allow")) {
    options.allowed = AddressRange::parse_list(allow);
  }
  options.certificate = address.option("certificate", "");
  options.key = address.option("key", "");
  options.clients = address.option("clients", "");
  if (tls == options.certificate.empty()) {
    throw UsageError("source '" + address.stated +
                     "': TLS needs mllps:// and certificate=PEM; give both or neither");
  }
  if (!options.clients.empty() && !tls) {
    throw UsageError("source '" + address.stated +
                     "': clients=PEM asks for certificates, which need mllps:// and certificate=PEM");
  }
  return options;
}

SenderList mllp_senders(const SourceAddress& address) {
  const auto stated = address.options.find("sender");
  return stated == address.options.end() ? SenderList() : SenderList::parse(stated->second, address.stated);
}

PlaceList hl7_places(const SourceAddress& address) {
  const auto stated = address.options.find("locations");
  return stated == address.options.end() ? PlaceList() : PlaceList::parse(stated->second, address.stated);
}

}  // namespace kiroku::recorder

#include "base/listen_address.h"

#include <arpa/inet.h>
#include <charconv>
#include <netinet/in.h>

#include "base/error.h"

namespace kiroku {
namespace {

bool is_version_6(const std::string& host) { return host.find(':') != std::string::npos; }

bool is_address(const std::string& host) {
  in6_addr parsed{};
  return ::inet_pton(is_version_6(host) ? AF_INET6 : AF_INET, host.c_str(), &parsed) == 1;
}

}  // namespace

bool ListenAddress::is_loopback() const { return host == "::1" || host.starts_with("127."); }
bool ListenAddress::is_any() const { return host == "::" || host == "0.0.0.0"; }

std::string ListenAddress::to_string() const {
  return (is_version_6(host) ? "[" + host + "]" : host) + ":" + std::to_string(port);
}

ListenAddress parse_listen_address(const std::string& text, std::uint16_t example_port) {
  const std::size_t colon = text.rfind(':');
  ListenAddress out;
  out.host = text.substr(0, colon);
  if (out.host.size() > 2 && out.host.front() == '[' && out.host.back() == ']') {
    out.host = out.host.substr(1, out.host.size() - 2);
  }
  const char* const end = text.data() + text.size();
  const char* const digits = colon == std::string::npos ? end : text.data() + colon + 1;
  const auto [stop, failure] = std::from_chars(digits, end, out.port);
  if (!is_address(out.host) || failure != std::errc() || stop != end) {
    const std::string port = std::to_string(example_port);
    throw UsageError("'" + text + "' is no address to listen on: write it as 127.0.0.1:" + port +
                     " or [::1]:" + port);
  }
  return out;
}

}  // namespace kiroku

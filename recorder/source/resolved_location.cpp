#include "recorder/source/resolved_location.h"

#include <algorithm>
#include <array>
#include <memory>
#include <netdb.h>
#include <sys/socket.h>

namespace kiroku::recorder {

// RFC 3986 section 3.2: the authority lasts until the first '/', '?' or '#'; the last '@' in it ends the
// user. A password may itself hold '/', which libavformat takes as the authority's end, too.
HostPlace host_place(const std::string& location) {
  const std::size_t scheme = location.find("://");
  if (scheme == std::string::npos) return {};
  const std::size_t begin = scheme + 3;
  const std::size_t end = std::min(location.find_first_of("/?#", begin), location.size());
  const std::size_t at = location.rfind('@', end);
  const std::size_t host = at != std::string::npos && at >= begin && at < end ? at + 1 : begin;
  if (host < end && location[host] == '[') {
    const std::size_t close = std::min(location.find(']', host), end);
    return {host + 1, close - host - 1};
  }
  return {host, std::min(location.find(':', host), end) - host};
}

std::string host_and_port(const std::string& location) {
  const HostPlace place = host_place(location);
  const bool bracketed = place.begin > 0 && location[place.begin - 1] == '[';
  const std::size_t begin = place.begin - (bracketed ? 1 : 0);
  return location.substr(begin, std::min(location.find_first_of("/?#", begin), location.size()) - begin);
}

std::vector<std::string> resolved_locations(const std::string& location) {
  const HostPlace place = host_place(location);
  if (place.length == 0 || location[place.begin - 1] == '[') return {location};
  const std::string name = location.substr(place.begin, place.length);
  addrinfo wanted{};
  wanted.ai_socktype = SOCK_STREAM;
  addrinfo* found = nullptr;
  if (::getaddrinfo(name.c_str(), nullptr, &wanted, &found) != 0 || found == nullptr) return {location};
  const std::unique_ptr<addrinfo, decltype(&::freeaddrinfo)> owned(found, ::freeaddrinfo);
  std::vector<std::string> locations;
  for (const addrinfo* each = found; each != nullptr; each = each->ai_next) {
    std::array<char, NI_MAXHOST> number{};
    if (::getnameinfo(each->ai_addr, each->ai_addrlen, number.data(), number.size(), nullptr, 0,
                      NI_NUMERICHOST) != 0) {
      continue;
    }
    std::string host = number.data();
    if (each->ai_family == AF_INET6) host = "[" + host + "]";
    std::string resolved = std::string(location).replace(place.begin, place.length, host);
    if (std::find(locations.begin(), locations.end(), resolved) == locations.end())
      locations.push_back(std::move(resolved));
  }
  return locations.empty() ? std::vector{location} : locations;
}

}  // namespace kiroku::recorder

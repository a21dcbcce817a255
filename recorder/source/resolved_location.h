// A network address with its host's name looked up beforehand, for whoever may not look it up later. Pure but
// for the look-up; thread-safe.
#pragma once

#include <cstddef>
#include <string>
#include <vector>

namespace kiroku::recorder {

/// "rtsp://user:secret@camera.local:554/x" as "rtsp://user:secret@192.0.2.7:554/x", once for each address
/// that the host has, in the order in which they are to be tried. What has no name, or one that nobody knows,
/// comes back as it is, alone.
std::vector<std::string> resolved_locations(const std::string& location);

/// Where in the address its host stands, without brackets; empty where it has none.
struct HostPlace {
  std::size_t begin = 0, length = 0;
};
HostPlace host_place(const std::string& location);
/// "camera.local:554": what an HTTP server is to be told in "Host:" (RFC 9110 section 7.2).
std::string host_and_port(const std::string& location);

}  // namespace kiroku::recorder

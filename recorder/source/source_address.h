// Addresses of sources as people type them: "rtsp://user:secret@host/x", "film.mp4?speed=max&loop=1",
// "synthetic:room?size=640x480", "alsa:hw:1,0". Pure functions, thread-safe.
#pragma once

#include <map>
#include <string>
#include <string_view>

namespace kiroku::recorder {

/// kSound: an ALSA capture device, which stands beside pictures and is no source of its own.
enum class SourceKind { kSynthetic, kFile, kPipe, kDevice, kNetwork, kMonitors, kSound };

struct SourceAddress {
  SourceKind kind = SourceKind::kFile;
  std::string location;  // without our options: "/dev/video0", "film.mp4", "room" (synthetic), "hw:1,0"
                         // (ALSA), "mllp://0.0.0.0:2575"
  std::map<std::string, std::string> options;  // after '?', for synthetic sources, files and monitors; part
                                               // of the location for network addresses, but for "transport",
                                               // which the scheme names: "rtsp+udp://"
  /// For the ledger and for people. "***" stands for what may open a source on the network: whoever signs in
  /// there, values in the path, and options that are not known as harmless.
  std::string stated;

  [[nodiscard]] std::string option(const std::string& name, const std::string& otherwise) const;
  /// Whether it goes as fast as it can and states its own times (`?speed=max`).
  [[nodiscard]] bool unpaced() const { return option("speed", "") == "max"; }
  /// Throws kiroku::UsageError naming an option that is none of `known` (comma-separated), or a speed other
  /// than "max".
  void require_options(std::string_view known) const;
};

/// Whether a path must be there when its address is read. One that is not, and may be absent, is taken for a
/// device below /dev, for a file elsewhere; so is one that is not looked at, as looking may wait for a file
/// system that does not answer.
enum class Presence { kRequired, kMayBeAbsent, kNotLookedAt };
/// Throws kiroku::UsageError for an empty address, an unknown scheme, or a path that is required and not
/// there.
SourceAddress parse_source_address(const std::string& text, Presence presence = Presence::kRequired);

/// A whole number from an option, within [least, most]; throws kiroku::UsageError naming the option.
int integer_option(const SourceAddress& address, const std::string& name, int otherwise, int least, int most);

}  // namespace kiroku::recorder

#include "recorder/source/source_address.h"

#include <algorithm>
#include <array>
#include <charconv>
#include <filesystem>
#include <span>

#include "base/ascii.h"
#include "base/error.h"

namespace kiroku::recorder {
namespace {

constexpr std::array<std::string_view, 9> kNetworkSchemes{"rtsp", "rtsps", "srt",   "udp", "rtp",
                                                          "tcp",  "http",  "https", "rtmp"};

constexpr std::array<std::string_view, 3> kRtspTransports{"tcp", "udp", "multicast"};

/// Splits "a?x=1&y" into "a" and its options. The last question mark counts: a file may have one in its name.
void split_options(const std::string& text, SourceAddress& address) {
  const std::size_t question = text.rfind('?');
  address.location = text.substr(0, question);
  if (question == std::string::npos) return;
  std::string_view rest = std::string_view(text).substr(question + 1);
  while (!rest.empty()) {
    const std::size_t end = std::min(rest.find('&'), rest.size());
    const std::string_view item = rest.substr(0, end);
    const std::size_t equals = std::min(item.find('='), item.size());
    address.options[std::string(item.substr(0, equals))] =
        std::string(item.substr(std::min(equals + 1, item.size())));
    rest.remove_prefix(std::min(end + 1, rest.size()));
  }
}

/// What cameras, encoders and libav call what opens nothing.
constexpr std::array<std::string_view, 34> kHarmlessOptions{
    "audio",     "buffer_size", "camera",  "channel", "codec",   "compression",    "duration",
    "fifo_size", "format",      "fps",     "height",  "latency", "listen",         "localaddr",
    "localport", "mode",        "payload", "ping",    "port",    "profile",        "proto",
    "quality",   "rate",        "res",     "reuse",   "size",    "rtsp_transport", "resolution",
    "stream",    "subtype",     "timeout", "ttl",     "unicast", "width"};
/// Of files and of what the recorder makes itself: these options are its own, and some name a key.
constexpr std::array<std::string_view, 8> kSecretOptions{"passphrase", "password", "passwd", "pwd",
                                                         "streamid",   "key",      "token",  "auth"};

bool holds(std::span<const std::string_view> names, std::string_view name) {
  return std::ranges::find(names, lower_case(name)) != names.end();
}

/// "a=1&pw=2;3" without values, but for those of which `may_stay` is told the name.
template <typename MayStay>
std::string stated_options(std::string_view options, const MayStay& may_stay) {
  std::string stated;
  while (!options.empty()) {
    const std::size_t end = std::min(options.find_first_of("&;"), options.size());
    const std::string_view item = options.substr(0, end);
    const std::size_t equals = item.find('=');
    if (may_stay(item.substr(0, equals))) {
      stated += item;
    } else if (equals != std::string_view::npos) {
      stated.append(item.substr(0, equals)).append("=***");
    } else if (!item.empty()) {
      stated += "***";
    }
    if (end < options.size()) stated += options[end];
    options.remove_prefix(std::min(end + 1, options.size()));
  }
  return stated;
}

/// Of "rtsp://user:password@host/path?options": without whoever signs in, without the values that stand in
/// the path behind '=', and of the options only those that open nothing. A password may itself hold '@'
/// or '/': of what may be one too much is taken away.
std::string stated_address(std::string_view text, std::size_t scheme_end) {
  const std::size_t begin = scheme_end + 3;
  std::string stated(text.substr(0, begin));
  text.remove_prefix(begin);
  if (const std::size_t at = text.substr(0, text.find('?')).rfind('@'); at != std::string_view::npos) {
    const std::size_t colon = text.substr(0, at).find(':');
    // A name alone may be a token; with a password beside it, it is a name.
    stated.append(colon < at ? text.substr(0, colon + 1) : std::string_view()).append(at > 0 ? "***@" : "@");
    text.remove_prefix(at + 1);
  }
  const std::size_t question = std::min(text.find('?'), text.size());
  std::string_view path = text.substr(0, question);
  while (!path.empty()) {
    const std::size_t end = std::min(path.find('/', 1), path.size());
    const std::string_view part = path.substr(0, end);
    const std::size_t equals = part.find('=');
    stated.append(part.substr(0, equals)).append(equals == std::string_view::npos ? "" : "=***");
    path.remove_prefix(end);
  }
  if (question == text.size()) return stated;
  return stated + "?" + stated_options(text.substr(question + 1), [](std::string_view name) {
           return holds(kHarmlessOptions, name);
         });
}

/// What is written down and shown: nothing that opens the source to others.
std::string without_secrets(const std::string& text) {
  const std::size_t scheme = text.find("://");
  const bool is_own =
      scheme == std::string::npos || text.starts_with("mllp://") || text.starts_with("mllps://");
  if (!is_own) return stated_address(text, scheme);
  const std::size_t question = text.rfind('?');
  if (question == std::string::npos) return text;
  return text.substr(0, question + 1) +
         stated_options(std::string_view(text).substr(question + 1),
                        [](std::string_view name) { return !holds(kSecretOptions, name); });
}

}  // namespace

std::string SourceAddress::option(const std::string& name, const std::string& otherwise) const {
  const auto found = options.find(name);
  return found == options.end() ? otherwise : found->second;
}

void SourceAddress::require_options(std::string_view known) const {
  for (const auto& [name, value] : options) {
    if (("," + std::string(known) + ",").find("," + name + ",") == std::string::npos) {
      throw UsageError("source '" + stated + "' has no option '" + name + "'; it knows " +
                       std::string(known));
    }
    if (name == "speed" && value != "max")
      throw UsageError("source '" + stated + "': speed can only be 'max', or left out for its own pace");
  }
}

SourceAddress parse_source_address(const std::string& text, Presence presence) {
  if (text.empty())
    throw UsageError("a source is missing: give a device, a file, an address or synthetic:NAME");
  SourceAddress address;
  address.stated = without_secrets(text);
  constexpr std::string_view kSynthetic = "synthetic:";
  if (text.starts_with(kSynthetic)) {
    address.kind = SourceKind::kSynthetic;
    split_options(text.substr(kSynthetic.size()), address);
    return address;
  }
  constexpr std::string_view kAlsa = "alsa:";
  if (text.starts_with(kAlsa)) {
    address.kind = SourceKind::kSound;
    split_options(text.substr(kAlsa.size()), address);
    if (address.location.empty())
      throw UsageError("source 'alsa:' names no device; write alsa:hw:1,0 as 'kiroku devices' lists it");
    return address;
  }
  const std::size_t scheme_end = text.find("://");
  if (scheme_end != std::string::npos && scheme_end > 0) {
    std::string scheme = text.substr(0, scheme_end);
    if (scheme == "mllp" || scheme == "mllps") {
      address.kind = SourceKind::kMonitors;
      split_options(text, address);
      return address;
    }
    address.location = text;
    if (const std::size_t plus = scheme.find('+'); scheme.starts_with("rtsp") && plus != std::string::npos) {
      const std::string transport = scheme.substr(plus + 1);
      if (std::find(kRtspTransports.begin(), kRtspTransports.end(), transport) == kRtspTransports.end()) {
        throw UsageError("source '" + address.stated + "' asks for the unknown transport '" + transport +
                         "'; known are rtsp+tcp, rtsp+udp and rtsp+multicast");
      }
      address.options["transport"] = transport;
      address.location.erase(plus, scheme_end - plus);
      scheme.resize(plus);
    }
    if (std::find(kNetworkSchemes.begin(), kNetworkSchemes.end(), scheme) == kNetworkSchemes.end()) {
      throw UsageError("source '" + address.stated + "' has the unknown scheme '" + scheme +
                       "'; known are rtsp, srt, udp, rtp, tcp, http, rtmp, and mllp for vital signs");
    }
    address.kind = SourceKind::kNetwork;
    return address;
  }
  constexpr std::string_view kDevice = "v4l2:";
  const std::string path = text.starts_with(kDevice) ? text.substr(kDevice.size()) : text;
  std::error_code error;
  const bool looks = presence != Presence::kNotLookedAt;
  // A file may have a question mark in its own name.
  if (looks && std::filesystem::exists(path, error)) {
    address.location = path;
  } else {
    split_options(path, address);
  }
  const auto status =
      looks ? std::filesystem::status(address.location, error) : std::filesystem::file_status();
  if (!std::filesystem::exists(status)) {
    if (presence != Presence::kRequired) {
      address.kind = address.location.starts_with("/dev/") ? SourceKind::kDevice : SourceKind::kFile;
      return address;
    }
    throw UsageError("source '" + address.stated +
                     "' does not exist; check the path, or that the device is plugged in");
  }
  if (std::filesystem::is_directory(status))
    throw UsageError("source '" + address.stated + "' is a folder; give a file in it");
  address.kind = std::filesystem::is_fifo(status)             ? SourceKind::kPipe
                 : std::filesystem::is_character_file(status) ? SourceKind::kDevice
                                                              : SourceKind::kFile;
  return address;
}

int integer_option(const SourceAddress& address, const std::string& name, int otherwise, int least,
                   int most) {
  const auto found = address.options.find(name);
  if (found == address.options.end()) return otherwise;
  int value = 0;
  const char* end = found->second.data() + found->second.size();
  const auto result = std::from_chars(found->second.data(), end, value);
  if (result.ec != std::errc() || result.ptr != end || value < least || value > most) {
    throw UsageError("source '" + address.stated + "': " + name + " must be a whole number from " +
                     std::to_string(least) + " to " + std::to_string(most));
  }
  return value;
}

}  // namespace kiroku::recorder

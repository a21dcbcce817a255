#include "recorder/source/source_address.h"

#include <array>
#include <charconv>
#include <filesystem>
#include <regex>

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

/// Removes what opens the source to others: the password of "user:password@host", and telling query values.
/// Errs on the side of removing: a password may itself hold '@' or '/'.
std::string without_secrets(const std::string& text) {
  std::string stated = text;
  const std::size_t scheme = stated.find("://");
  if (scheme != std::string::npos) {
    const std::size_t begin = scheme + 3;
    const std::size_t query = std::min(stated.find('?', begin), stated.size());
    const std::size_t at = stated.rfind('@', query);
    const std::size_t colon = stated.find(':', begin);
    if (at != std::string::npos && at > begin && colon < at) stated.replace(colon + 1, at - colon - 1, "***");
  }
  static const std::regex kSecretOptions(
      "([?&](passphrase|password|passwd|pwd|streamid|key|token|auth)=)[^&]*", std::regex::icase);
  return std::regex_replace(stated, kSecretOptions, "$1***");
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

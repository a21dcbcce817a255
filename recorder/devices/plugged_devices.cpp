#include "recorder/devices/plugged_devices.h"

#include <algorithm>
#include <array>
#include <cerrno>
#include <charconv>
#include <fstream>
#include <grp.h>
#include <map>
#include <regex>
#include <string_view>
#include <sys/stat.h>
#include <system_error>
#include <unistd.h>
#include <utility>

#include "base/trimmed.h"

namespace kiroku::recorder {
namespace {

namespace fs = std::filesystem;

/// The names in a folder; none where it is not there.
std::vector<std::string> names_in(const fs::path& folder) {
  std::vector<std::string> names;
  std::error_code failed;
  for (fs::directory_iterator entry(folder, failed); !failed && entry != fs::directory_iterator();
       entry.increment(failed)) {
    names.push_back(entry->path().filename().string());
  }
  return names;
}

std::string without_blanks(std::string_view text) { return std::string(trimmed(text)); }

/// The first line of a small file; "" where it cannot be read.
std::string line_of(const fs::path& file) {
  std::ifstream input(file);
  std::string line;
  std::getline(input, line);
  return without_blanks(line);
}

/// The number at the end of "video12"; nothing for other names.
std::optional<unsigned> number_after(std::string_view prefix, std::string_view name) {
  if (!name.starts_with(prefix)) return {};
  const std::string_view digits = name.substr(prefix.size());
  unsigned number = 0;
  const auto read = std::from_chars(digits.data(), digits.data() + digits.size(), number);
  if (digits.empty() || read.ec != std::errc() || read.ptr != digits.data() + digits.size()) return {};
  return number;
}

/// Links in a folder of udev's, by the name of the node they lead to.
std::map<std::string, std::string> links_in(const fs::path& folder) {
  std::map<std::string, std::string> links;
  std::vector<std::string> names = names_in(folder);
  std::sort(names.begin(), names.end());
  for (const std::string& name : names) {
    std::error_code failed;
    const fs::path target = fs::read_symlink(folder / name, failed);
    if (!failed) links.try_emplace(target.filename().string(), (folder / name).string());
  }
  return links;
}

std::string link_of(const std::map<std::string, std::string>& links, const std::string& node) {
  const auto found = links.find(node);
  return found == links.end() ? "" : found->second;
}

/// "FTDI FT232R USB UART": what the USB device says that a node below it belongs to; "" where none does.
std::string usb_name(const fs::path& device) {
  std::error_code failed;
  fs::path at = fs::canonical(device, failed);
  constexpr int kFurthest = 6;  // port, interface, device, and hubs of drivers between them
  for (int i = 0; !failed && i < kFurthest && at.has_relative_path(); ++i, at = at.parent_path()) {
    const std::string product = line_of(at / "product");
    if (!product.empty()) return without_blanks(line_of(at / "manufacturer") + " " + product);
  }
  return "";
}

}  // namespace

std::vector<CameraNode> camera_nodes(const DeviceFolders& folders) {
  struct Listed {
    unsigned number = 0;
    std::string file, by_id, by_path, kind;
    CameraNode node;
  };
  const auto by_id = links_in(folders.dev / "v4l/by-id");
  const auto by_path = links_in(folders.dev / "v4l/by-path");
  const fs::path known = folders.sys / "class/video4linux";
  std::vector<Listed> all;
  for (const std::string& file : names_in(known)) {
    const auto number = number_after("video", file);
    if (!number) continue;
    Listed one{*number, file, link_of(by_id, file), link_of(by_path, file), "", {}};
    one.node.node = (folders.dev / file).string();
    one.node.name = line_of(known / file / "name");
    one.kind = one.node.name + "\n" + line_of(known / file / "index");
    all.push_back(std::move(one));
  }
  std::sort(all.begin(), all.end(),
            [](const Listed& one, const Listed& other) { return one.number < other.number; });
  std::vector<CameraNode> nodes;
  for (const Listed& one : all) {
    // Of another camera of the kind without a link of its own, this one's may be the next time.
    const bool shared = std::any_of(all.begin(), all.end(), [&](const Listed& other) {
      return other.kind == one.kind && other.by_id.empty();
    });
    nodes.push_back(one.node);
    nodes.back().lasting = shared ? one.by_path : one.by_id;
  }
  return nodes;
}

std::vector<SoundInput> sound_inputs(const DeviceFolders& folders) {
  struct Card {
    std::string id, name;
  };
  std::map<unsigned, Card> cards;
  {
    // " 1 [C920           ]: USB-Audio - HD Pro Webcam C920", then a line of where it is plugged in
    static const std::regex kCard(R"(\s*(\d{1,4}) \[(\S+)\s*\]: .*? - (.*))");
    std::ifstream input(folders.proc / "asound/cards");
    for (std::string line; std::getline(input, line);) {
      std::smatch parts;
      if (!std::regex_match(line, parts, kCard)) continue;
      cards[unsigned(std::stoul(parts[1]))] = {parts[2], without_blanks(parts[3].str())};
    }
  }
  // "01-00: USB Audio : USB Audio : capture 1"
  static const std::regex kDevice(R"((\d{1,4})-(\d{1,4}): (.*?) :.*: capture \d+.*)");
  std::vector<SoundInput> inputs;
  std::ifstream input(folders.proc / "asound/pcm");
  for (std::string line; std::getline(input, line);) {
    std::smatch parts;
    if (!std::regex_match(line, parts, kDevice)) continue;
    const auto card_number = unsigned(std::stoul(parts[1])), device_number = unsigned(std::stoul(parts[2]));
    const auto found = cards.find(card_number);
    const std::string numbers = std::to_string(card_number) + "D" + std::to_string(device_number);
    SoundInput one;
    one.node = (folders.dev / ("snd/pcmC" + numbers + "c")).string();
    const std::string id = found == cards.end() ? std::to_string(card_number) : found->second.id;
    one.device = "hw:CARD=" + id + ",DEV=" + std::to_string(device_number);
    const std::string device_name = without_blanks(parts[3].str());
    one.name = found == cards.end() ? device_name : found->second.name + ": " + device_name;
    inputs.push_back(std::move(one));
  }
  return inputs;
}

std::vector<SerialPort> serial_ports(const DeviceFolders& folders) {
  constexpr std::array<std::string_view, 4> kSerial{"ttyS", "ttyAMA", "ttyACM", "ttyUSB"};
  const auto by_id = links_in(folders.dev / "serial/by-id");
  const fs::path known = folders.sys / "class/tty";
  std::vector<std::pair<std::pair<std::size_t, unsigned>, SerialPort>> ports;
  for (const std::string& file : names_in(known)) {
    for (std::size_t kind = 0; kind < kSerial.size(); ++kind) {
      const auto number = number_after(kSerial.at(kind), file);
      if (!number || line_of(known / file / "type") == "0") continue;
      const fs::path device = known / file / "device";
      SerialPort port{(folders.dev / file).string(), link_of(by_id, file), usb_name(device)};
      if (port.name.empty()) {
        std::error_code failed;
        port.name = fs::read_symlink(device / "driver", failed).filename().string();
      }
      ports.push_back({{kind, *number}, std::move(port)});
    }
  }
  std::sort(ports.begin(), ports.end(),
            [](const auto& one, const auto& other) { return one.first < other.first; });
  std::vector<SerialPort> found;
  found.reserve(ports.size());
  for (auto& [place, port] : ports) found.push_back(std::move(port));
  return found;
}

std::optional<std::string> missing_group(const fs::path& device) {
  struct stat info {};
  if (::stat(device.c_str(), &info) != 0 || !S_ISCHR(info.st_mode) || (info.st_mode & S_IRGRP) == 0 ||
      ::access(device.c_str(), R_OK) == 0 || errno != EACCES) {
    return {};
  }
  const group* const found = ::getgrgid(info.st_gid);
  return found != nullptr ? found->gr_name : std::to_string(info.st_gid);
}

}  // namespace kiroku::recorder

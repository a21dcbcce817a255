// Files of recorded signals, made for tests as their formats' documents say.
#pragma once

#include <cstdint>
#include <cstring>
#include <string>
#include <vector>

namespace kiroku::test {

/// `text` in a field of EDF's header.
inline std::string edf_field(std::string text, std::size_t width) {
  text.resize(width, ' ');
  return text;
}

struct EdfSignal {
  std::string label, dimension, physical_minimum, physical_maximum, digital_minimum, digital_maximum;
  std::size_t values = 0;  // in a record
};

/// A header of an EDF file that promises `records` of `duration` seconds.
inline std::string edf_header(const std::vector<EdfSignal>& signals, const std::string& records,
                              const std::string& duration, const std::string& reserved = "") {
  std::string header = edf_field("0", 8) + edf_field("X X X X", 80) + edf_field("Startdate 01-JAN-2026", 80) +
                       "01.01.26" + "12.00.00" + edf_field(std::to_string(256 * (signals.size() + 1)), 8) +
                       edf_field(reserved, 44) + edf_field(records, 8) + edf_field(duration, 8) +
                       edf_field(std::to_string(signals.size()), 4);
  const auto add = [&](std::size_t width, auto text) {
    for (const EdfSignal& signal : signals) header += edf_field(text(signal), width);
  };
  add(16, [](const EdfSignal& signal) { return signal.label; });
  add(80, [](const EdfSignal&) { return ""; });
  add(8, [](const EdfSignal& signal) { return signal.dimension; });
  add(8, [](const EdfSignal& signal) { return signal.physical_minimum; });
  add(8, [](const EdfSignal& signal) { return signal.physical_maximum; });
  add(8, [](const EdfSignal& signal) { return signal.digital_minimum; });
  add(8, [](const EdfSignal& signal) { return signal.digital_maximum; });
  add(80, [](const EdfSignal&) { return ""; });
  add(8, [](const EdfSignal& signal) { return std::to_string(signal.values); });
  add(32, [](const EdfSignal&) { return ""; });
  return header;
}

/// Numbers as they stand in EDF and in WFDB's format 16.
inline std::string little_endian_16(const std::vector<int>& numbers) {
  std::string bytes;
  for (const int number : numbers) {
    bytes += static_cast<char>(number & 0xFF);
    bytes += static_cast<char>((number >> 8) & 0xFF);
  }
  return bytes;
}

/// WFDB's format 212: two numbers of 12 bits in three bytes.
inline std::string packed_212(const std::vector<int>& numbers) {
  std::string bytes;
  for (std::size_t i = 0; i < numbers.size(); i += 2) {
    const int first = numbers[i], second = i + 1 < numbers.size() ? numbers[i + 1] : 0;
    bytes += static_cast<char>(first & 0xFF);
    bytes += static_cast<char>(((first >> 8) & 0x0F) | ((second >> 4) & 0xF0));
    bytes += static_cast<char>(second & 0xFF);
  }
  return bytes;
}

/// Packets of a .vital file, not compressed.
class VitalPackets {
 public:
  VitalPackets() {
    bytes_ = "VITA";
    add<std::uint32_t>(3);
    add<std::uint16_t>(10);
    bytes_.append(10, '\0');
  }
  template <typename Number>
  static std::string raw(Number number) {
    std::string bytes(sizeof number, '\0');
    std::memcpy(bytes.data(), &number, sizeof number);
    return bytes;
  }
  static std::string text(const std::string& words) {
    return raw(static_cast<std::uint32_t>(words.size())) + words;
  }
  void packet(std::uint8_t type, const std::string& content) {
    add(type);
    add(static_cast<std::uint32_t>(content.size()));
    bytes_ += content;
  }
  void device(std::uint32_t id, const std::string& name) {
    packet(9, raw(id) + text(name) + text(name) + text(""));
  }
  /// kind: 1 wave, 2 number, 5 text; format: 1 float, 5 short.
  void track(std::uint16_t id, std::uint8_t kind, std::uint8_t format, const std::string& name,
             const std::string& unit, float rate_hz, double gain, double offset, std::uint8_t parameter,
             std::uint32_t device) {
    packet(0, raw(id) + raw(kind) + raw(format) + text(name) + text(unit) + raw(0.F) + raw(0.F) +
                  raw(std::uint32_t{0}) + raw(rate_hz) + raw(gain) + raw(offset) + raw(parameter) +
                  raw(device));
  }
  void record(double time_s, std::uint16_t track, const std::string& content) {
    packet(1, raw(std::uint16_t{10}) + raw(time_s) + raw(track) + content);
  }
  [[nodiscard]] const std::string& bytes() const { return bytes_; }

 private:
  template <typename Number>
  void add(Number number) {
    bytes_ += raw(number);
  }
  std::string bytes_;
};

}  // namespace kiroku::test

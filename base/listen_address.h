// Where a server listens, as people write it: "127.0.0.1:8443", "[::1]:8443". Pure functions, thread-safe.
#pragma once

#include <cstdint>
#include <string>

namespace kiroku {

struct ListenAddress {
  std::string host;  // an address, without brackets: "127.0.0.1", "::1"
  std::uint16_t port = 0;

  /// Whether it is reached from this machine alone.
  [[nodiscard]] bool is_loopback() const;
  /// Whether it stands for every address of this machine.
  [[nodiscard]] bool is_any() const;
  /// "127.0.0.1:8443", "[::1]:8443".
  [[nodiscard]] std::string to_string() const;
};

/// Throws kiroku::UsageError for what is no numeric address and port; `example_port` stands in the sentence.
ListenAddress parse_listen_address(const std::string& text, std::uint16_t example_port);

}  // namespace kiroku

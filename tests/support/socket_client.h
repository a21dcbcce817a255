// A WebSocket over TLS to a server on this machine, as a browser has one. Not thread-safe.
#pragma once

#include <chrono>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <utility>

#include "base/bytes.h"

namespace kiroku::test {

class SocketClient {
 public:
  struct Message {
    bool is_text = false;
    Bytes bytes;
    std::chrono::system_clock::time_point arrived;
  };
  /// Throws boost::system::system_error where it is refused. The certificate is not looked at.
  SocketClient(std::uint16_t port, const std::string& target, const std::string& cookie,
               const std::string& origin);
  ~SocketClient();
  SocketClient(const SocketClient&) = delete;
  SocketClient& operator=(const SocketClient&) = delete;

  /// Waits for the next; nothing once the connection is over, or after `limit`, which ends it.
  std::optional<Message> receive(std::chrono::seconds limit = std::chrono::seconds(20));
  /// Throw boost::system::system_error once the connection is over.
  void send_text(const std::string& text);
  void send_bytes(const Bytes& bytes);
  /// Says farewell as a browser does and waits for the answer.
  void close();
  /// What the server said when it closed the connection: 0 and "" where it said nothing.
  [[nodiscard]] std::pair<int, std::string> farewell() const;

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace kiroku::test

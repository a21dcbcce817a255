// An HTTP server that answers whatever it is told, for clients that must cope with it.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <string>

namespace kiroku::test {

/// Listens on 127.0.0.1 from construction to destruction, on its own thread. Each connection's request is
/// read to the end of its header; then `answer` is sent as it is and the connection closed. An empty answer
/// is never sent: the client waits.
class ScriptedServer {
 public:
  explicit ScriptedServer(std::string answer);
  ~ScriptedServer();
  [[nodiscard]] std::uint16_t port() const;
  [[nodiscard]] std::string url() const;
  /// Header of the newest request.
  [[nodiscard]] std::string last_request() const;
  [[nodiscard]] std::size_t requests() const;
  /// From the next request on.
  void answer_with(std::string answer);
  /// The same for requests of a part (Range, RFC 9110 section 14.2); without it these are answered as others
  /// are.
  void answer_ranges_with(std::string answer);

 private:
  struct State;
  std::unique_ptr<State> state_;
};

/// A whole HTTP response.
std::string http_answer(const std::string& status, const std::string& content_type, const std::string& body);

}  // namespace kiroku::test

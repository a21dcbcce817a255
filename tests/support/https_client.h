// One TLS connection to a server on this machine, byte by byte: what a browser does, and what an attacker
// may. Not thread-safe.
#pragma once

#include <chrono>
#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <string>

namespace kiroku::test {

struct HttpResponse {
  int status = 0;                              // 0: the connection ended before an answer
  std::map<std::string, std::string> headers;  // names in lower case
  std::string body;
};

class HttpsConnection {
 public:
  /// Connects from `source` (any address of 127.0.0.0/8) and completes the handshake; throws
  /// std::runtime_error if that fails. The certificate is not looked at.
  explicit HttpsConnection(std::uint16_t port, const std::string& source = "127.0.0.1");
  ~HttpsConnection();
  HttpsConnection(HttpsConnection&&) noexcept;

  /// False once the server has closed.
  bool send(const std::string& bytes);
  /// Reads one answer; a body by its length or its chunks.
  HttpResponse receive(bool has_body = true);
  /// Whether the server closes within the time.
  bool is_closed_within(std::chrono::milliseconds limit);

 private:
  struct State;
  std::unique_ptr<State> state_;
};

/// A request with the usual fields; `headers` replace them, and an empty value leaves one out.
std::string http_request(const std::string& method, const std::string& target,
                         const std::map<std::string, std::string>& headers = {},
                         const std::string& body = "");

/// A connection, a request, its answer.
HttpResponse ask_once(std::uint16_t port, const std::string& request,
                      const std::string& source = "127.0.0.1");

}  // namespace kiroku::test

// A small HTTP/1.1 server (RFC 9112) for programs of the same host or of the hospital's network that ask
// little and seldom, in the clear or over TLS. What it answers is its owner's.
#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>

#include "base/connection_places.h"
#include "base/listen_address.h"
#include "crypto/secret.h"
#include "http/message.h"

namespace kiroku::http {

/// Over TLS 1.2 or 1.3, with clients that may show a certificate.
struct ServerTls {
  std::string certificate_pem;  // the server's, then those up to its authority
  crypto::Secret key_pem;
  std::string client_authority_pem;  // whose certificates of clients count
};

struct ServerOptions {
  ListenAddress listen;  // port 0: any free one
  /// Answers a whole request; called by as many threads at once as there are. What it throws becomes a
  /// refusal with status 500.
  std::function<Response(const Request&)> answer;
  /// The answer to what is refused: a head that is too large (431) or could hide another request (400), a
  /// body that is too large (413), what is not HTTP (400). The connection is closed behind it.
  std::function<Response(const Refusal&)> refuse;
  std::size_t threads = 1;
  std::size_t most_head_bytes = 8U << 10, most_body_bytes = 64U << 10;
  /// For a request to arrive, and for an answer to leave, each; after it a connection that says nothing is
  /// closed, too.
  std::chrono::milliseconds patience{30'000};
  /// Where there are too many, the idlest makes room (base/connection_places.h).
  ConnectionPlaces::Limits connections{.all = 64, .of_holder = 32};
  std::optional<ServerTls> tls = {};  // none: in the clear
};

/// Listens from construction to destruction on threads of its own.
class Server {
 public:
  /// Throws kiroku::Error if it cannot listen there, kiroku::UsageError for TLS that cannot be used.
  explicit Server(ServerOptions options);
  /// Waits for answers being made; connections are cut.
  ~Server();
  Server(const Server&) = delete;
  Server& operator=(const Server&) = delete;
  [[nodiscard]] std::uint16_t port() const;

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace kiroku::http

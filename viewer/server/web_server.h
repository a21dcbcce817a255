// HTTP/1.1 over TLS (RFC 9112, RFC 8446): connections, their limits, and nothing of what is asked over them.
#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <string>

#include "crypto/secret.h"
#include "viewer/server/costly_work.h"
#include "viewer/server/dispatcher.h"
#include "viewer/server/inner_door.h"

namespace kiroku::viewer {

struct WebServerLimits {
  /// Counted when they are accepted, before TLS, by address (of IPv6 by /64). Where there are too many, the
  /// idlest makes room: first of those that said nothing yet, then of those without a session. One place in
  /// eight is for these; where people who have signed in hold more, whoever has the most gives one up
  /// (base/connection_places.h).
  std::size_t connections = 1000;
  std::size_t connections_of_address = 200;
  /// So many of a user who has signed in, or of a guest, never make room.
  std::size_t kept_connections_of_person = 8;
  /// Being made at a time of one person, so that nobody holds every worker; further ones wait for these.
  std::size_t answers_of_person = 4;
  /// The same of answers that are quick (Route::is_quick).
  std::size_t quick_answers_of_person = 4;
  std::uint32_t header_bytes = 16U << 10;
  std::chrono::milliseconds handshake{10'000};
  /// From the first byte one waits for to the end of the header, also on a connection kept open.
  std::chrono::milliseconds header{20'000};
  std::chrono::milliseconds body{30'000};
  /// For each 256 KiB of an answer to be taken.
  std::chrono::milliseconds write{30'000};
  /// What a download must be taken by a second, on average, once its sending has waited so long: a file that
  /// was made for it takes room on the disk until then.
  std::size_t least_download_pace = 64U << 10;
  std::chrono::milliseconds pace_counts_after{60'000};
  /// Of what costs much; what is too much is refused at once (429).
  CostlyWork::Limits costly = {};
};

struct WebServerOptions {
  /// "address:port", "[::1]:8443"; port 0: any free one; "": no address of its own, but that of the door.
  std::string listen = "127.0.0.1:8443";
  std::string certificate_pem;  // the server's, then those up to its authority
  crypto::Secret key_pem;
  WebServerLimits limits;
  /// Through which the viewer of the same home sends requests, too; null: through none.
  std::unique_ptr<InnerDoor> inner_door = nullptr;
};

/// Listens from construction to destruction on threads of its own; answers are made on others, since they may
/// block. TLS 1.2 and 1.3 only.
class WebServer {
 public:
  /// `dispatcher` must outlive it. Throws kiroku::UsageError for an address, certificate or key that cannot
  /// be used, kiroku::Error if it cannot listen there.
  /// `of_inner_door`, which must outlive it too, answers what comes through the inner door.
  WebServer(WebServerOptions options, const Dispatcher& dispatcher,
            const Dispatcher* of_inner_door = nullptr);
  /// Waits for answers being made; connections are cut.
  ~WebServer();
  WebServer(const WebServer&) = delete;
  WebServer& operator=(const WebServer&) = delete;
  [[nodiscard]] std::uint16_t port() const;
  [[nodiscard]] std::string url() const;  // "https://127.0.0.1:8443/"; "" without an address

 private:
  struct State;
  std::unique_ptr<State> state_;
};

/// Whether "address:port" is reached from this machine alone. Throws kiroku::UsageError for what is no
/// address.
bool is_loopback(const std::string& listen);

}  // namespace kiroku::viewer

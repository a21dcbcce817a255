// HTTP front of the embedded authority (POST application/timestamp-query), for stock clients.
#pragma once

#include <chrono>
#include <cstdint>
#include <memory>
#include <string>

#include "timestamp/authority.h"

namespace kiroku::timestamp {

/// Listens from construction to destruction on its own thread. `authority` must outlive it.
class AuthorityServer {
 public:
  /// `listen` is "address:port" ("[::1]:port"); port 0 takes a free one. A query must arrive, and its
  /// response leave, within `time_limit` each; after it an idle connection is closed, too. Up to 64
  /// connections at a time, 16 of one address (of IPv6: one /64); the idlest makes room for one more. Throws
  /// kiroku::Error if it cannot listen there.
  AuthorityServer(Authority& authority, const std::string& listen,
                  std::chrono::milliseconds time_limit = std::chrono::seconds(10));
  ~AuthorityServer();
  [[nodiscard]] std::uint16_t port() const;
  [[nodiscard]] std::string url() const;  // "http://127.0.0.1:3161/"

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace kiroku::timestamp

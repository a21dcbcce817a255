// A small HTTP server for machines on the same host: Prometheus' /metrics, and a hook by which another
// program (a room control, a button) starts and stops cases.
//
//   GET  /metrics                                    text/plain; version=0.0.4
//   GET  /healthz                                    200 "ok"; 503 where a room's thread hangs
//   POST /rooms/<room>/start | stop | mark           with "Authorization: Bearer <token>"; the body of mark
//                                                    is the text. stop and mark take ?case=<case>, and do
//                                                    nothing where another one runs.
//                                                    Answers 200 and JSON, or 4xx and {"error": …}.
//
// Whoever gives wrong tokens waits ever longer (429). Ten tokens a second are looked at meanwhile, so that a
// few guesses do not shut the hook to the program that uses it at the same address.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <string>

#include <nlohmann/json_fwd.hpp>

#include "base/attempt_guard.h"

namespace kiroku::recorder {

struct HttpServerOptions {
  std::string address = "127.0.0.1";
  std::uint16_t port = 0;  // 0: any free one
  std::string token;       // empty: there is no hook
  std::function<std::string()> metrics;
  std::function<bool()> healthy = {};  // null: always
  /// (room, "start" | "stop" | "mark", body, the case that is meant or ""); what it throws becomes status
  /// 409.
  std::function<nlohmann::ordered_json(const std::string&, const std::string&, const std::string&,
                                       const std::string&)>
      hook;
  /// Hears of wrong tokens, ever more rarely; may be empty.
  std::function<void(const std::string& sentence)> tell = {};
  AttemptLimits attempts = {};
  std::function<AttemptGuard::Clock::time_point()> now = AttemptGuard::Clock::now;
};

class HttpServer {
 public:
  /// Throws kiroku::Error where the address cannot be listened on.
  explicit HttpServer(HttpServerOptions options);
  ~HttpServer();
  HttpServer(const HttpServer&) = delete;
  HttpServer& operator=(const HttpServer&) = delete;
  [[nodiscard]] std::uint16_t port() const;

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace kiroku::recorder

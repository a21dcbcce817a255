#include "recorder/daemon/http_server.h"

#include <chrono>
#include <mutex>
#include <optional>
#include <string_view>
#include <utility>

#include <nlohmann/json.hpp>

#include "archive/format/case_layout.h"
#include "base/tally.h"
#include "crypto/hash.h"
#include "crypto/secret.h"
#include "http/server.h"

namespace kiroku::recorder {
namespace {

using http::Request;
using http::Response;

constexpr std::size_t kThreads = 4;
/// Of tokens that are looked at in a second while their address has to wait.
constexpr int kMostLooks = 10;

Response respond(int status, const std::string& type, std::string body) {
  return {status,
          {{"Content-Type", type}, {"Cache-Control", "no-store"}, {"X-Content-Type-Options", "nosniff"}},
          std::move(body)};
}

Response respond_json(int status, const nlohmann::ordered_json& body) {
  // A room's name in it is whatever the caller wrote.
  const std::string text = body.dump(-1, ' ', false, nlohmann::ordered_json::error_handler_t::replace);
  return respond(status, "application/json", text + "\n");
}

Response refuse(int status, const std::string& sentence) {
  return respond_json(status, {{"error", sentence}});
}

/// Takes as long for a wrong token as for the right one, and tells nothing of its length.
bool same_secret(std::string_view a, std::string_view b) {
  return crypto::equal_constant_time(crypto::sha256(bytes_of(a)), crypto::sha256(bytes_of(b)));
}

}  // namespace

struct HttpServer::State {
  explicit State(HttpServerOptions asked) : options(std::move(asked)), server(server_options()) {}

  http::ServerOptions server_options() {
    http::ServerOptions of_server;
    of_server.listen = {options.address, options.port};
    of_server.answer = [this](const Request& request) { return answer(request); };
    of_server.refuse = [](const http::Refusal& refusal) { return refuse(refusal.status, refusal.why); };
    of_server.threads = kThreads;
    return of_server;
  }

  /// Why whoever asks is refused, or nothing where the right token came. While an address has to wait, a few
  /// tokens a second are looked at all the same: nobody who guesses a little keeps out a neighbour who has
  /// the right one, and whoever guesses a lot learns no more for it.
  std::optional<Response> refuse_without_token(const Request& request) {
    const std::string& holder = request.holder;
    const auto now = options.now();
    const auto wait = attempts.wait(holder, now);
    const bool must_wait = wait.count() > 0;
    if ((!must_wait || may_look(now)) &&
        same_secret(request.field("Authorization"), "Bearer " + options.token))
      return std::nullopt;
    if (must_wait) {
      Response response =
          refuse(429, "too many wrong tokens: try again in " + std::to_string(wait.count()) + " s");
      response.fields.emplace_back("Retry-After", std::to_string(wait.count()));
      return response;
    }
    attempts.failed(holder, now);
    if (const auto count = wrong_tokens.add(holder); count && options.tell) {
      options.tell("a wrong token for the hook came from " + holder + ", " + std::to_string(*count) +
                   " so far");
    }
    return refuse(401, "a valid token is needed: Authorization: Bearer TOKEN");
  }

  bool may_look(AttemptGuard::Clock::time_point now) {
    const std::lock_guard guard(mutex);
    if (now - looks_since >= std::chrono::seconds(1)) {
      looks_since = now;
      looks = 0;
    }
    return looks++ < kMostLooks;
  }

  [[nodiscard]] Response answer(const Request& request) {
    const std::string& target = request.target;
    if (request.method == "GET" && target == "/metrics") {
      return respond(200, "text/plain; version=0.0.4; charset=utf-8", options.metrics());
    }
    if (request.method == "GET" && target == "/healthz") {
      const bool healthy = !options.healthy || options.healthy();
      return healthy ? respond(200, "text/plain", "ok\n") : respond(503, "text/plain", "a room hangs\n");
    }
    constexpr std::string_view kRooms = "/rooms/";
    if (!target.starts_with(kRooms) || options.token.empty()) {
      return refuse(404, "there is nothing at this address");
    }
    if (request.method != "POST") return refuse(405, "use POST here");
    if (auto refused = refuse_without_token(request)) return std::move(*refused);
    const std::size_t query = target.find('?');
    std::string meant;
    if (query != std::string::npos) {
      constexpr std::string_view kCase = "?case=";
      meant = target.substr(query);
      if (!meant.starts_with(kCase) || !archive::is_case_id(meant.substr(kCase.size())))
        return refuse(400, "after the ? comes case= and the name of a case, and nothing else");
      meant.erase(0, kCase.size());
    }
    const std::string rest = target.substr(kRooms.size(), query - kRooms.size());
    const std::size_t slash = rest.find('/');
    const std::string action = slash == std::string::npos ? "" : rest.substr(slash + 1);
    if (action != "start" && action != "stop" && action != "mark") {
      return refuse(404, "a room can be told to start, stop or mark");
    }
    try {
      return respond_json(200, options.hook(rest.substr(0, slash), action, request.body, meant));
    } catch (const std::exception& error) {
      return refuse(409, error.what());
    }
  }

  const HttpServerOptions options;
  AttemptGuard attempts{options.attempts};
  Tally wrong_tokens;
  std::mutex mutex;
  AttemptGuard::Clock::time_point looks_since{};
  int looks = 0;        // since then
  http::Server server;  // last: asks the rest
};

HttpServer::HttpServer(HttpServerOptions options) : state_(std::make_unique<State>(std::move(options))) {}
HttpServer::~HttpServer() = default;
std::uint16_t HttpServer::port() const { return state_->server.port(); }

}  // namespace kiroku::recorder

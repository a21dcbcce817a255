#include "recorder/daemon/http_server.h"

#include <chrono>
#include <thread>
#include <utility>  // Boost 1.74 forgets it before its awaitable
#include <vector>

#include <boost/asio.hpp>
#include <boost/beast/core.hpp>
#include <boost/beast/http.hpp>
#include <nlohmann/json.hpp>
#include <openssl/crypto.h>

#include "base/error.h"

namespace kiroku::recorder {
namespace {

namespace asio = boost::asio;
namespace beast = boost::beast;
namespace http = beast::http;
using asio::ip::tcp;
using Request = http::request<http::string_body>;
using Response = http::response<http::string_body>;

constexpr std::size_t kThreads = 4;
constexpr std::size_t kLongestBody = 64U << 10;
constexpr std::chrono::seconds kPatience{30};

Response respond(const Request& request, http::status status, const std::string& type, std::string body) {
  Response response(status, request.version());
  response.set(http::field::content_type, type);
  response.set(http::field::cache_control, "no-store");
  response.set("X-Content-Type-Options", "nosniff");
  response.keep_alive(request.keep_alive());
  response.body() = std::move(body);
  response.prepare_payload();
  return response;
}

Response respond_json(const Request& request, http::status status, const nlohmann::ordered_json& body) {
  return respond(request, status, "application/json", body.dump() + "\n");
}

Response refuse(const Request& request, http::status status, const std::string& sentence) {
  return respond_json(request, status, {{"error", sentence}});
}

/// Takes as long for a wrong token as for the right one.
bool same_secret(std::string_view a, std::string_view b) {
  return a.size() == b.size() && CRYPTO_memcmp(a.data(), b.data(), a.size()) == 0;
}

}  // namespace

struct HttpServer::State {
  explicit State(HttpServerOptions asked) : options(std::move(asked)), acceptor(context) {
    try {
      const tcp::endpoint endpoint(asio::ip::make_address(options.address), options.port);
      acceptor.open(endpoint.protocol());
      acceptor.set_option(asio::socket_base::reuse_address(true));
      acceptor.bind(endpoint);
      acceptor.listen();
    } catch (const boost::system::system_error& error) {
      throw Error("cannot listen on " + options.address + ":" + std::to_string(options.port) + ": " +
                  error.code().message());
    }
    asio::co_spawn(context, accept(), asio::detached);
    for (std::size_t i = 0; i < kThreads; ++i) {
      threads.emplace_back([this] { context.run(); });
    }
  }
  ~State() {
    context.stop();
    for (std::thread& thread : threads) thread.join();
  }
  State(const State&) = delete;
  State& operator=(const State&) = delete;

  asio::awaitable<void> accept() {
    for (;;) {
      boost::system::error_code failed;
      tcp::socket peer = co_await acceptor.async_accept(asio::redirect_error(asio::use_awaitable, failed));
      if (!failed) {
        asio::co_spawn(asio::make_strand(context), serve(beast::tcp_stream(std::move(peer))), asio::detached);
        continue;
      }
      asio::steady_timer pause(context, std::chrono::milliseconds(100));
      co_await pause.async_wait(asio::redirect_error(asio::use_awaitable, failed));
    }
  }

  asio::awaitable<void> serve(beast::tcp_stream peer) {
    beast::flat_buffer buffer;
    for (;;) {
      boost::system::error_code failed;
      http::request_parser<http::string_body> parser;
      parser.body_limit(kLongestBody);
      peer.expires_after(kPatience);
      co_await http::async_read(peer, buffer, parser, asio::redirect_error(asio::use_awaitable, failed));
      if (failed) co_return;
      Response response = answer(parser.get());
      peer.expires_after(kPatience);
      co_await http::async_write(peer, response, asio::redirect_error(asio::use_awaitable, failed));
      if (failed || !response.keep_alive()) co_return;
    }
  }

  [[nodiscard]] Response answer(const Request& request) const {
    const std::string target(request.target());
    if (request.method() == http::verb::get && target == "/metrics") {
      return respond(request, http::status::ok, "text/plain; version=0.0.4; charset=utf-8",
                     options.metrics());
    }
    if (request.method() == http::verb::get && target == "/healthz") {
      return respond(request, http::status::ok, "text/plain", "ok\n");
    }
    constexpr std::string_view kRooms = "/rooms/";
    if (!target.starts_with(kRooms) || options.token.empty()) {
      return refuse(request, http::status::not_found, "there is nothing at this address");
    }
    if (request.method() != http::verb::post) {
      return refuse(request, http::status::method_not_allowed, "use POST here");
    }
    const auto authorization = request[http::field::authorization];
    if (!same_secret({authorization.data(), authorization.size()}, "Bearer " + options.token)) {
      return refuse(request, http::status::unauthorized,
                    "a valid token is needed: Authorization: Bearer TOKEN");
    }
    const std::string rest = target.substr(kRooms.size());
    const std::size_t slash = rest.find('/');
    const std::string action = slash == std::string::npos ? "" : rest.substr(slash + 1);
    if (action != "start" && action != "stop" && action != "mark") {
      return refuse(request, http::status::not_found, "a room can be told to start, stop or mark");
    }
    try {
      return respond_json(request, http::status::ok,
                          options.hook(rest.substr(0, slash), action, request.body()));
    } catch (const std::exception& error) {
      return refuse(request, http::status::conflict, error.what());
    }
  }

  const HttpServerOptions options;
  asio::io_context context;
  tcp::acceptor acceptor;
  std::vector<std::thread> threads;
};

HttpServer::HttpServer(HttpServerOptions options) : state_(std::make_unique<State>(std::move(options))) {}
HttpServer::~HttpServer() = default;
std::uint16_t HttpServer::port() const { return state_->acceptor.local_endpoint().port(); }

}  // namespace kiroku::recorder

#include "recorder/daemon/http_server.h"

#include <algorithm>
#include <chrono>
#include <mutex>
#include <optional>
#include <set>
#include <thread>
#include <utility>  // Boost 1.74 forgets it before its awaitable
#include <vector>

#include <boost/asio.hpp>
#include <boost/beast/core.hpp>
#include <boost/beast/http.hpp>
#include <nlohmann/json.hpp>

#include "base/connection_places.h"
#include "base/error.h"
#include "base/http_chunks.h"
#include "base/http_head.h"
#include "base/network_address.h"
#include "base/tally.h"
#include "crypto/hash.h"
#include "crypto/secret.h"

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
constexpr std::size_t kLongestHead = 8U << 10;
constexpr std::size_t kReadUnit = 4U << 10;
constexpr std::chrono::seconds kPatience{30};
constexpr ConnectionPlaces::Limits kConnections{.all = 64, .of_holder = 32};
/// Addresses from which the right token came.
constexpr std::size_t kMostKnown = 256;

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
  // A room's name in it is whatever the caller wrote.
  const std::string text = body.dump(-1, ' ', false, nlohmann::ordered_json::error_handler_t::replace);
  return respond(request, status, "application/json", text + "\n");
}

Response refuse(const Request& request, http::status status, const std::string& sentence) {
  return respond_json(request, status, {{"error", sentence}});
}

/// Takes as long for a wrong token as for the right one, and tells nothing of its length.
bool same_secret(std::string_view a, std::string_view b) {
  return crypto::equal_constant_time(crypto::sha256(bytes_of(a)), crypto::sha256(bytes_of(b)));
}

/// To bytes that are no request.
Response refuse_unread(http::status status, const std::string& sentence) {
  Response response = refuse({}, status, sentence);
  response.version(11);
  response.keep_alive(false);
  return response;
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
      tcp::socket peer = co_await acceptor.async_accept(asio::make_strand(context),
                                                        asio::redirect_error(asio::use_awaitable, failed));
      if (!failed) {
        welcome(std::move(peer));
        continue;
      }
      asio::steady_timer pause(context, std::chrono::milliseconds(100));
      co_await pause.async_wait(asio::redirect_error(asio::use_awaitable, failed));
    }
  }

  /// Serves it if there is a place for it; else it is let go, and may come again.
  void welcome(tcp::socket socket) {
    boost::system::error_code failed;
    const auto peer = socket.remote_endpoint(failed);
    if (failed) return;
    const std::string holder = address_holder(peer.address().to_string());
    const auto stream = std::make_shared<beast::tcp_stream>(std::move(socket));
    auto place = places.enter(holder, [leaving = std::weak_ptr<beast::tcp_stream>(stream)] {
      if (const auto open = leaving.lock()) asio::post(open->get_executor(), [open] { open->close(); });
    });
    if (place) {
      asio::co_spawn(stream->get_executor(), serve(stream, holder, std::move(place)), asio::detached);
    }
  }

  asio::awaitable<void> serve(std::shared_ptr<beast::tcp_stream> stream, std::string holder,
                              std::unique_ptr<ConnectionPlaces::Place> place) {
    beast::tcp_stream& peer = *stream;
    beast::flat_buffer buffer;
    for (bool stays = true; stays;) {
      boost::system::error_code failed;
      http::request_parser<http::string_body> parser;
      RefuseChunkExtensions extensions;
      parser.on_chunk_header(extensions);
      parser.body_limit(kLongestBody);
      parser.header_limit(kLongestHead);
      peer.expires_after(kPatience);
      std::optional<Response> response = co_await read_head(peer, buffer, failed);
      if (failed) co_return;
      if (!response) {
        co_await http::async_read(peer, buffer, parser, asio::redirect_error(asio::use_awaitable, failed));
        if (failed == http::error::body_limit) {
          response = refuse_unread(http::status::payload_too_large, "the body is too large");
        } else if (failed && failed.category() != make_error_code(http::error::bad_method).category()) {
          co_return;
        } else if (failed) {
          response = refuse_unread(http::status::bad_request, "this is not HTTP");
        }
      }
      if (!response) {
        place->note(ConnectionPlaces::Standing::kSpoken);
        place->set_busy(true);
        response = answer(parser.get(), holder);
        place->set_busy(false);
      }
      peer.expires_after(kPatience);
      stays = response->keep_alive();
      co_await http::async_write(peer, *response, asio::redirect_error(asio::use_awaitable, failed));
      if (failed) co_return;
    }
    boost::system::error_code ignored;
    peer.socket().shutdown(tcp::socket::shutdown_send, ignored);
  }

  /// Reads on until the buffer begins with a whole head; why that is refused, or nothing.
  static asio::awaitable<std::optional<Response>> read_head(beast::tcp_stream& peer,
                                                            beast::flat_buffer& buffer,
                                                            boost::system::error_code& failed) {
    std::size_t searched = 0;
    for (;;) {
      const std::string_view text(static_cast<const char*>(buffer.data().data()), buffer.size());
      const std::size_t end = text.find(kEndOfHttpHead, searched);
      if (std::min(end, text.size()) > kLongestHead) {
        co_return refuse_unread(http::status::request_header_fields_too_large, "the header is too large");
      }
      if (end != std::string_view::npos) {
        const std::string_view why = http_head_problem(text.substr(0, end + kEndOfHttpHead.size()));
        if (why.empty()) co_return std::nullopt;
        co_return refuse_unread(http::status::bad_request, std::string(why));
      }
      searched = text.size() - std::min(text.size(), kEndOfHttpHead.size() - 1);
      const std::size_t count = co_await peer.async_read_some(
          buffer.prepare(kReadUnit), asio::redirect_error(asio::use_awaitable, failed));
      if (failed) co_return std::nullopt;
      buffer.commit(count);
    }
  }

  /// Why whoever asks is refused, or nothing where the right token came.
  std::optional<Response> refuse_without_token(const Request& request, const std::string& holder) {
    const auto now = options.now();
    bool is_known = false;
    {
      const std::lock_guard guard(mutex);
      is_known = known.contains(holder);
    }
    // Before the token is looked at: what is refused here tells nothing of it.
    if (const auto wait = attempts.wait(holder, now); !is_known && wait.count() > 0) {
      Response response =
          refuse(request, http::status::too_many_requests,
                 "too many wrong tokens: try again in " + std::to_string(wait.count()) + " s");
      response.set(http::field::retry_after, std::to_string(wait.count()));
      return response;
    }
    const auto authorization = request[http::field::authorization];
    if (same_secret({authorization.data(), authorization.size()}, "Bearer " + options.token)) {
      attempts.succeeded(holder);
      const std::lock_guard guard(mutex);
      if (known.size() < kMostKnown) known.insert(holder);
      return std::nullopt;
    }
    attempts.failed(holder, now);
    if (const auto count = wrong_tokens.add(holder); count && options.tell) {
      options.tell("a wrong token for the hook came from " + holder + ", " + std::to_string(*count) +
                   " so far");
    }
    return refuse(request, http::status::unauthorized,
                  "a valid token is needed: Authorization: Bearer TOKEN");
  }

  [[nodiscard]] Response answer(const Request& request, const std::string& holder) {
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
    if (auto refused = refuse_without_token(request, holder)) return std::move(*refused);
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
  AttemptGuard attempts{options.attempts};
  Tally wrong_tokens;
  std::mutex mutex;
  std::set<std::string> known;  // addresses from which the right token came
  ConnectionPlaces places{kConnections};
  asio::io_context context;
  tcp::acceptor acceptor;
  std::vector<std::thread> threads;
};

HttpServer::HttpServer(HttpServerOptions options) : state_(std::make_unique<State>(std::move(options))) {}
HttpServer::~HttpServer() = default;
std::uint16_t HttpServer::port() const { return state_->acceptor.local_endpoint().port(); }

}  // namespace kiroku::recorder

#include "http/server.h"

#include <exception>
#include <optional>
#include <utility>  // Boost 1.74 forgets it before its awaitable

#include <boost/asio/detached.hpp>
#include <boost/beast/core/flat_buffer.hpp>

#include "base/network_address.h"
#include "http/connections.h"
#include "http/exchange.h"
#include "http/http_chunks.h"

namespace kiroku::http {
namespace {

namespace asio = boost::asio;
namespace beast = boost::beast;
using asio::ip::tcp;
using boost::system::error_code;
using Parser = beast::http::request_parser<beast::http::string_body>;

Request request_of(const Parser& parser, const std::string& holder) {
  const auto& message = parser.get();
  Request request{
      std::string(message.method_string()), std::string(message.target()), {}, message.body(), holder};
  for (const auto& field : message) {
    request.fields.emplace_back(std::string(field.name_string()), std::string(field.value()));
  }
  return request;
}

}  // namespace

struct Server::State {
  explicit State(ServerOptions asked)
      : options(std::move(asked)), places(options.connections), acceptor(asio::make_strand(context)) {
    listen_on(acceptor, options.listen);
    local = acceptor.local_endpoint();
    const auto hello = [this](tcp::socket socket) { welcome(std::move(socket)); };
    asio::co_spawn(acceptor.get_executor(), accept_all(acceptor, context, hello), asio::detached);
    threads.emplace(context, options.threads);
  }

  void welcome(tcp::socket socket) {
    error_code failed;
    const tcp::endpoint peer = socket.remote_endpoint(failed);
    if (failed) return;
    socket.set_option(tcp::no_delay(true), failed);
    const std::string holder = address_holder(peer.address().to_string());
    const auto stream = std::make_shared<beast::tcp_stream>(std::move(socket));
    auto place = take_place(places, holder, stream, stream->get_executor());
    if (place) {
      asio::co_spawn(stream->get_executor(), serve(stream, holder, std::move(place)), asio::detached);
    }
  }

  asio::awaitable<void> serve(std::shared_ptr<beast::tcp_stream> stream, std::string holder,
                              std::unique_ptr<ConnectionPlaces::Place> place) {
    beast::flat_buffer buffer;
    while (co_await serve_one(*stream, buffer, holder, *place)) {
    }
    error_code ignored;
    stream->socket().shutdown(tcp::socket::shutdown_send, ignored);
  }

  /// One request and its answer; false when the connection is over.
  asio::awaitable<bool> serve_one(beast::tcp_stream& stream, beast::flat_buffer& buffer,
                                  const std::string& holder, ConnectionPlaces::Place& place) {
    Parser parser;
    RefuseChunkExtensions extensions;
    parser.on_chunk_header(extensions);
    parser.header_limit(static_cast<std::uint32_t>(options.most_head_bytes));
    parser.body_limit(options.most_body_bytes);
    allow(stream, options.patience);
    const HeadOutcome head = co_await read_head(stream, buffer, options.most_head_bytes);
    if (head.is_gone) co_return false;
    if (head.refusal) co_return co_await refuse(stream, *head.refusal);
    error_code failed;
    co_await beast::http::async_read(stream, buffer, parser,
                                     asio::redirect_error(asio::use_awaitable, failed));
    if (failed) {
      const std::optional<Refusal> refusal = refusal_of(failed);
      if (!refusal) co_return false;
      co_return co_await refuse(stream, *refusal);
    }
    place.note(ConnectionPlaces::Standing::kSpoken);
    place.set_busy(true);
    const Request request = request_of(parser, holder);
    const Response response = answer(request);
    place.set_busy(false);
    const Sending how{request.method == "HEAD", parser.get().keep_alive(), options.patience};
    co_return co_await send_here(stream, response, how) && how.keep_alive;
  }

  Response answer(const Request& request) const {
    try {
      return options.answer(request);
    } catch (const std::exception& error) {
      return options.refuse({500, error.what()});
    }
  }

  /// After bytes that cannot be made sense of, nothing more is read.
  asio::awaitable<bool> refuse(beast::tcp_stream& stream, const Refusal& refusal) const {
    const Response response = options.refuse(refusal);
    const Sending how{false, false, options.patience};
    co_await send_here(stream, response, how);
    co_return false;
  }

  /// Bodies of small servers are made on the connections' own threads.
  static asio::awaitable<bool> send_here(beast::tcp_stream& stream, const Response& response, Sending how) {
    const auto here = [](auto work) -> asio::awaitable<ByteView> { co_return work(); };
    co_return co_await send(stream, response.status, response.fields, response.body, how, here);
  }

  const ServerOptions options;
  ConnectionPlaces places;
  asio::io_context context;
  tcp::acceptor acceptor;
  tcp::endpoint local;
  std::optional<IoThreads> threads;  // last: uses the rest
};

Server::Server(ServerOptions options) : state_(std::make_unique<State>(std::move(options))) {}
Server::~Server() = default;
std::uint16_t Server::port() const { return state_->local.port(); }

}  // namespace kiroku::http

#include "http/server.h"

#include <algorithm>
#include <exception>
#include <optional>
#include <utility>  // Boost 1.74 forgets it before its awaitable

#include <boost/asio/detached.hpp>
#include <boost/asio/ssl/context.hpp>
#include <boost/beast/core/flat_buffer.hpp>
#include <boost/beast/ssl.hpp>
#include <openssl/x509.h>

#include "base/network_address.h"
#include "http/connections.h"
#include "http/exchange.h"
#include "http/http_chunks.h"
#include "http/server_tls.h"

namespace kiroku::http {
namespace {

namespace asio = boost::asio;
namespace beast = boost::beast;
using asio::ip::tcp;
using boost::system::error_code;
using Parser = beast::http::request_parser<beast::http::string_body>;

using ClearStream = beast::tcp_stream;
using TlsStream = beast::ssl_stream<beast::tcp_stream>;

/// Who is at the other end of a connection.
struct Client {
  std::string holder;
  Bytes certificate;
};

/// DER of what the client showed and the handshake judged; empty for none.
Bytes certificate_of(TlsStream& stream) {
  X509* const shown = SSL_get1_peer_certificate(stream.native_handle());
  if (shown == nullptr) return {};
  Bytes der(static_cast<std::size_t>(std::max(i2d_X509(shown, nullptr), 0)));
  auto* out = reinterpret_cast<unsigned char*>(der.data());
  if (!der.empty()) i2d_X509(shown, &out);
  X509_free(shown);
  return der;
}

Request request_of(const Parser& parser, const Client& client) {
  const auto& message = parser.get();
  Request request{std::string(message.method_string()),
                  std::string(message.target()),
                  {},
                  message.body(),
                  client.holder,
                  client.certificate};
  for (const auto& field : message) {
    request.fields.emplace_back(std::string(field.name_string()), std::string(field.value()));
  }
  return request;
}

}  // namespace

struct Server::State {
  explicit State(ServerOptions asked)
      : options(std::move(asked)), places(options.connections), acceptor(asio::make_strand(context)) {
    if (options.tls) {
      tls.emplace(server_tls(options.tls->certificate_pem, options.tls->key_pem.bytes(),
                             options.tls->client_authority_pem));
    }
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
    if (tls) {
      begin(std::make_shared<TlsStream>(std::move(socket), *tls), holder);
    } else {
      begin(std::make_shared<ClearStream>(std::move(socket)), holder);
    }
  }

  template <typename Stream>
  void begin(const std::shared_ptr<Stream>& stream, const std::string& holder) {
    auto place = take_place(places, holder, stream, stream->get_executor());
    if (place)
      asio::co_spawn(stream->get_executor(), serve(stream, holder, std::move(place)), asio::detached);
  }

  asio::awaitable<void> serve(std::shared_ptr<ClearStream> stream, std::string holder,
                              std::unique_ptr<ConnectionPlaces::Place> place) {
    const Client client{std::move(holder), {}};
    beast::flat_buffer buffer;
    while (co_await serve_one(*stream, buffer, client, *place)) {
    }
    error_code ignored;
    stream->socket().shutdown(tcp::socket::shutdown_send, ignored);
  }

  asio::awaitable<void> serve(std::shared_ptr<TlsStream> stream, std::string holder,
                              std::unique_ptr<ConnectionPlaces::Place> place) {
    error_code failed;
    allow(*stream, options.patience);
    co_await stream->async_handshake(asio::ssl::stream_base::server,
                                     asio::redirect_error(asio::use_awaitable, failed));
    if (failed) co_return;
    const Client client{std::move(holder), certificate_of(*stream)};
    beast::flat_buffer buffer;
    while (co_await serve_one(*stream, buffer, client, *place)) {
    }
    allow(*stream, options.patience);
    co_await stream->async_shutdown(asio::redirect_error(asio::use_awaitable, failed));
  }

  /// One request and its answer; false when the connection is over.
  template <typename Stream>
  asio::awaitable<bool> serve_one(Stream& stream, beast::flat_buffer& buffer, const Client& client,
                                  ConnectionPlaces::Place& place) {
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
    const Request request = request_of(parser, client);
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
  template <typename Stream>
  asio::awaitable<bool> refuse(Stream& stream, const Refusal& refusal) const {
    const Response response = options.refuse(refusal);
    const Sending how{false, false, options.patience};
    co_await send_here(stream, response, how);
    co_return false;
  }

  /// Bodies of small servers are made on the connections' own threads.
  template <typename Stream>
  static asio::awaitable<bool> send_here(Stream& stream, const Response& response, Sending how) {
    const auto here = [](auto work) -> asio::awaitable<ByteView> { co_return work(); };
    co_return co_await send(stream, response.status, response.fields, response.body, how, here);
  }

  const ServerOptions options;
  std::optional<asio::ssl::context> tls;
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

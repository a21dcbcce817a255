#include "timestamp/authority_server.h"

#include <algorithm>
#include <chrono>
#include <optional>
#include <thread>
#include <utility>

#include <boost/asio/io_context.hpp>
#include <boost/asio/ip/tcp.hpp>
#include <boost/asio/post.hpp>
#include <boost/asio/steady_timer.hpp>
#include <boost/beast/core.hpp>
#include <boost/beast/http.hpp>

#include "base/connection_places.h"
#include "base/error.h"
#include "base/http_chunks.h"
#include "base/http_head.h"
#include "base/listen_address.h"
#include "base/network_address.h"

namespace kiroku::timestamp {
namespace {

namespace asio = boost::asio;
namespace beast = boost::beast;
namespace http = boost::beast::http;
using boost::system::error_code;

/// A query is about 100 bytes; extensions make it larger, but never this large.
constexpr std::uint64_t kLargestQuery = 64 * 1024;
constexpr std::uint32_t kLargestHeader = 8 * 1024;
constexpr ConnectionPlaces::Limits kConnections{.all = 64, .of_holder = 16};
constexpr std::size_t kReadUnit = 4 * 1024;
constexpr std::chrono::milliseconds kAcceptPause{100};

constexpr std::string_view kHelp =
    "This is a time-stamping authority (RFC 3161). POST it a query as application/timestamp-query, for "
    "example:\n"
    "openssl ts -query -data FILE -sha256 -cert | curl -H 'Content-Type: application/timestamp-query' "
    "--data-binary @- -o FILE.tsr URL\n";

/// One client: reads a query, answers it, and again while the client keeps the connection.
class Session : public std::enable_shared_from_this<Session> {
 public:
  Session(asio::ip::tcp::socket socket, Authority& authority, std::chrono::milliseconds time_limit)
      : stream_(std::move(socket)), authority_(authority), time_limit_(time_limit) {}
  Session(const Session&) = delete;
  Session& operator=(const Session&) = delete;

  /// Begins to serve; the place is given back with the session.
  void begin(std::unique_ptr<ConnectionPlaces::Place> place) {
    place_ = std::move(place);
    read();
  }
  /// What is pending ends with an error, and the session with it.
  void end() { stream_.close(); }

 private:
  void read() {
    parser_.emplace();
    parser_->on_chunk_header(extensions_);
    parser_->body_limit(kLargestQuery);
    parser_->header_limit(kLargestHeader);
    stream_.expires_after(time_limit_);
    searched_ = 0;
    read_head();
  }

  /// Until the buffer begins with a whole head, which is judged before it is parsed.
  void read_head() {
    const std::string_view text(static_cast<const char*>(buffer_.data().data()), buffer_.size());
    const std::size_t end = text.find(kEndOfHttpHead, searched_);
    const bool is_whole = end != std::string_view::npos;
    if (text.size() > kLargestHeader && (!is_whole || end >= kLargestHeader)) {
      refuse(http::status::bad_request, "The header is too large.\n");
    } else if (is_whole) {
      const std::string_view why = http_head_problem(text.substr(0, end + kEndOfHttpHead.size()));
      if (why.empty()) {
        read_request();
      } else {
        refuse(http::status::bad_request, std::string(why) + "\n");
      }
    } else {
      searched_ = text.size() - std::min(text.size(), kEndOfHttpHead.size() - 1);
      stream_.async_read_some(buffer_.prepare(kReadUnit),
                              [self = shared_from_this()](error_code error, std::size_t count) {
                                if (error) {
                                  self->close();
                                  return;
                                }
                                self->buffer_.commit(count);
                                self->read_head();
                              });
    }
  }

  void read_request() {
    http::async_read(stream_, buffer_, *parser_,
                     [self = shared_from_this()](error_code error, std::size_t) { self->answer(error); });
  }

  void answer(error_code error) {
    if (error == http::error::body_limit) {
      refuse(http::status::payload_too_large, "A time-stamp query is never as large as this.\n");
    } else if (error && error.category() == error_code(http::error::bad_method).category() &&
               error != http::error::end_of_stream && error != http::error::partial_message) {
      refuse(http::status::bad_request, "This is not an HTTP request.\n");
    } else if (error) {
      close();
    } else {
      place_->note(ConnectionPlaces::Standing::kSpoken);
      keep_alive_ = parser_->get().keep_alive();
      answer_request(parser_->get());
    }
  }

  void answer_request(const http::request<http::string_body>& request) {
    if (request.method() != http::verb::post) {
      send(http::status::method_not_allowed, "text/plain; charset=utf-8", std::string(kHelp));
      return;
    }
    const auto type = request[http::field::content_type];
    if (!beast::iequals(type.substr(0, type.find(';')), "application/timestamp-query")) {
      send(http::status::unsupported_media_type, "text/plain; charset=utf-8", std::string(kHelp));
      return;
    }
    const Bytes response = authority_.respond(bytes_of({request.body().data(), request.body().size()}));
    send(http::status::ok, "application/timestamp-reply", std::string(text_of(response)));
  }

  /// After bytes that cannot be made sense of, nothing more is read.
  void refuse(http::status status, std::string text) {
    keep_alive_ = false;
    send(status, "text/plain; charset=utf-8", std::move(text));
  }

  void send(http::status status, const char* type, std::string body) {
    response_.emplace(status, 11);
    response_->set(http::field::server, "kiroku");
    response_->set(http::field::content_type, type);
    if (status == http::status::method_not_allowed) response_->set(http::field::allow, "POST");
    response_->keep_alive(keep_alive_);
    response_->body() = std::move(body);
    response_->prepare_payload();
    stream_.expires_after(time_limit_);
    http::async_write(stream_, *response_, [self = shared_from_this()](error_code error, std::size_t) {
      if (!error && self->keep_alive_) {
        self->read();
      } else {
        self->close();
      }
    });
  }

  void close() {
    error_code ignored;
    stream_.socket().shutdown(asio::ip::tcp::socket::shutdown_send, ignored);
  }

  beast::tcp_stream stream_;
  beast::flat_buffer buffer_;
  RefuseChunkExtensions extensions_;
  std::optional<http::request_parser<http::string_body>> parser_;
  std::optional<http::response<http::string_body>> response_;
  Authority& authority_;
  std::chrono::milliseconds time_limit_;
  std::unique_ptr<ConnectionPlaces::Place> place_;
  std::size_t searched_ = 0;  // of the buffer, for the end of the head
  bool keep_alive_ = false;
};

asio::ip::tcp::endpoint endpoint_of(const std::string& listen) {
  const ListenAddress address = parse_listen_address(listen, 3161);
  return {asio::ip::make_address(address.host), address.port};
}

}  // namespace

struct AuthorityServer::State {
  State(Authority& the_authority, const std::string& listen, std::chrono::milliseconds the_time_limit)
      : authority(the_authority), time_limit(the_time_limit), acceptor(context), pause(context) {
    const auto endpoint = endpoint_of(listen);
    error_code error;
    acceptor.open(endpoint.protocol(), error);
    if (!error) acceptor.set_option(asio::socket_base::reuse_address(true), error);
    if (!error) acceptor.bind(endpoint, error);
    if (!error) acceptor.listen(asio::socket_base::max_listen_connections, error);
    if (error) throw Error("cannot listen on " + listen + ": " + error.message());
    local = acceptor.local_endpoint();
  }

  void accept() {
    acceptor.async_accept([this](error_code error, asio::ip::tcp::socket socket) {
      if (error == asio::error::operation_aborted) return;
      if (error) {
        // Out of file descriptors, say: asking again at once would spin.
        pause.expires_after(kAcceptPause);
        pause.async_wait([this](error_code stopped) {
          if (!stopped) accept();
        });
        return;
      }
      welcome(std::move(socket));
      accept();
    });
  }

  /// A client for whom there is no place is let go at once; it may come again.
  void welcome(asio::ip::tcp::socket socket) {
    error_code failed;
    const auto peer = socket.remote_endpoint(failed);
    if (failed) return;
    const auto session = std::make_shared<Session>(std::move(socket), authority, time_limit);
    auto place =
        places.enter(address_holder(peer.address().to_string()), [leaving = std::weak_ptr<Session>(session)] {
          if (const auto open = leaving.lock()) open->end();
        });
    if (place) session->begin(std::move(place));
  }

  void run() {
    while (true) {
      try {
        context.run();
        return;
      } catch (const std::exception&) {
        // A session that fails (out of memory) ends with its own connection, never the others'.
        continue;
      }
    }
  }

  Authority& authority;
  std::chrono::milliseconds time_limit;
  ConnectionPlaces places{kConnections};
  asio::io_context context{1};
  asio::ip::tcp::acceptor acceptor;
  asio::steady_timer pause;
  asio::ip::tcp::endpoint local;
  std::thread thread;
};

AuthorityServer::AuthorityServer(Authority& authority, const std::string& listen,
                                 std::chrono::milliseconds time_limit)
    : state_(std::make_unique<State>(authority, listen, time_limit)) {
  state_->accept();
  state_->thread = std::thread([state = state_.get()] { state->run(); });
}

AuthorityServer::~AuthorityServer() {
  state_->context.stop();
  state_->thread.join();
}

std::uint16_t AuthorityServer::port() const { return state_->local.port(); }

std::string AuthorityServer::url() const {
  return "http://" + ListenAddress{state_->local.address().to_string(), port()}.to_string() + "/";
}

}  // namespace kiroku::timestamp

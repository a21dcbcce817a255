#include "recorder/vitals/mllp_server.h"

#include <algorithm>
#include <array>
#include <atomic>
#include <set>
#include <thread>
#include <utility>

#include <boost/asio.hpp>
#include <boost/asio/ssl.hpp>

#include "base/connection_places.h"
#include "base/error.h"
#include "base/listen_address.h"
#include "base/network_address.h"
#include "base/tally.h"
#include "recorder/vitals/handshake_pace.h"
#include "recorder/vitals/mllp_framing.h"

namespace kiroku::recorder {
namespace {

namespace asio = boost::asio;
using asio::ip::tcp;
using boost::system::error_code;
using TlsStream = asio::ssl::stream<tcp::socket>;

constexpr std::chrono::milliseconds kOfferAgain{20};
/// Complaints of one name about one address that are told each; a monitor with a loose cable has as many in a
/// long case, and whoever means harm makes millions.
constexpr std::uint64_t kToldEach = 1000;
constexpr std::size_t kMostTallied = 256;

std::string printable(std::string_view text) {
  std::string result;
  for (const char c : text.substr(0, 60)) {
    result += c >= ' ' && c < 0x7F ? c : '?';
  }
  return result;
}

bool is_white(std::string_view text) { return text.find_first_not_of(" \t\r\n") == std::string_view::npos; }

/// What sends this where the first message should begin.
std::string what_sends(std::string_view text) {
  const std::string_view line = text.substr(0, text.find_first_of("\r\n"));
  const std::string_view word = line.substr(0, line.find(' '));
  constexpr std::array<std::string_view, 9> kMethods{"GET",     "POST",  "PUT",   "HEAD",  "OPTIONS",
                                                     "CONNECT", "PATCH", "TRACE", "DELETE"};
  if (line.find(" HTTP/") != std::string_view::npos || std::ranges::find(kMethods, word) != kMethods.end())
    return "a web page in a browser, or another HTTP client";
  if (text.starts_with("\x16\x03")) return "a TLS client, and this port is one without TLS";
  if (text.starts_with("MSH")) return "HL7 without the MLLP frame around it (0x0B before, 0x1C 0x0D behind)";
  return "no HL7 sender";
}

/// One connection, seen by the server.
class Connection {
 public:
  virtual ~Connection() = default;
  virtual void begin(std::unique_ptr<ConnectionPlaces::Place> place) = 0;
  virtual void close() = 0;
  /// Closes it for another.
  virtual void make_room() = 0;
};

struct Shared {
  MllpServer::Options options;
  MllpServer::Taker taker;
  MllpServer::Complaint complaint;
  ConnectionPlaces places{{.all = options.most_connections, .of_holder = options.most_of_address}};
  Tally strangers{};                       // complaints of peers who delivered nothing, by name and address
  Tally senders{kMostTallied, kToldEach};  // and of all others
  std::atomic<std::uint64_t> refused = 0;
  HandshakePace handshakes{options.handshakes, options.network_handshakes_each_second};
  std::set<std::shared_ptr<Connection>> connections{};

  void complain_of_stranger(const std::string& name, const std::string& text, const std::string& peer) {
    complain(strangers, 1, name, text, peer);
  }
  void complain_of_sender(const std::string& name, const std::string& text, const std::string& peer) {
    complain(senders, kToldEach, name, text, peer);
  }
  /// The first `each` are told as they are.
  void complain(Tally& tally, std::uint64_t each, const std::string& name, const std::string& text,
                const std::string& peer) {
    const auto count = tally.add(name + " " + address_holder(peer));
    if (!count) return;
    complaint(name, *count <= each ? text : text + " (" + std::to_string(*count) + " times so far)", peer);
  }
};

tcp::socket& socket_of(tcp::socket& stream) { return stream; }
tcp::socket& socket_of(TlsStream& stream) { return stream.next_layer(); }

/// Reads, hands over, answers, one message after the other, so that answers keep the order of messages. Kept
/// alive by its pending operations.
template <typename Stream>
class StreamConnection : public Connection, public std::enable_shared_from_this<StreamConnection<Stream>> {
 public:
  StreamConnection(Shared& shared, Stream stream, std::string peer)
      : shared_(shared),
        stream_(std::move(stream)),
        peer_(std::move(peer)),
        deframer_(shared.options.longest_message),
        limit_(socket_of(stream_).get_executor()),
        again_(socket_of(stream_).get_executor()) {}

  void begin(std::unique_ptr<ConnectionPlaces::Place> place) override {
    place_ = std::move(place);
    if constexpr (std::is_same_v<Stream, TlsStream>) {
      watch(shared_.options.handshake_limit, "did not complete the TLS handshake in time");
      stream_.async_handshake(asio::ssl::stream_base::server,
                              [self = this->shared_from_this(), this](const error_code& error) {
                                if (error) {
                                  if (!shared_.options.clients.empty() && socket_of(stream_).is_open())
                                    ++shared_.refused;
                                  end("failed the TLS handshake: " + error.message());
                                } else {
                                  read();
                                }
                              });
    } else {
      read();
    }
  }

  void close() override {
    error_code ignored;
    limit_.cancel();
    again_.cancel();
    socket_of(stream_).close(ignored);
    if (std::is_same_v<Stream, TlsStream> && place_ && !delivered_)
      shared_.handshakes.note_failure(peer_, AttemptGuard::Clock::now());
    place_.reset();
    shared_.connections.erase(this->shared_from_this());
  }
  void make_room() override { end("was the idlest when another came"); }

 private:
  void watch(std::chrono::seconds limit, const char* what) {
    limit_.expires_after(limit);
    limit_.async_wait([self = this->shared_from_this(), this, what](const error_code& error) {
      if (!error && socket_of(stream_).is_open()) {
        end(what);
      }
    });
  }

  void read() {
    const bool within = deframer_.within_frame();
    watch(within ? shared_.options.stall_limit : shared_.options.idle_limit,
          within ? "stopped within a message" : "was silent for long");
    stream_.async_read_some(asio::buffer(buffer_), [self = this->shared_from_this(), this](
                                                       const error_code& error, std::size_t count) {
      if (error) {
        end(deframer_.within_frame()
                ? "ended within a message that began with '" + printable(deframer_.partial()) + "'"
                : "");
        return;
      }
      unread_ = std::string_view(buffer_.data(), count);
      proceed();
    });
  }

  /// Handles what has been read, up to the next answer.
  void proceed() {
    if (!socket_of(stream_).is_open()) {
      return;  // closed while an answer was on its way
    }
    while (auto event = deframer_.feed(unread_)) {
      switch (event->kind) {
        case MllpDeframer::Event::Kind::kMessage:
          offered_ = std::move(event->text);
          offer();
          return;
        case MllpDeframer::Event::Kind::kStray:
          // A page of anybody's can make a browser post a message here, behind a head of its own.
          if (!framed_ && !is_white(event->text)) {
            end("sent '" + printable(event->text) + "' before its first message, as " +
                what_sends(event->text) + " does");
            return;
          }
          complain("bytes-outside-frame",
                   "bytes outside of a message were passed over: '" + printable(event->text) + "'");
          break;
        case MllpDeframer::Event::Kind::kCut:
          complain("message-cut",
                   "a message that began with '" + printable(event->text) + "' was cut short by the next");
          break;
        case MllpDeframer::Event::Kind::kTooLong:
          complain("message-too-long",
                   "a message longer than " + std::to_string(shared_.options.longest_message >> 10U) +
                       " KiB, which began with '" + printable(event->text) + "', was dropped");
          break;
      }
    }
    read();
  }

  void offer() {
    limit_.cancel();  // what the recorder takes its time for is not the monitor's fault
    std::optional<MllpServer::Answer> answer;
    try {
      answer = shared_.taker(offered_, peer_);
      framed_ = framed_ || answer;
      if (answer && answer->is_to_sender) {
        if (!delivered_) shared_.handshakes.note_message(peer_);
        delivered_ = true;
        if (place_) place_->note(ConnectionPlaces::Standing::kSpoken);
      }
    } catch (const std::exception& error) {
      end(std::string("brought a message that could not be taken: ") + error.what());
      return;
    }
    if (!answer) {
      again_.expires_after(kOfferAgain);
      again_.async_wait([self = this->shared_from_this(), this](const error_code& error) {
        if (!error && socket_of(stream_).is_open()) {
          offer();
        }
      });
      return;
    }
    if (answer->text.empty()) {
      proceed();
      return;
    }
    answer_ = mllp_frame(answer->text);
    watch(shared_.options.stall_limit, "does not read its acknowledgements");
    asio::async_write(stream_, asio::buffer(answer_),
                      [self = this->shared_from_this(), this](const error_code& error, std::size_t) {
                        if (error) {
                          end("an acknowledgement could not be sent: " + error.message());
                        } else {
                          proceed();
                        }
                      });
  }

  void end(const std::string& why) {
    if (!socket_of(stream_).is_open()) {
      limit_.cancel();  // closed from here; nothing may keep the server waiting
      return;
    }
    if (!why.empty()) {
      complain("connection-ended", "the connection was closed: it " + why);
    }
    close();
  }

  void complain(const std::string& name, const std::string& text) {
    if (delivered_) {
      shared_.complain_of_sender(name, text, peer_);
    } else {
      shared_.complain_of_stranger(name, text, peer_);
    }
  }

  Shared& shared_;
  Stream stream_;
  std::string peer_;
  MllpDeframer deframer_;
  asio::steady_timer limit_, again_;
  std::array<char, 64U << 10> buffer_{};
  std::string_view unread_;  // of buffer_
  std::string offered_, answer_;
  std::unique_ptr<ConnectionPlaces::Place> place_;  // none once it is closed
  bool framed_ = false;                             // something in a frame, whatever it was
  bool delivered_ = false;                          // a message of somebody who may send
};

}  // namespace

struct MllpServer::State {
  State(const Options& options, Taker taker, Complaint complaint)
      : shared{.options = options, .taker = std::move(taker), .complaint = std::move(complaint)},
        acceptor(context),
        pause(context) {
    if (const std::string why = trust_problem(options); !why.empty()) throw UsageError(why);
    listen();
    if (!options.certificate.empty()) {
      prepare_tls();
    }
  }

  void listen() {
    const Options& options = shared.options;
    const std::string where = options.address + ":" + std::to_string(options.port);
    try {
      const tcp::endpoint endpoint(asio::ip::make_address(options.address), options.port);
      acceptor.open(endpoint.protocol());
      acceptor.set_option(tcp::acceptor::reuse_address(true));
      acceptor.bind(endpoint);
      acceptor.listen();
    } catch (const boost::system::system_error& error) {
      throw UsageError("cannot wait for monitors at " + where + ": " + error.code().message() +
                       "; check the address, and that nothing else uses the port");
    }
  }

  void prepare_tls() {
    const Options& options = shared.options;
    try {
      tls.emplace(asio::ssl::context::tls_server);
      tls->set_options(asio::ssl::context::default_workarounds | asio::ssl::context::no_tlsv1 |
                       asio::ssl::context::no_tlsv1_1);
      // No session is resumed: each connection shows its certificate. OpenSSL would else end one that asks to
      // resume, as no context of sessions is named.
      SSL_CTX_set_options(tls->native_handle(), SSL_OP_NO_TICKET | SSL_OP_NO_RENEGOTIATION);
      SSL_CTX_set_session_cache_mode(tls->native_handle(), SSL_SESS_CACHE_OFF);
      tls->use_certificate_chain_file(options.certificate);
      tls->use_private_key_file(options.key.empty() ? options.certificate : options.key,
                                asio::ssl::context::pem);
      if (!options.clients.empty()) {
        tls->load_verify_file(options.clients);
        tls->set_verify_mode(asio::ssl::verify_peer | asio::ssl::verify_fail_if_no_peer_cert);
      }
    } catch (const boost::system::system_error& error) {
      throw UsageError("cannot use the certificate '" + options.certificate + "' or its key for monitors: " +
                       error.code().message() + "; both must be PEM files, the key without passphrase");
    }
  }

  void accept() {
    acceptor.async_accept([this](const error_code& error, tcp::socket socket) {
      if (!acceptor.is_open()) {
        return;
      }
      if (error) {
        // Out of descriptors, most likely: others may close.
        pause.expires_after(std::chrono::seconds(1));
        pause.async_wait([this](const error_code& cancelled) {
          if (!cancelled) {
            accept();
          }
        });
        return;
      }
      try {
        welcome(std::move(socket));
      } catch (const std::exception&) {
        // One connection failed (out of memory); the next one is awaited.
      }
      accept();
    });
  }

  /// Whatever fails for one connection (out of memory) ends neither the others nor the recorder.
  void run() {
    for (;;) {
      try {
        context.run();
        return;
      } catch (const std::exception&) {
        continue;
      }
    }
  }

  void welcome(tcp::socket socket) {
    error_code ignored;
    const auto remote = socket.remote_endpoint(ignored);
    const std::string peer = remote.address().to_string(ignored);
    if (!shared.options.allowed.empty() && !any_contains(shared.options.allowed, peer)) {
      ++shared.refused;
      shared.complain_of_stranger("connection-refused",
                                  "a connection was refused: this address may not send here", peer);
      return;
    }
    if (tls && !shared.handshakes.may_begin(peer, AttemptGuard::Clock::now())) {
      ++shared.refused;
      shared.complain_of_stranger("connection-refused",
                                  "a connection was refused: too many TLS connections of this address or its "
                                  "network brought no message, so it has to wait",
                                  peer);
      return;
    }
    socket.set_option(tcp::no_delay(true), ignored);
    socket.set_option(asio::socket_base::keep_alive(true), ignored);
    std::shared_ptr<Connection> connection;
    if (tls) {
      connection =
          std::make_shared<StreamConnection<TlsStream>>(shared, TlsStream(std::move(socket), *tls), peer);
    } else {
      connection = std::make_shared<StreamConnection<tcp::socket>>(shared, std::move(socket), peer);
    }
    auto place = shared.places.enter(address_holder(peer), [leaving = std::weak_ptr<Connection>(connection)] {
      if (const auto open = leaving.lock()) open->make_room();
    });
    if (!place) return;
    shared.connections.insert(connection);
    connection->begin(std::move(place));
  }

  asio::io_context context{1};
  std::optional<asio::ssl::context> tls;
  Shared shared;
  tcp::acceptor acceptor;
  asio::steady_timer pause;
  std::thread thread;
};

MllpServer::MllpServer(const Options& options, Taker taker, Complaint complaint)
    : state_(std::make_unique<State>(options, std::move(taker), std::move(complaint))) {}

MllpServer::~MllpServer() { stop(); }

std::uint16_t MllpServer::port() const { return state_->acceptor.local_endpoint().port(); }

std::string MllpServer::trust_problem(const Options& options) {
  const bool is_said = !options.allowed.empty() || !options.clients.empty() || options.allow_anybody;
  if (is_said || ListenAddress{options.address, options.port}.is_loopback()) return "";
  return "monitors at " + options.address + ":" + std::to_string(options.port) +
         " could be anybody on the network: say who may send with allow=ADDRESS[/BITS],…, ask for "
         "certificates with mllps:// and clients=PEM, or state allow=any";
}

std::uint64_t MllpServer::refused() const { return state_->shared.refused; }

void MllpServer::start() {
  state_->accept();
  state_->thread = std::thread([this] { state_->run(); });
}

void MllpServer::stop() noexcept {
  State& state = *state_;
  if (!state.thread.joinable()) {
    return;
  }
  asio::post(state.context, [&state] {
    error_code ignored;
    state.acceptor.close(ignored);
    state.pause.cancel();
    const auto connections = state.shared.connections;
    for (const std::shared_ptr<Connection>& connection : connections) {
      connection->close();
    }
  });
  state.thread.join();
}

}  // namespace kiroku::recorder

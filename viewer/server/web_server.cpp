#include "viewer/server/web_server.h"

#include <algorithm>
#include <array>
#include <charconv>
#include <deque>
#include <map>
#include <mutex>
#include <optional>
#include <thread>
#include <unistd.h>
#include <utility>  // Boost 1.74 forgets it before its awaitable
#include <vector>

#include <boost/asio.hpp>
#include <boost/asio/ssl.hpp>
#include <boost/beast/core.hpp>
#include <boost/beast/http.hpp>
#include <boost/beast/ssl.hpp>

#include "base/ascii.h"
#include "base/connection_places.h"
#include "base/error.h"
#include "base/http_chunks.h"
#include "base/http_head.h"
#include "base/listen_address.h"
#include "base/network_address.h"
#include "viewer/server/web_socket.h"

namespace kiroku::viewer {
namespace {

namespace asio = boost::asio;
namespace beast = boost::beast;
namespace http = beast::http;
using asio::ip::tcp;
using boost::system::error_code;

constexpr std::uint16_t kExamplePort = 8443;
constexpr std::size_t kIoThreads = 2;
/// More than wait for programs behind the viewer (viewer/server/workplace_link.cpp).
constexpr std::size_t kFewestWorkers = 24;
constexpr std::size_t kReadUnit = 4U << 10;
/// What a client must take within the write limit.
constexpr std::size_t kWriteUnit = 256U << 10;
/// No route takes more.
constexpr std::uint64_t kLargestBody = 16U << 20;
constexpr int kInnerBuffer = 32 << 10;
constexpr std::chrono::milliseconds kAcceptPause{100};
constexpr std::chrono::seconds kFarewell{2};
/// When whoever was refused for what it costs may come again.
constexpr std::chrono::seconds kCostlyRetry{3};

/// Passwords and identities go through these.
template <typename T>
struct ZeroisingAllocator {
  using value_type = T;
  ZeroisingAllocator() = default;
  template <typename U>
  explicit ZeroisingAllocator(const ZeroisingAllocator<U>& /*other*/) {}
  T* allocate(std::size_t count) { return std::allocator<T>().allocate(count); }
  void deallocate(T* memory, std::size_t count) {
    crypto::zeroise(std::as_writable_bytes(std::span(memory, count)));
    std::allocator<T>().deallocate(memory, count);
  }
  bool operator==(const ZeroisingAllocator& /*other*/) const { return true; }
};
using Buffer = beast::basic_flat_buffer<ZeroisingAllocator<char>>;
using Body = http::basic_string_body<char, std::char_traits<char>, ZeroisingAllocator<char>>;
using Parser = http::request_parser<Body>;

RequestHead head_of(const Parser& parser, const std::string& peer) {
  const auto& message = parser.get();
  RequestHead head;
  head.method = std::string(message.method_string());
  head.target = std::string(message.target());
  head.peer = peer;
  for (const auto& field : message) {
    auto [at, is_new] = head.headers.try_emplace(
        lower_case({field.name_string().data(), field.name_string().size()}), field.value());
    if (!is_new) at->second += (at->first == "cookie" ? "; " : ", ") + std::string(field.value());
  }
  return head;
}

/// Status line and fields. A value with a line break in it would be a second header: std::invalid_argument.
std::string head_text(const Response& response, std::optional<std::uint64_t> size, bool keep_alive) {
  std::string out = "HTTP/1.1 " + std::to_string(response.status) + " " +
                    std::string(http::obsolete_reason(http::int_to_status(unsigned(response.status)))) +
                    "\r\n";
  const auto add = [&out](std::string_view name, std::string_view value) {
    if (value.find_first_of(std::string_view("\r\n\0", 3)) != std::string_view::npos) {
      throw std::invalid_argument("a line break in the header " + std::string(name));
    }
    out.append(name).append(": ").append(value).append("\r\n");
  };
  if (!response.type.empty()) add("Content-Type", response.type);
  if (!response.cache.empty()) add("Cache-Control", response.cache);
  if (!response.entity_tag.empty()) add("ETag", response.entity_tag);
  for (const auto& [name, value] : response.headers) add(name, value);
  if (response.status != 204 && response.status != 304) {
    if (size) {
      add("Content-Length", std::to_string(*size));
    } else {
      add("Transfer-Encoding", "chunked");
    }
  }
  add("Connection", keep_alive ? "keep-alive" : "close");
  return out + "\r\n";
}

/// A body in units, as the client takes them.
class BodyReader {
 public:
  explicit BodyReader(const Response& response) : body_(response.body) {}

  [[nodiscard]] std::optional<std::uint64_t> size() const {
    if (const auto* text = std::get_if<std::string>(&body_)) return text->size();
    if (const auto* bytes = std::get_if<BytesBody>(&body_)) return bytes->size;
    if (const auto* file = std::get_if<FileBody>(&body_)) return file->size;
    if (const auto* read = std::get_if<ReadBody>(&body_)) return read->size;
    return {};
  }
  /// Whether next() computes or reads files: then it is called where that may block.
  [[nodiscard]] bool may_block() const {
    return std::holds_alternative<FileBody>(body_) || std::holds_alternative<ReadBody>(body_) ||
           std::holds_alternative<StreamBody>(body_);
  }
  /// What comes next, valid until the next call; empty at the end.
  ByteView next() {
    if (const auto* stream = std::get_if<StreamBody>(&body_)) {
      buffer_.clear();
      while (buffer_.empty()) {
        if (!(*stream)(buffer_)) return {};
      }
      return buffer_;
    }
    const std::uint64_t left = *size() - done_;
    const auto count = static_cast<std::size_t>(std::min<std::uint64_t>(left, kWriteUnit));
    ByteView out;
    if (const auto* text = std::get_if<std::string>(&body_)) {
      out = bytes_of(std::string_view(*text).substr(done_, count));
    } else if (const auto* bytes = std::get_if<BytesBody>(&body_)) {
      out = ByteView(*bytes->bytes).subspan(static_cast<std::size_t>(bytes->offset + done_), count);
    } else if (const auto* read = std::get_if<ReadBody>(&body_)) {
      buffer_.resize(count);
      read->read(read->offset + done_, buffer_);
      out = buffer_;
    } else {
      out = read_file(std::get<FileBody>(body_), count);
    }
    done_ += count;
    return out;
  }

 private:
  ByteView read_file(const FileBody& file, std::size_t count) {
    buffer_.resize(count);
    std::size_t got = 0;
    while (got < count) {
      const ssize_t read = ::pread(file.file->number(), buffer_.data() + got, count - got,
                                   static_cast<off_t>(file.offset + done_ + got));
      if (read <= 0) throw Error("a file became shorter while it was sent");
      got += static_cast<std::size_t>(read);
    }
    return buffer_;
  }

  const std::variant<std::string, BytesBody, FileBody, ReadBody, StreamBody>& body_;
  std::size_t done_ = 0;
  Bytes buffer_;
};

/// How many answers of each person are being made; whoever has as many as may be waits, without a thread.
/// Thread-safe.
class AnswerShares {
 public:
  explicit AnswerShares(std::size_t of_person) : of_person_(of_person) {}

  /// One answer's, between enter() and its destruction.
  class Share {
   public:
    Share(AnswerShares& shares, std::string person) : shares_(shares), person_(std::move(person)) {}
    ~Share() { shares_.leave(person_); }
    Share(const Share&) = delete;
    Share& operator=(const Share&) = delete;

   private:
    AnswerShares& shares_;
    const std::string person_;
  };
  /// Returns when a Share may be made.
  asio::awaitable<void> enter(const std::string& person) {
    const asio::any_io_executor strand = co_await asio::this_coro::executor;
    const auto waiter = std::make_shared<Waiter>(strand);
    {
      const std::lock_guard guard(mutex_);
      Line& line = lines_[person];
      if (line.answering < of_person_) {
        ++line.answering;
        co_return;
      }
      line.waiting.push_back(waiter);
    }
    error_code ignored;
    while (!waiter->is_next) {
      co_await waiter->timer.async_wait(asio::redirect_error(asio::use_awaitable, ignored));
    }
  }
  /// Nobody's turn comes any more.
  void close() {
    const std::lock_guard guard(mutex_);
    closed_ = true;
  }

 private:
  /// Belongs to its connection's strand, and to nobody else once that is gone.
  struct Waiter {
    explicit Waiter(const asio::any_io_executor& strand)
        : timer(strand, asio::steady_timer::time_point::max()) {}
    asio::steady_timer timer;
    bool is_next = false;
  };
  struct Line {
    std::size_t answering = 0;
    std::deque<std::weak_ptr<Waiter>> waiting;
  };
  void leave(const std::string& person) {
    const std::lock_guard guard(mutex_);
    if (closed_) return;
    const auto line = lines_.find(person);
    while (!line->second.waiting.empty()) {
      const std::shared_ptr<Waiter> next = line->second.waiting.front().lock();
      line->second.waiting.pop_front();
      if (!next) continue;
      asio::post(next->timer.get_executor(), [next] {
        next->is_next = true;
        next->timer.cancel();
      });
      return;
    }
    if (--line->second.answering == 0) lines_.erase(line);
  }

  const std::size_t of_person_;
  std::mutex mutex_;
  std::map<std::string, Line> lines_;
  bool closed_ = false;
};

}  // namespace

struct WebServer::State {
  State(WebServerOptions asked, const Dispatcher& answers, const Dispatcher* of_inner_door)
      : options(std::move(asked)),
        dispatcher(answers),
        places({.all = options.limits.connections,
                .of_holder = options.limits.connections_of_address,
                .kept_of_owner = options.limits.kept_connections_of_person}),
        inner_places({.all = options.limits.connections,
                      .of_holder = options.limits.connections,
                      .kept_of_owner = options.limits.kept_connections_of_person}),
        shares(options.limits.answers_of_person),
        quick_shares(options.limits.quick_answers_of_person),
        costly(options.limits.costly),
        workers(std::max<std::size_t>(kFewestWorkers, 2U * std::thread::hardware_concurrency())),
        acceptor(asio::make_strand(context)),
        inner_acceptor(asio::make_strand(context)) {
    if (!options.listen.empty()) {
      prepare_tls();
      listen();
      asio::co_spawn(acceptor.get_executor(), accept(), asio::detached);
    }
    if (options.inner_door) {
      inner_acceptor.assign(asio::local::stream_protocol(), options.inner_door->take_listener().release());
      asio::co_spawn(inner_acceptor.get_executor(), accept_at_inner_door(*of_inner_door), asio::detached);
    }
    for (std::size_t i = 0; i < kIoThreads; ++i) {
      threads.emplace_back([this] { run(); });
    }
  }
  ~State() {
    context.stop();
    shares.close();
    quick_shares.close();
    for (std::thread& thread : threads) thread.join();
    workers.join();
    costly.stop();
    // Whoever still sends finds no executor any more.
    sockets.close_all();
  }
  State(const State&) = delete;
  State& operator=(const State&) = delete;

  void run() {
    while (true) {
      try {
        context.run();
        return;
      } catch (const std::exception&) {
        // A connection that fails (out of memory) ends by itself, never the others.
        continue;
      }
    }
  }

  void prepare_tls() {
    try {
      tls.use_certificate_chain(asio::buffer(options.certificate_pem));
      tls.use_private_key(asio::buffer(options.key_pem.bytes().data(), options.key_pem.size()),
                          asio::ssl::context::pem);
    } catch (const boost::system::system_error& error) {
      throw UsageError("cannot use the certificate or its key: " + error.code().message() +
                       "; both must be PEM, belong together, and the key have no passphrase");
    }
    SSL_CTX* const native = tls.native_handle();
    SSL_CTX_set_min_proto_version(native, TLS1_2_VERSION);
    SSL_CTX_set_cipher_list(native, "ECDHE+AESGCM:ECDHE+CHACHA20");
    SSL_CTX_set_options(native, SSL_OP_NO_RENEGOTIATION | SSL_OP_NO_COMPRESSION |
                                    SSL_OP_CIPHER_SERVER_PREFERENCE | SSL_OP_NO_TICKET |
                                    SSL_OP_CLEANSE_PLAINTEXT);
    SSL_CTX_set_session_cache_mode(native, SSL_SESS_CACHE_OFF);
    SSL_CTX_set_mode(native, SSL_MODE_RELEASE_BUFFERS);
  }

  void listen() {
    const ListenAddress address = parse_listen_address(options.listen, kExamplePort);
    const tcp::endpoint endpoint(asio::ip::make_address(address.host), address.port);
    error_code error;
    acceptor.open(endpoint.protocol(), error);
    if (!error) acceptor.set_option(asio::socket_base::reuse_address(true), error);
    if (!error) acceptor.bind(endpoint, error);
    if (!error) acceptor.listen(asio::socket_base::max_listen_connections, error);
    if (error) {
      throw Error("cannot listen on " + options.listen + ": " + error.message() +
                  "; name another address with --listen");
    }
    local = acceptor.local_endpoint();
  }

  asio::awaitable<void> accept() {
    asio::steady_timer pause(acceptor.get_executor());
    for (;;) {
      error_code failed;
      tcp::socket socket = co_await acceptor.async_accept(asio::make_strand(context),
                                                          asio::redirect_error(asio::use_awaitable, failed));
      if (failed) {
        // Out of descriptors, say: asking again at once would spin.
        pause.expires_after(kAcceptPause);
        co_await pause.async_wait(asio::redirect_error(asio::use_awaitable, failed));
        continue;
      }
      const tcp::endpoint peer = socket.remote_endpoint(failed);
      if (failed) continue;
      // One that cannot be served (out of memory) is let go; the next ones are accepted all the same.
      try {
        socket.set_option(tcp::no_delay(true), failed);
        welcome(std::move(socket), peer.address().to_string());
      } catch (const std::exception&) {
        continue;
      }
    }
  }

  /// Whoever is not this very user, or root, is let go before it said a word.
  asio::awaitable<void> accept_at_inner_door(const Dispatcher& answers) {
    asio::steady_timer pause(inner_acceptor.get_executor());
    for (;;) {
      error_code failed;
      asio::local::stream_protocol::socket socket = co_await inner_acceptor.async_accept(
          asio::make_strand(context), asio::redirect_error(asio::use_awaitable, failed));
      if (failed) {
        pause.expires_after(kAcceptPause);
        co_await pause.async_wait(asio::redirect_error(asio::use_awaitable, failed));
        continue;
      }
      if (!is_of_this_user(socket.native_handle())) continue;
      // What lies in it the viewer has not taken: pictures would grow old there (SocketOutput::waiting()).
      socket.set_option(asio::socket_base::send_buffer_size(kInnerBuffer), failed);
      try {
        const auto executor = socket.get_executor();
        const auto stream = std::make_shared<LocalStream>(std::move(socket));
        auto place = enter(inner_places, "viewer", stream, executor);
        if (place)
          asio::co_spawn(executor, serve_at_inner_door(stream, answers, std::move(place)), asio::detached);
      } catch (const std::exception&) {
        continue;
      }
    }
  }

  /// Serves it if there is a place for it; else it is let go, and may come again.
  void welcome(tcp::socket socket, const std::string& peer) {
    const auto executor = socket.get_executor();
    const auto stream = std::make_shared<TlsStream>(beast::tcp_stream(std::move(socket)), tls);
    auto place = enter(places, address_holder(peer), stream, executor);
    if (place) asio::co_spawn(executor, serve(stream, peer, std::move(place)), asio::detached);
  }

  template <typename Stream, typename Executor>
  static std::unique_ptr<ConnectionPlaces::Place> enter(ConnectionPlaces& places, const std::string& holder,
                                                        const std::shared_ptr<Stream>& stream,
                                                        const Executor& executor) {
    return places.enter(holder, [leaving = std::weak_ptr<Stream>(stream), executor] {
      asio::post(executor, [leaving] {
        if (const auto open = leaving.lock()) beast::get_lowest_layer(*open).close();
      });
    });
  }

  template <typename Stream>
  static void allow(Stream& stream, std::chrono::milliseconds limit) {
    beast::get_lowest_layer(stream).expires_after(limit);
  }

  asio::awaitable<void> serve_at_inner_door(std::shared_ptr<LocalStream> stream, const Dispatcher& answers,
                                            std::unique_ptr<ConnectionPlaces::Place> place) {
    Buffer buffer;
    while (co_await serve_one(*stream, answers, buffer, "", *place)) {
      place->set_busy(false);
    }
    place.reset();
  }

  asio::awaitable<void> serve(std::shared_ptr<TlsStream> stream, std::string peer,
                              std::unique_ptr<ConnectionPlaces::Place> place) {
    error_code failed;
    allow(*stream, options.limits.handshake);
    co_await stream->async_handshake(asio::ssl::stream_base::server,
                                     asio::redirect_error(asio::use_awaitable, failed));
    if (failed) co_return;
    Buffer buffer;
    while (co_await serve_one(*stream, dispatcher, buffer, peer, *place)) {
      place->set_busy(false);
    }
    allow(*stream, kFarewell);
    co_await stream->async_shutdown(asio::redirect_error(asio::use_awaitable, failed));
    place.reset();
  }

  /// Reads on until the buffer begins with a whole head, and returns its size: 0 where the connection ended
  /// before, more than the limit where it has no end within that. Nothing is taken out of the buffer.
  template <typename Stream>
  asio::awaitable<std::size_t> read_head(Stream& stream, Buffer& buffer) const {
    std::size_t searched = 0;
    for (;;) {
      const std::string_view text(static_cast<const char*>(buffer.data().data()), buffer.size());
      const std::size_t end = text.find(kEndOfHttpHead, searched);
      if (end != std::string_view::npos) co_return end + kEndOfHttpHead.size();
      if (text.size() > options.limits.header_bytes) co_return text.size();
      searched = text.size() - std::min(text.size(), kEndOfHttpHead.size() - 1);
      error_code failed;
      const std::size_t count = co_await stream.async_read_some(
          buffer.prepare(kReadUnit), asio::redirect_error(asio::use_awaitable, failed));
      if (failed) co_return 0;
      buffer.commit(count);
    }
  }

  /// One request and its answer; false when the connection is over.
  template <typename Stream>
  asio::awaitable<bool> serve_one(Stream& stream, const Dispatcher& answers, Buffer& buffer,
                                  const std::string& peer, ConnectionPlaces::Place& place) {
    error_code failed;
    Parser parser;
    RefuseChunkExtensions extensions;
    parser.on_chunk_header(extensions);
    parser.header_limit(options.limits.header_bytes);
    parser.body_limit(kLargestBody);
    allow(stream, options.limits.header);
    const std::size_t head_bytes = co_await read_head(stream, buffer);
    if (head_bytes == 0) co_return false;
    if (head_bytes > options.limits.header_bytes) {
      co_await send(stream, Dispatcher::refuse(431, "the header is too large"), false, false);
      co_return false;
    }
    const std::string_view why =
        http_head_problem({static_cast<const char*>(buffer.data().data()), head_bytes});
    if (!why.empty()) {
      co_await send(stream, Dispatcher::refuse(400, std::string(why)), false, false);
      co_return false;
    }
    co_await http::async_read_header(stream, buffer, parser,
                                     asio::redirect_error(asio::use_awaitable, failed));
    if (failed == http::error::body_limit) {
      co_await send(stream, Dispatcher::refuse(413, "the body is too large"), false, false);
      co_return false;
    }
    if (failed) {
      co_await send(stream, Dispatcher::refuse(400, "this is not HTTP"), false, false);
      co_return false;
    }
    if (parser.get().version() != 11) {
      co_await send(stream, Dispatcher::refuse(505, "this server speaks HTTP/1.1"), false, false);
      co_return false;
    }
    const bool is_head = parser.get().method() == http::verb::head;
    const bool keep_alive = parser.get().keep_alive();
    const bool has_body = parser.chunked() || parser.content_length().value_or(0) > 0;
    RequestHead head = head_of(parser, peer);
    const bool wants_socket = is_socket_request(head);
    Dispatcher::Admission admission = answers.admit(std::move(head));
    const bool is_known = admission.request.session != nullptr;
    if (is_known) {
      place.note_known(admission.request.session->person());
    } else {
      place.note(ConnectionPlaces::Standing::kSpoken);
    }
    if (admission.refusal) {
      const bool stay = keep_alive && !has_body;
      co_return co_await send(stream, *admission.refusal, is_head, stay) && stay;
    }
    if (wants_socket && admission.route != nullptr && admission.route->socket && !has_body) {
      place.set_busy(is_known);
      UpgradeRequest upgrade;
      upgrade.base() = parser.get().base();
      Response refusal;
      if (!co_await serve_socket(stream, upgrade, answers, admission, workers, sockets, refusal)) {
        co_await send(stream, refusal, is_head, false);
      }
      co_return false;
    }
    if (parser.content_length().value_or(0) > admission.body_limit) {
      co_await send(stream, Dispatcher::refuse(413, "the body is too large"), is_head, false);
      co_return false;
    }
    parser.body_limit(admission.body_limit);
    allow(stream, options.limits.body);
    if (has_body && beast::iequals(parser.get()[http::field::expect], "100-continue")) {
      co_await asio::async_write(stream, asio::buffer(std::string_view("HTTP/1.1 100 Continue\r\n\r\n")),
                                 asio::redirect_error(asio::use_awaitable, failed));
      if (failed) co_return false;
    }
    co_await http::async_read(stream, buffer, parser, asio::redirect_error(asio::use_awaitable, failed));
    if (failed == http::error::body_limit) {
      co_await send(stream, Dispatcher::refuse(413, "the body is too large"), is_head, false);
      co_return false;
    }
    if (failed == http::error::bad_chunk_extension) {
      co_await send(stream, Dispatcher::refuse(400, "chunks with extensions are not known here"), is_head,
                    false);
      co_return false;
    }
    if (failed) co_return false;
    const auto& body = parser.get().body();
    admission.request.body.assign(body.data(), body.size());
    beast::get_lowest_layer(stream).expires_never();
    place.set_busy(true);
    Response response = co_await answer(answers, admission);
    while (response.costly) response = co_await at_a_cost(std::move(*response.costly));
    // Whoever takes an answer slowly on purpose is not busy.
    place.set_busy(false);
    co_return co_await send(stream, response, is_head, keep_alive, &admission) && keep_alive;
  }

  asio::awaitable<Response> answer(const Dispatcher& answers, const Dispatcher::Admission& admission) {
    std::optional<AnswerShares::Share> share;
    if (admission.request.session) {
      const bool is_quick = admission.route != nullptr && admission.route->is_quick;
      AnswerShares& line = is_quick ? quick_shares : shares;
      const std::string person = admission.request.session->person();
      co_await line.enter(person);
      share.emplace(line, person);
    }
    co_return co_await on_worker([&] { return answers.answer(admission); });
  }

  /// Runs what may block on another thread than those of the connections.
  template <typename Work>
  asio::awaitable<std::invoke_result_t<Work&>> on_worker(Work work) {
    const auto task = [&work]() -> asio::awaitable<std::invoke_result_t<Work&>> { co_return work(); };
    co_return co_await asio::co_spawn(workers.get_executor(), task, asio::use_awaitable);
  }

  /// Does the work on threads of its own when its turn comes; refuses it at once where too much waits. What
  /// it throws (out of memory) ends the connection.
  asio::awaitable<Response> at_a_cost(CostlyAnswer asked) {
    struct Done {
      explicit Done(const asio::any_io_executor& strand)
          : timer(strand, asio::steady_timer::time_point::max()) {}
      asio::steady_timer timer;
      Response response;
      std::exception_ptr broken;
      bool is_done = false;
    };
    const asio::any_io_executor strand = co_await asio::this_coro::executor;
    const auto done = std::make_shared<Done>(strand);
    const bool is_taken =
        costly.offer(asked.goes_first, asked.who, [done, strand, work = std::move(asked.work)] {
          try {
            done->response = work();
          } catch (...) {
            done->broken = std::current_exception();
          }
          // The timer belongs to the strand, on which nothing runs between here and the wait below.
          asio::post(strand, [done] {
            done->is_done = true;
            done->timer.cancel();
          });
        });
    if (!is_taken) {
      co_return Dispatcher::refuse(429, "many are signing in now: try again in a moment", kCostlyRetry);
    }
    error_code ignored;
    while (!done->is_done) {
      co_await done->timer.async_wait(asio::redirect_error(asio::use_awaitable, ignored));
    }
    if (done->broken) std::rethrow_exception(done->broken);
    co_return std::move(done->response);
  }

  /// Whether a long answer may go on. A download that is taken is a deed, so that it does not end its own
  /// session; with the session it ends.
  static bool may_go_on(const Dispatcher::Admission* admission) {
    if (admission == nullptr || !admission->request.session) return true;
    if (admission->request.session->has_ended()) return false;
    if (admission->route != nullptr && admission->route->is_activity)
      SessionStore::note_activity(*admission->request.session);
    return true;
  }

  [[nodiscard]] bool is_too_slow(std::uint64_t sent, std::chrono::duration<double> waited) const {
    return waited > options.limits.pace_counts_after &&
           static_cast<double>(sent) <
               waited.count() * static_cast<double>(options.limits.least_download_pace);
  }

  /// False if it could not be sent whole: then the connection must end.
  template <typename Stream>
  asio::awaitable<bool> send(Stream& stream, const Response& response, bool is_head, bool keep_alive,
                             const Dispatcher::Admission* admission = nullptr) {
    BodyReader reader(response);
    const std::optional<std::uint64_t> size = reader.size();
    std::string before = head_text(response, size, keep_alive);
    bool is_last = is_head || response.status == 204 || response.status == 304;
    bool is_first = true;
    std::uint64_t sent = 0;
    std::chrono::duration<double> waited{0};
    error_code failed;
    do {
      ByteView unit;
      // What is short has been made already, and may be the answer to signing out.
      if (!is_last && !is_first && reader.may_block() && !may_go_on(admission)) co_return false;
      is_first = false;
      if (!is_last) {
        if (reader.may_block()) {
          unit = co_await on_worker([&] { return reader.next(); });
        } else {
          unit = reader.next();
        }
        is_last = unit.empty();
      }
      std::string_view after;
      if (!size && !is_head) {
        std::array<char, 16> hex{};
        const auto [end, error] = std::to_chars(hex.begin(), hex.end(), unit.size(), 16);
        before.append(hex.begin(), end).append("\r\n");
        after = "\r\n";
      }
      const std::array<asio::const_buffer, 3> parts{
          asio::buffer(before), asio::buffer(unit.data(), unit.size()), asio::buffer(after)};
      allow(stream, options.limits.write);
      const auto begin = std::chrono::steady_clock::now();
      co_await asio::async_write(stream, parts, asio::redirect_error(asio::use_awaitable, failed));
      waited += std::chrono::steady_clock::now() - begin;
      sent += unit.size();
      if (reader.may_block() && is_too_slow(sent, waited)) co_return false;
      before.clear();
    } while (!failed && !is_last);
    co_return !failed;
  }

  const WebServerOptions options;
  const Dispatcher& dispatcher;
  ConnectionPlaces places, inner_places;
  AnswerShares shares, quick_shares;
  OpenSockets sockets;
  CostlyWork costly;
  asio::thread_pool workers;
  asio::ssl::context tls{asio::ssl::context::tls_server};
  asio::io_context context;
  tcp::acceptor acceptor;
  tcp::endpoint local;
  asio::local::stream_protocol::acceptor inner_acceptor;
  std::vector<std::thread> threads;
};

WebServer::WebServer(WebServerOptions options, const Dispatcher& dispatcher, const Dispatcher* of_inner_door)
    : state_(std::make_unique<State>(std::move(options), dispatcher, of_inner_door)) {}
WebServer::~WebServer() = default;

std::uint16_t WebServer::port() const { return state_->local.port(); }

std::string WebServer::url() const {
  if (state_->options.listen.empty()) return "";
  return "https://" + ListenAddress{state_->local.address().to_string(), port()}.to_string() + "/";
}

bool is_loopback(const std::string& listen) {
  return parse_listen_address(listen, kExamplePort).is_loopback();
}

}  // namespace kiroku::viewer

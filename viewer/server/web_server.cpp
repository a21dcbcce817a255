#include "viewer/server/web_server.h"

#include <algorithm>
#include <deque>
#include <map>
#include <mutex>
#include <optional>
#include <thread>
#include <utility>  // Boost 1.74 forgets it before its awaitable
#include <vector>

#include <boost/asio.hpp>
#include <boost/asio/ssl.hpp>
#include <boost/beast/core.hpp>
#include <boost/beast/http.hpp>
#include <boost/beast/ssl.hpp>

#include "base/ascii.h"
#include "base/connection_places.h"
#include "base/listen_address.h"
#include "base/network_address.h"
#include "http/connections.h"
#include "http/exchange.h"
#include "http/http_chunks.h"
#include "http/server_tls.h"
#include "viewer/server/web_socket.h"

namespace kiroku::viewer {
namespace {

namespace asio = boost::asio;
namespace beast = boost::beast;
using asio::ip::tcp;
using boost::system::error_code;

/// A person may leave as many answers of this size untaken as there are connections.
constexpr std::size_t kSmallAnswer = 1U << 20;
constexpr std::uint16_t kExamplePort = 8443;
constexpr std::size_t kIoThreads = 2;
/// More than wait for programs behind the viewer (viewer/server/workplace_link.cpp).
constexpr std::size_t kFewestWorkers = 24;
/// No route takes more.
constexpr std::uint64_t kLargestBody = 16U << 20;
constexpr int kInnerBuffer = 32 << 10;
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
using Body = beast::http::basic_string_body<char, std::char_traits<char>, ZeroisingAllocator<char>>;
using Parser = beast::http::request_parser<Body>;

/// What is sent before the body.
http::Fields fields_of(const Response& response) {
  http::Fields fields;
  if (!response.type.empty()) fields.emplace_back("Content-Type", response.type);
  if (!response.cache.empty()) fields.emplace_back("Cache-Control", response.cache);
  if (!response.entity_tag.empty()) fields.emplace_back("ETag", response.entity_tag);
  fields.insert(fields.end(), response.headers.begin(), response.headers.end());
  return fields;
}

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
      const ListenAddress address = parse_listen_address(options.listen, kExamplePort);
      tls.emplace(http::server_tls(options.certificate_pem, options.key_pem.bytes()));
      http::listen_on(acceptor, address, "; name another address with --listen");
      local = acceptor.local_endpoint();
      const auto hello = [this](tcp::socket socket) { welcome(std::move(socket)); };
      asio::co_spawn(acceptor.get_executor(), http::accept_all(acceptor, context, hello), asio::detached);
    }
    if (options.inner_door) {
      inner_acceptor.assign(asio::local::stream_protocol(), options.inner_door->take_listener().release());
      const auto hello = [this, of_inner_door](asio::local::stream_protocol::socket socket) {
        welcome_at_inner_door(std::move(socket), *of_inner_door);
      };
      asio::co_spawn(inner_acceptor.get_executor(), http::accept_all(inner_acceptor, context, hello),
                     asio::detached);
    }
    threads.emplace(context, kIoThreads);
  }
  ~State() {
    context.stop();
    shares.close();
    quick_shares.close();
    threads->stop();
    workers.join();
    costly.stop();
    // Whoever still sends finds no executor any more.
    sockets.close_all();
  }
  State(const State&) = delete;
  State& operator=(const State&) = delete;

  /// Whoever is not this very user, or root, is let go before it said a word.
  void welcome_at_inner_door(asio::local::stream_protocol::socket socket, const Dispatcher& answers) {
    if (!is_of_this_user(socket.native_handle())) return;
    // What lies in it the viewer has not taken: pictures would grow old there (SocketOutput::waiting()).
    error_code ignored;
    socket.set_option(asio::socket_base::send_buffer_size(kInnerBuffer), ignored);
    const auto executor = socket.get_executor();
    const auto stream = std::make_shared<LocalStream>(std::move(socket));
    auto place = http::take_place(inner_places, "viewer", stream, executor);
    if (place) {
      asio::co_spawn(executor, serve_at_inner_door(stream, answers, std::move(place)), asio::detached);
    }
  }

  /// Serves it if there is a place for it; else it is let go, and may come again.
  void welcome(tcp::socket socket) {
    error_code failed;
    const std::string peer = socket.remote_endpoint(failed).address().to_string();
    if (failed) return;
    socket.set_option(tcp::no_delay(true), failed);
    const auto executor = socket.get_executor();
    const auto stream = std::make_shared<TlsStream>(beast::tcp_stream(std::move(socket)), *tls);
    auto place = http::take_place(places, address_holder(peer), stream, executor);
    if (place) asio::co_spawn(executor, serve(stream, peer, std::move(place)), asio::detached);
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
    http::allow(*stream, options.limits.handshake);
    co_await stream->async_handshake(asio::ssl::stream_base::server,
                                     asio::redirect_error(asio::use_awaitable, failed));
    if (failed) co_return;
    Buffer buffer;
    while (co_await serve_one(*stream, dispatcher, buffer, peer, *place)) {
      place->set_busy(false);
    }
    http::allow(*stream, kFarewell);
    co_await stream->async_shutdown(asio::redirect_error(asio::use_awaitable, failed));
    place.reset();
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
    http::allow(stream, options.limits.header);
    const http::HeadOutcome outcome = co_await http::read_head(stream, buffer, options.limits.header_bytes);
    if (outcome.is_gone) co_return false;
    if (outcome.refusal) co_return co_await refuse(stream, *outcome.refusal, false);
    co_await beast::http::async_read_header(stream, buffer, parser,
                                            asio::redirect_error(asio::use_awaitable, failed));
    if (failed) {
      const std::optional<http::Refusal> refusal = http::refusal_of(failed);
      if (!refusal) co_return false;
      co_return co_await refuse(stream, *refusal, false);
    }
    if (parser.get().version() != 11) {
      co_await send(stream, Dispatcher::refuse(505, "this server speaks HTTP/1.1"), false, false);
      co_return false;
    }
    const bool is_head = parser.get().method() == beast::http::verb::head;
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
    http::allow(stream, options.limits.body);
    if (has_body && beast::iequals(parser.get()[beast::http::field::expect], "100-continue") &&
        !co_await http::send_continue(stream)) {
      co_return false;
    }
    co_await beast::http::async_read(stream, buffer, parser,
                                     asio::redirect_error(asio::use_awaitable, failed));
    if (failed) {
      const std::optional<http::Refusal> refusal = http::refusal_of(failed);
      if (!refusal) co_return false;
      co_return co_await refuse(stream, *refusal, is_head);
    }
    const auto& body = parser.get().body();
    admission.request.body.assign(body.data(), body.size());
    beast::get_lowest_layer(stream).expires_never();
    place.set_busy(true);
    std::optional<AnswerShares::Share> share;
    Response response = co_await answer(answers, admission, share);
    // What one person does not take fills no memory without end; a film's bytes are shared by all who watch.
    const auto* const made = std::get_if<std::string>(&response.body);
    if (made == nullptr || made->size() <= kSmallAnswer) share.reset();
    while (response.costly) response = co_await at_a_cost(std::move(*response.costly));
    // Whoever takes an answer slowly on purpose is not busy.
    place.set_busy(false);
    co_return co_await send(stream, response, is_head, keep_alive, &admission) && keep_alive;
  }

  asio::awaitable<Response> answer(const Dispatcher& answers, const Dispatcher::Admission& admission,
                                   std::optional<AnswerShares::Share>& share) {
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
    const http::Sending how{is_head, keep_alive, options.limits.write,
                            [this, admission](std::uint64_t sent, std::chrono::duration<double> waited) {
                              return !is_too_slow(sent, waited) && may_go_on(admission);
                            }};
    const http::Fields fields = fields_of(response);
    co_return co_await http::send(stream, response.status, fields, response.body, how,
                                  [this](auto work) { return on_worker(work); });
  }

  /// After what cannot be made sense of, or is too much, nothing more is read.
  template <typename Stream>
  asio::awaitable<bool> refuse(Stream& stream, const http::Refusal& refusal, bool is_head) {
    const Response response = Dispatcher::refuse(refusal.status, refusal.why);
    co_await send(stream, response, is_head, false);
    co_return false;
  }

  const WebServerOptions options;
  const Dispatcher& dispatcher;
  ConnectionPlaces places, inner_places;
  AnswerShares shares, quick_shares;
  OpenSockets sockets;
  CostlyWork costly;
  asio::thread_pool workers;
  std::optional<asio::ssl::context> tls;
  asio::io_context context;
  tcp::acceptor acceptor;
  tcp::endpoint local;
  asio::local::stream_protocol::acceptor inner_acceptor;
  std::optional<http::IoThreads> threads;
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

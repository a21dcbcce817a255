#include "viewer/server/workplace_link.h"

#include <chrono>
#include <deque>
#include <future>
#include <mutex>
#include <optional>
#include <thread>
#include <utility>  // Boost 1.74 forgets it before its awaitable

#include <boost/asio.hpp>
#include <boost/beast/core.hpp>
#include <boost/beast/http.hpp>
#include <boost/beast/websocket.hpp>
#include <nlohmann/json.hpp>

#include "base/foreign_json.h"
#include "viewer/people/session.h"
#include "viewer/server/inner_door.h"
#include "viewer/server/workplace_caller.h"

namespace kiroku::viewer {
namespace {

namespace asio = boost::asio;
namespace beast = boost::beast;
namespace http = beast::http;
namespace websocket = beast::websocket;
using asio::local::stream_protocol;
using boost::system::error_code;
using Stream = beast::basic_stream<stream_protocol>;
using Socket = websocket::stream<Stream, false>;  // nothing is compressed

constexpr std::chrono::seconds kToShakeHands{10};
constexpr std::chrono::milliseconds kLook{100};
constexpr std::size_t kLargestAnswer = 4U << 20, kLongestRefusal = 64U << 10;
/// What a SocketOutput takes at all.
constexpr std::size_t kLongestMessage = 4U << 20;
constexpr std::string_view kJson = "application/json", kPdf = "application/pdf";

/// Of what the browser sent nothing but the target, the body and the language goes on.
void put_fields(http::fields& fields, const Request& request) {
  fields.set(http::field::host, "kiroku");
  fields.set("X-Kiroku-Request", "1");
  const auto put = [&fields](std::string_view name, std::string_view value) {
    fields.set(beast::string_view(name.data(), name.size()), beast::string_view(value.data(), value.size()));
  };
  put(kCallersUser, request.session->user());
  put(kCallersRole, role_name(request.session->role()));
  put(kCallersAddress, request.peer);
}

std::string error_in(const std::string& body) {
  if (body.size() > kLongestRefusal) return "";
  const nlohmann::json answer = parse_foreign_json(body);
  if (!answer.is_object()) return "";
  const auto error = answer.find("error");
  return error != answer.end() && error->is_string() ? error->get<std::string>() : "";
}

/// The viewer's own statuses stay its own: a program behind it can neither sign anybody out (401) nor send
/// anybody elsewhere (3xx).
bool may_be_told(unsigned status) { return status >= 400 && status < 600 && status != 401; }

Response taken_over(const std::string& what, const http::response<http::string_body>& answer) {
  const unsigned status = answer.result_int();
  const auto type = answer[http::field::content_type];
  if (may_be_told(status)) {
    const std::string error = error_in(answer.body());
    if (!error.empty()) return Response::error(static_cast<int>(status), error);
  }
  if ((status == 200 || status == 201) && type == beast::string_view(kJson.data(), kJson.size())) {
    Response out = Response::text(answer.body(), std::string(kJson));
    out.status = static_cast<int>(status);
    return out;
  }
  if (status == 200 && type == beast::string_view(kPdf.data(), kPdf.size())) {
    const ByteView bytes = bytes_of(answer.body());
    return Response::bytes(Bytes(bytes.begin(), bytes.end()), std::string(kPdf))
        .with("Content-Disposition", "inline; filename=\"" + what + ".pdf\"");
  }
  throw Refusal(502, "the program behind this page answered with what is no answer");
}

/// One browser's WebSocket as the program behind the viewer sees it. Everything but say() runs on the link's
/// thread.
class Relay : public std::enable_shared_from_this<Relay> {
 public:
  Relay(stream_protocol::socket socket, std::shared_ptr<SocketOutput> output,
        const WorkplaceLink::Limits& limits)
      : socket_(std::move(socket)),
        output_(std::move(output)),
        limits_(limits),
        wake_(socket_.get_executor(), asio::steady_timer::time_point::max()) {}

  /// Queues what the browser said and returns at once; false where as much waits as may. For any thread.
  bool say(bool is_text, ByteView bytes) {
    {
      const std::lock_guard guard(mutex_);
      if (is_over_) return true;  // listen() tells why
      if (said_.size() >= limits_.untaken_messages || untaken_ + bytes.size() > limits_.untaken_bytes)
        return false;
      untaken_ += bytes.size();
      said_.push_back({is_text, Bytes(bytes.begin(), bytes.end())});
    }
    asio::post(socket_.get_executor(), [self = shared_from_this()] { self->wake_.cancel(); });
    return true;
  }

  /// Status 0 and "", or what it said where it refused.
  struct Opening {
    int status = 0;
    std::string error;
  };
  static asio::awaitable<Opening> open(std::shared_ptr<Relay> self, http::fields fields, std::string target) {
    Socket& socket = self->socket_;
    beast::get_lowest_layer(socket).expires_never();
    // Its pings keep the connection alive; here only the beginning is limited.
    socket.set_option(websocket::stream_base::timeout{kToShakeHands, websocket::stream_base::none(), false});
    socket.set_option(websocket::stream_base::decorator([fields = std::move(fields)](auto& request) {
      for (const auto& field : fields) request.set(field.name_string(), field.value());
    }));
    socket.read_message_max(kLongestMessage);
    socket.auto_fragment(false);
    websocket::response_type answer;
    error_code failed;
    co_await socket.async_handshake(answer, "kiroku", target,
                                    asio::redirect_error(asio::use_awaitable, failed));
    Opening out;
    if (!failed) co_return out;
    const unsigned status = answer.result_int();
    out.status =
        failed == websocket::error::upgrade_declined && may_be_told(status) ? static_cast<int>(status) : 502;
    out.error = error_in(answer.body());
    co_return out;
  }

  static asio::awaitable<void> listen(std::shared_ptr<Relay> self) {
    Socket& socket = self->socket_;
    for (;;) {
      beast::flat_buffer buffer;
      error_code failed;
      co_await socket.async_read(buffer, asio::redirect_error(asio::use_awaitable, failed));
      if (failed) break;
      const auto* const bytes = static_cast<const std::byte*>(buffer.data().data());
      const bool is_taken =
          socket.got_text()
              ? self->output_->send_text(std::string(text_of(ByteView(bytes, buffer.size()))))
              : self->output_->send_bytes(std::make_shared<const Bytes>(bytes, bytes + buffer.size()));
      if (!is_taken) break;
      co_await self->until_taken();
    }
    const auto& reason = socket.reason().reason;
    if (!reason.empty()) {
      self->output_->end(std::string(reason.data(), reason.size()));
    } else if (self->is_late_) {
      self->output_->end("the program behind this page takes nothing of what is sent: try again later");
    } else {
      self->output_->end("the program behind this page has ended: try again once it runs");
    }
    self->close();
  }

  /// Sends what say() queued, one message after the other, until the connection is over.
  static asio::awaitable<void> talk(std::shared_ptr<Relay> self) {
    asio::steady_timer limit(self->socket_.get_executor());
    error_code failed;
    while (!failed) {
      const std::optional<Said> next = self->take();
      if (!next && (self->has_left_ || self->is_closed())) break;
      if (!next) {
        error_code ignored;
        co_await self->wake_.async_wait(asio::redirect_error(asio::use_awaitable, ignored));
        continue;
      }
      self->close_after(limit, self->limits_.to_take);
      self->socket_.text(next->is_text);
      co_await self->socket_.async_write(asio::buffer(next->bytes.data(), next->bytes.size()),
                                         asio::redirect_error(asio::use_awaitable, failed));
      limit.cancel();
    }
    self->close();
  }

  /// The browser has gone: what it said before is still sent, if it is taken soon.
  void leave() {
    has_left_ = true;
    last_.emplace(socket_.get_executor());
    close_after(*last_, limits_.to_take_last);
    wake_.cancel();
  }
  void close() {
    {
      const std::lock_guard guard(mutex_);
      is_over_ = true;
      said_.clear();
      untaken_ = 0;
    }
    beast::get_lowest_layer(socket_).close();
    wake_.cancel();
    if (last_) last_->cancel();
  }

 private:
  struct Said {
    bool is_text = false;
    Bytes bytes;
  };
  std::optional<Said> take() {
    const std::lock_guard guard(mutex_);
    if (said_.empty()) return {};
    Said next = std::move(said_.front());
    said_.pop_front();
    untaken_ -= next.bytes.size();
    return next;
  }
  [[nodiscard]] bool is_closed() const {
    const std::lock_guard guard(mutex_);
    return is_over_;
  }
  void close_after(asio::steady_timer& timer, std::chrono::milliseconds limit) {
    timer.expires_after(limit);
    timer.async_wait([weak = weak_from_this()](const error_code& cancelled) {
      const std::shared_ptr<Relay> self = weak.lock();
      if (cancelled || !self) return;
      self->is_late_ = true;
      self->close();
    });
  }
  /// So that no pictures lie between for a browser that is slow: the program makes the next one when the last
  /// has gone.
  asio::awaitable<void> until_taken() {
    if (output_->waiting() == 0) co_return;
    const auto wake =
        std::make_shared<asio::steady_timer>(socket_.get_executor(), asio::steady_timer::time_point::max());
    // Runs on this thread, so never before the wait has begun.
    output_->when_taken([wake] { asio::post(wake->get_executor(), [wake] { wake->cancel(); }); });
    error_code ignored;
    co_await wake->async_wait(asio::redirect_error(asio::use_awaitable, ignored));
  }

  Socket socket_;
  const std::shared_ptr<SocketOutput> output_;
  const WorkplaceLink::Limits limits_;
  asio::steady_timer wake_;                 // of talk()
  std::optional<asio::steady_timer> last_;  // once the browser has gone
  bool has_left_ = false, is_late_ = false;
  mutable std::mutex mutex_;  // of what follows
  std::deque<Said> said_;
  std::size_t untaken_ = 0;
  bool is_over_ = false;
};

}  // namespace

struct WorkplaceLink::State {
  State(std::string of, std::filesystem::path at, const std::atomic<bool>& ends, const Limits& bounds)
      : what(std::move(of)),
        path(std::move(at)),
        closing(ends),
        limits(bounds),
        turns(bounds.waiting, {"others wait for the program behind this page: try again in a moment",
                               "you wait for the program behind this page already: try again in a moment"}),
        work(asio::make_work_guard(context)),
        thread([this] { run(); }) {}
  ~State() {
    context.stop();
    thread.join();
  }
  State(const State&) = delete;
  State& operator=(const State&) = delete;

  void run() {
    for (;;) {
      try {
        context.run();
        return;
      } catch (const std::exception&) {
        // One connection failed (out of memory); the others go on.
        continue;
      }
    }
  }

  stream_protocol::socket connect() {
    std::optional<Descriptor> connection = knock(path);
    if (!connection)
      throw Refusal(503, "the program behind this page does not run: start kiroku " + command());
    return {context, stream_protocol(), connection->release()};
  }
  [[nodiscard]] std::string command() const {
    return what == "planning" ? "plan serve" : what == "breathing" ? "respire serve" : "train serve";
  }

  /// What the link's thread comes to, or a Refusal where that takes too long or nobody may be answered any
  /// more.
  template <typename T>
  T wait(std::future<T> coming, std::chrono::milliseconds patience, const Session& asker) const {
    const auto until = std::chrono::steady_clock::now() + patience;
    while (coming.wait_for(kLook) != std::future_status::ready) {
      if (asker.has_ended()) break;
      if (closing || std::chrono::steady_clock::now() > until)
        throw Refusal(504, "the program behind this page does not answer in time");
    }
    if (asker.has_ended()) throw Refusal(401, "the session has ended");
    return coming.get();
  }

  /// Closes what is asked over when whoever asked has gone: the program need not go on.
  template <typename Closed>
  class ClosedAtLast {
   public:
    ClosedAtLast(asio::io_context& context, Closed close) : context_(context), close_(std::move(close)) {}
    ~ClosedAtLast() {
      if (close_) asio::post(context_, std::move(*close_));
    }
    ClosedAtLast(const ClosedAtLast&) = delete;
    ClosedAtLast& operator=(const ClosedAtLast&) = delete;
    void keep_open() { close_.reset(); }

   private:
    asio::io_context& context_;
    std::optional<Closed> close_;
  };

  static asio::awaitable<http::response<http::string_body>> exchange(
      std::shared_ptr<Stream> asked_over, http::request<http::string_body> question,
      std::chrono::milliseconds to_answer) {
    Stream& stream = *asked_over;
    stream.expires_after(to_answer);
    co_await http::async_write(stream, question, asio::use_awaitable);
    beast::flat_buffer buffer;
    http::response_parser<http::string_body> parser;
    parser.body_limit(kLargestAnswer);
    co_await http::async_read_header(stream, buffer, parser, asio::use_awaitable);
    // The parser's own limit let a stated length pass when it was tried (Boost 1.74).
    if (parser.content_length().value_or(0) > kLargestAnswer)
      throw boost::system::system_error(make_error_code(http::error::body_limit));
    co_await http::async_read(stream, buffer, parser, asio::use_awaitable);
    co_return parser.release();
  }

  const std::string what;
  const std::filesystem::path path;
  const std::atomic<bool>& closing;
  const Limits limits;
  Turns turns;
  asio::io_context context;
  asio::executor_work_guard<asio::io_context::executor_type> work;
  std::thread thread;  // last: uses the rest
};

namespace {

/// Hands what a browser says to the program behind the viewer.
class RelayedSocket final : public SocketHandler {
 public:
  RelayedSocket(asio::io_context& context, std::shared_ptr<Relay> relay)
      : context_(context), relay_(std::move(relay)) {}
  ~RelayedSocket() override {
    asio::post(context_, [relay = relay_] { relay->leave(); });
  }
  RelayedSocket(const RelayedSocket&) = delete;
  RelayedSocket& operator=(const RelayedSocket&) = delete;

  void receive(const SocketMessage& message) override {
    if (!relay_->say(message.is_text, message.bytes))
      throw Refusal(503, "the program behind this page takes less than is sent: try again later");
  }

 private:
  asio::io_context& context_;
  std::shared_ptr<Relay> relay_;
};

}  // namespace

WorkplaceLink::WorkplaceLink(std::string what, std::filesystem::path socket, const std::atomic<bool>& closing,
                             const Limits& limits)
    : state_(std::make_unique<State>(std::move(what), std::move(socket), closing, limits)) {}

WorkplaceLink::~WorkplaceLink() = default;

bool WorkplaceLink::is_answered() const { return knock(state_->path).has_value(); }

Response WorkplaceLink::ask(const Request& request) {
  const Turns::Turn turn(state_->turns, request.session->person());
  const auto stream = std::make_shared<Stream>(state_->connect());
  const State::ClosedAtLast closed(state_->context, [stream] { stream->close(); });
  http::request<http::string_body> question;
  question.method_string({request.method.data(), request.method.size()});
  question.target({request.target.data(), request.target.size()});
  question.version(11);
  question.keep_alive(false);
  put_fields(question, request);
  if (request.method != "GET") {
    question.set(http::field::content_type, beast::string_view(kJson.data(), kJson.size()));
    question.body() = request.body;
    question.prepare_payload();
  }
  try {
    return taken_over(
        state_->what,
        state_->wait(asio::co_spawn(state_->context,
                                    State::exchange(stream, std::move(question), state_->limits.to_answer),
                                    asio::use_future),
                     state_->limits.to_answer, *request.session));
  } catch (const boost::system::system_error& error) {
    if (error.code() == beast::error::timeout)
      throw Refusal(504, "the program behind this page does not answer in time");
    throw Refusal(502, "the program behind this page answered with what is no answer");
  }
}

std::unique_ptr<SocketHandler> WorkplaceLink::open(const Request& request,
                                                   std::shared_ptr<SocketOutput> output) {
  const Turns::Turn turn(state_->turns, request.session->person());
  http::fields fields;
  put_fields(fields, request);
  const auto relay = std::make_shared<Relay>(state_->connect(), std::move(output), state_->limits);
  State::ClosedAtLast closed(state_->context, [relay] { relay->close(); });
  const Relay::Opening opening =
      state_->wait(asio::co_spawn(state_->context, Relay::open(relay, std::move(fields), request.target),
                                  asio::use_future),
                   kToShakeHands + kToShakeHands, *request.session);
  if (opening.status != 0) {
    throw Refusal(opening.status, opening.error.empty()
                                      ? "the program behind this page answered with what is no answer"
                                      : opening.error);
  }
  auto handler = std::make_unique<RelayedSocket>(state_->context, relay);
  closed.keep_open();
  asio::co_spawn(state_->context, Relay::listen(relay), asio::detached);
  asio::co_spawn(state_->context, Relay::talk(relay), asio::detached);
  return handler;
}

}  // namespace kiroku::viewer

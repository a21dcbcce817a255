#include "viewer/server/web_socket.h"

#include <algorithm>
#include <chrono>
#include <cstdint>
#include <deque>
#include <functional>
#include <mutex>
#include <optional>
#include <variant>

#include <boost/asio.hpp>
#include <boost/beast/websocket.hpp>
#include <boost/beast/websocket/ssl.hpp>

namespace kiroku::viewer {
namespace {

namespace asio = boost::asio;
namespace beast = boost::beast;
namespace websocket = beast::websocket;
using boost::system::error_code;

/// What may wait for a slow browser: a live picture of many seconds.
constexpr std::size_t kMostWaitingBytes = 4U << 20;
constexpr std::chrono::seconds kSessionCheck{2};
/// For one message to be taken: a live picture of many seconds.
constexpr std::chrono::seconds kLongestWrite{30};
/// Between the end of a session and that of its connection, where the browser takes nothing.
constexpr std::chrono::seconds kCloseTime{2};
/// A browser is asked for a sign of life after half of it.
constexpr std::chrono::seconds kLongestSilence{30};
constexpr std::chrono::seconds kHandshakeLimit{10};
/// Of a reason (RFC 6455 section 5.5: a control frame has 125 bytes, two are the code).
constexpr std::size_t kLongestReason = 123;

/// The queue of one connection.
class Queue final : public OpenSockets::Output {
 public:
  Queue(asio::any_io_executor executor, std::shared_ptr<asio::steady_timer> wake)
      : executor_(std::move(executor)), wake_(std::move(wake)) {}

  using Message = std::variant<std::string, std::shared_ptr<const Bytes>>;

  bool send_text(std::string text) override { return push(Message(std::move(text))); }
  bool send_bytes(std::shared_ptr<const Bytes> bytes) override { return push(Message(std::move(bytes))); }

  std::optional<Message> pop() {
    const std::lock_guard guard(mutex_);
    if (messages_.empty()) return {};
    Message message = std::move(messages_.front());
    messages_.pop_front();
    waiting_ -= size_of(message);
    if (waiting_ == 0) tell_taken();
    return message;
  }
  /// Why the connection is to be closed, once nothing is queued any more.
  std::optional<std::string> ending() {
    const std::lock_guard guard(mutex_);
    return messages_.empty() ? ending_ : std::nullopt;
  }
  [[nodiscard]] std::size_t waiting() const override {
    const std::lock_guard guard(mutex_);
    return waiting_;
  }
  void when_taken(std::function<void()> action) override {
    const std::lock_guard guard(mutex_);
    taken_.push_back(std::move(action));
    if (closed_ || waiting_ == 0) tell_taken();
  }
  void end(std::string sentence) override {
    const std::lock_guard guard(mutex_);
    if (closed_ || ending_) return;
    ending_ = std::move(sentence);
    asio::post(executor_, [wake = wake_] { wake->cancel(); });
  }
  void close() override {
    const std::lock_guard guard(mutex_);
    closed_ = true;
    messages_.clear();
    waiting_ = 0;
    tell_taken();
    // Who keeps this longer than the server lives must hold nothing of its executor.
    wake_.reset();
    executor_ = {};
  }

 private:
  static std::size_t size_of(const Message& message) {
    if (const auto* text = std::get_if<std::string>(&message)) return text->size();
    return std::get<std::shared_ptr<const Bytes>>(message)->size();
  }
  void tell_taken() {
    for (const auto& action : std::exchange(taken_, {})) action();
  }
  bool push(Message message) {
    const std::lock_guard guard(mutex_);
    if (closed_ || ending_ || waiting_ + size_of(message) > kMostWaitingBytes) return false;
    waiting_ += size_of(message);
    messages_.push_back(std::move(message));
    // Timers belong to the connection's strand.
    asio::post(executor_, [wake = wake_] { wake->cancel(); });
    return true;
  }

  asio::any_io_executor executor_;
  std::shared_ptr<asio::steady_timer> wake_;
  mutable std::mutex mutex_;
  std::deque<Message> messages_;
  std::vector<std::function<void()>> taken_;
  std::optional<std::string> ending_;
  std::size_t waiting_ = 0;
  bool closed_ = false;
};

/// A reason as it fits into a frame, cut between characters.
websocket::reason_string reason_of(std::string_view sentence) {
  if (sentence.size() <= kLongestReason) return {sentence.data(), sentence.size()};
  std::size_t end = kLongestReason;
  while (end > 0 && (static_cast<unsigned char>(sentence[end]) & 0xC0U) == 0x80U) --end;
  return {sentence.data(), end};
}

/// One connection; everything but the queue belongs to its strand.
template <typename Stream>
class Connection {
 public:
  Connection(Stream& stream, const Dispatcher& dispatcher, const Dispatcher::Admission& admission,
             asio::thread_pool& workers, OpenSockets& sockets, const asio::any_io_executor& strand)
      : stream_(stream),
        dispatcher_(dispatcher),
        admission_(admission),
        workers_(workers),
        socket_(stream),
        wake_(std::make_shared<asio::steady_timer>(strand)),
        listener_end_(strand, asio::steady_timer::time_point::max()),
        write_limit_(std::make_shared<asio::steady_timer>(strand)),
        queue_(std::make_shared<Queue>(strand, wake_)) {
    sockets.add(queue_);
  }
  ~Connection() { queue_->close(); }
  Connection(const Connection&) = delete;
  Connection& operator=(const Connection&) = delete;

  /// Why there is no handler, or nothing.
  asio::awaitable<std::optional<Response>> open() {
    co_return co_await on_worker([this] { return dispatcher_.open_socket(admission_, queue_, handler_); });
  }

  /// From accepting to the end; the handler has gone then.
  asio::awaitable<void> serve(const UpgradeRequest& upgrade) {
    // From here on the WebSocket watches its own time.
    beast::get_lowest_layer(stream_).expires_never();
    socket_.set_option(websocket::stream_base::timeout{kHandshakeLimit, kLongestSilence, true});
    // 0 would be no limit.
    socket_.read_message_max(std::max<std::size_t>(1, admission_.route->body_limit));
    socket_.auto_fragment(false);
    error_code failed;
    co_await socket_.async_accept(upgrade, asio::redirect_error(asio::use_awaitable, failed));
    if (!failed) {
      asio::co_spawn(socket_.get_executor(), listen(), [this](const std::exception_ptr& broken) {
        over_ = over_ || broken;
        listener_left_ = true;
        wake_->cancel();
        listener_end_.cancel();
      });
      try {
        co_await talk();
      } catch (const std::exception&) {
        // Out of memory, say.
        beast::get_lowest_layer(stream_).close();
      }
      if (!listener_left_) {
        co_await listener_end_.async_wait(asio::redirect_error(asio::use_awaitable, failed));
      }
    }
    queue_->close();
    co_await on_worker([this] {
      handler_.reset();
      return true;
    });
  }

 private:
  template <typename Work>
  asio::awaitable<std::invoke_result_t<Work&>> on_worker(Work work) {
    const auto task = [&work]() -> asio::awaitable<std::invoke_result_t<Work&>> { co_return work(); };
    co_return co_await asio::co_spawn(workers_.get_executor(), task, asio::use_awaitable);
  }

  /// Hands on what comes, until the browser goes or the handler has had enough.
  asio::awaitable<void> listen() {
    beast::flat_buffer buffer;
    for (;;) {
      error_code failed;
      co_await socket_.async_read(buffer, asio::redirect_error(asio::use_awaitable, failed));
      if (failed) {
        over_ = true;
        break;
      }
      const SocketMessage message{socket_.got_text(),
                                  {static_cast<const std::byte*>(buffer.data().data()), buffer.size()}};
      const std::optional<Dispatcher::Failure> failure =
          co_await on_worker([&] { return dispatcher_.take_message(admission_, *handler_, message); });
      buffer.clear();
      if (failure) {
        farewell_ = {failure->status < 500 ? websocket::close_code::policy_error
                                           : websocket::close_code::internal_error,
                     reason_of(failure->sentence)};
        break;
      }
    }
  }

  /// Sends what is queued, and takes leave where the browser did not.
  asio::awaitable<void> talk() {
    error_code failed;
    while (!failed && !over_ && !farewell_) {
      if (admission_.request.session->has_ended()) {
        farewell_ = {websocket::close_code::policy_error, "the session has ended"};
        break;
      }
      const std::optional<Queue::Message> message = queue_->pop();
      if (!message) {
        if (const std::optional<std::string> why = queue_->ending()) {
          farewell_ = {websocket::close_code::policy_error, reason_of(*why)};
          break;
        }
        // A message cancels the timer; none is lost between pop() and here, since both are on the strand.
        wake_->expires_after(kSessionCheck);
        error_code ignored;
        co_await wake_->async_wait(asio::redirect_error(asio::use_awaitable, ignored));
        continue;
      }
      const auto* text = std::get_if<std::string>(&*message);
      socket_.text(text != nullptr);
      const ByteView bytes =
          text != nullptr ? bytes_of(*text) : ByteView(*std::get<std::shared_ptr<const Bytes>>(*message));
      limit_write(kLongestWrite);
      co_await socket_.async_write(asio::buffer(bytes.data(), bytes.size()),
                                   asio::redirect_error(asio::use_awaitable, failed));
      end_write();
    }
    if (farewell_ && !over_) {
      limit_write(kCloseTime);
      co_await socket_.async_close(*farewell_, asio::redirect_error(asio::use_awaitable, failed));
      end_write();
    }
    // The listener, if it still waits, hears of it by this.
    if (failed) beast::get_lowest_layer(stream_).close();
  }

  /// Cuts the connection where what is being written is not taken in time, or its session ends meanwhile:
  /// signs of life (RFC 6455 section 5.5.3) are none of taking.
  void limit_write(std::chrono::steady_clock::duration left) {
    const auto step = std::min<std::chrono::steady_clock::duration>(left, kSessionCheck);
    write_limit_->expires_after(step);
    write_limit_->async_wait(
        [this, left, step, write = write_, watched = std::weak_ptr(write_limit_)](error_code cancelled) {
          // The timer goes with the connection. It may have rung just as the write was over.
          if (cancelled || watched.expired() || write != write_) return;
          if (left <= step || admission_.request.session->has_ended()) {
            beast::get_lowest_layer(stream_).close();
          } else {
            limit_write(left - step);
          }
        });
  }

  void end_write() {
    ++write_;
    write_limit_->cancel();
  }

  Stream& stream_;
  const Dispatcher& dispatcher_;
  const Dispatcher::Admission& admission_;
  asio::thread_pool& workers_;
  websocket::stream<Stream&, false> socket_;  // nothing is compressed: half of Beast need not be compiled
  std::shared_ptr<asio::steady_timer> wake_;
  asio::steady_timer listener_end_;
  std::shared_ptr<asio::steady_timer> write_limit_;
  std::uint64_t write_ = 0;  // counts them
  std::shared_ptr<Queue> queue_;
  std::unique_ptr<SocketHandler> handler_;
  std::optional<websocket::close_reason> farewell_;
  bool over_ = false, listener_left_ = false;
};

}  // namespace

void OpenSockets::add(const std::shared_ptr<Output>& output) {
  const std::lock_guard guard(mutex_);
  std::erase_if(outputs_, [](const std::weak_ptr<Output>& each) { return each.expired(); });
  outputs_.push_back(output);
}

void OpenSockets::close_all() {
  const std::lock_guard guard(mutex_);
  for (const std::weak_ptr<Output>& each : outputs_) {
    if (const std::shared_ptr<Output> output = each.lock()) output->close();
  }
}

bool is_socket_request(const RequestHead& head) {
  const auto upgrade = head.headers.find("upgrade");
  return upgrade != head.headers.end() && beast::iequals(upgrade->second, "websocket");
}

template <typename Stream>
asio::awaitable<bool> serve_socket(Stream& stream, const UpgradeRequest& upgrade,
                                   const Dispatcher& dispatcher, const Dispatcher::Admission& admission,
                                   asio::thread_pool& workers, OpenSockets& sockets, Response& refusal) {
  Connection<Stream> connection(stream, dispatcher, admission, workers, sockets,
                                co_await asio::this_coro::executor);
  if (std::optional<Response> refused = co_await connection.open()) {
    refusal = std::move(*refused);
    co_return false;
  }
  co_await connection.serve(upgrade);
  co_return true;
}

template asio::awaitable<bool> serve_socket(TlsStream&, const UpgradeRequest&, const Dispatcher&,
                                            const Dispatcher::Admission&, asio::thread_pool&, OpenSockets&,
                                            Response&);
template asio::awaitable<bool> serve_socket(LocalStream&, const UpgradeRequest&, const Dispatcher&,
                                            const Dispatcher::Admission&, asio::thread_pool&, OpenSockets&,
                                            Response&);

}  // namespace kiroku::viewer

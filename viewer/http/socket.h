// WebSockets (RFC 6455) as handlers see them: what goes out, what comes in. Knows nothing of how they are
// sent.
#pragma once

#include <functional>
#include <memory>
#include <string>
#include <string_view>

#include "base/bytes.h"
#include "viewer/http/request.h"

namespace kiroku::viewer {

/// To one browser. Thread-safe; may be kept beyond the connection, which it then does nothing for.
class SocketOutput {
 public:
  virtual ~SocketOutput() = default;
  /// Queues a message and returns at once; false, and nothing is queued, where too much waits already (4 MiB)
  /// or the connection is over.
  virtual bool send_text(std::string text) = 0;
  virtual bool send_bytes(std::shared_ptr<const Bytes> bytes) = 0;
  /// Bytes queued that the connection has not begun to send: 0 when the newest picture may be drawn next.
  [[nodiscard]] virtual std::size_t waiting() const = 0;
  /// Calls `action` once, on any thread, as soon as nothing waits or the connection is over: at once where
  /// that is so already. It must not block, nor use this output.
  virtual void when_taken(std::function<void()> action) = 0;
  /// Closes the connection with 1008 and this sentence once what was queued before has been sent.
  virtual void end(std::string sentence) = 0;
};

/// From one browser: UTF-8 where it is text.
struct SocketMessage {
  bool is_text = false;
  ByteView bytes;  // valid during the call
};

/// What answers one connection; destroyed, on a thread that may block, when it is over.
class SocketHandler {
 public:
  virtual ~SocketHandler() = default;
  /// Called for each message in order, never two at a time, on a thread that may block; the next is not read
  /// before it returns. What it throws closes the connection: with 1008 and the sentence of a Refusal or
  /// another error of this project, else with 1011.
  virtual void receive(const SocketMessage& message) = 0;
};

/// Called for each connection after the route's right was checked, on a thread that may block. Throws as
/// handlers do: then the connection is refused.
using SocketOpener = std::function<std::unique_ptr<SocketHandler>(const Request& request,
                                                                  std::shared_ptr<SocketOutput> output)>;

}  // namespace kiroku::viewer

// From the viewer to one program behind it (viewer/server/inner_door.h): requests and WebSockets of people
// whom the viewer knows. Thread-safe.
//
// Such a program reads CTs and meshes of whatever origin. So what it answers is data and never a page: JSON,
// or a PDF; no field of its answers but the type is taken over.
#pragma once

#include <atomic>
#include <chrono>
#include <cstddef>
#include <filesystem>
#include <memory>
#include <string>
#include <utility>

#include "viewer/http/request.h"
#include "viewer/http/response.h"
#include "viewer/http/socket.h"
#include "viewer/people/turns.h"

namespace kiroku::viewer {

class WorkplaceLink {
 public:
  struct Limits {
    /// Of those who wait for an answer: each holds a thread of the viewer.
    Turns::Limits waiting{.all = 6, .of_person = 2};
    std::chrono::milliseconds to_answer{60'000};
    /// What one browser said and the program has not taken: more ends their connection.
    std::size_t untaken_bytes = 1U << 20, untaken_messages = 4096;
    /// For each of those to be taken.
    std::chrono::milliseconds to_take{5000};
    /// For all of them once the browser has gone.
    std::chrono::milliseconds to_take_last{1000};
  };
  /// `what`: "planning", "breathing", "training". `closing` outlives this; once it is set nobody waits for an
  /// answer.
  WorkplaceLink(std::string what, std::filesystem::path socket, const std::atomic<bool>& closing,
                const Limits& limits);
  WorkplaceLink(std::string what, std::filesystem::path socket, const std::atomic<bool>& closing)
      : WorkplaceLink(std::move(what), std::move(socket), closing, Limits()) {}
  /// Nothing of what it gave out may be used any more.
  ~WorkplaceLink();
  WorkplaceLink(const WorkplaceLink&) = delete;
  WorkplaceLink& operator=(const WorkplaceLink&) = delete;

  /// Whether somebody answers there now.
  [[nodiscard]] bool is_answered() const;
  /// What it answers. Refusal 503 where nobody answers or others, or the same person, wait already, 504 after
  /// a minute, 502 for what is no answer, 401 once the request's session ends: then the question is taken
  /// back.
  Response ask(const Request& request);
  /// The same WebSocket there, joined to `output`, from which it takes the next message once the browser has
  /// taken the one before. What the browser says is queued at once, and sent by another thread: where the
  /// program does not take it, the connection ends. Refusal as above, and its own.
  std::unique_ptr<SocketHandler> open(const Request& request, std::shared_ptr<SocketOutput> output);

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace kiroku::viewer

// From the viewer to one program behind it (viewer/server/inner_door.h): requests and WebSockets of people
// whom the viewer knows. Thread-safe.
//
// Such a program reads CTs and meshes of whatever origin. So what it answers is data and never a page: JSON,
// or a PDF; no field of its answers but the type is taken over.
#pragma once

#include <atomic>
#include <filesystem>
#include <memory>
#include <string>

#include "viewer/http/request.h"
#include "viewer/http/response.h"
#include "viewer/http/socket.h"

namespace kiroku::viewer {

class WorkplaceLink {
 public:
  /// `what`: "planning", "training". `closing` outlives this; once it is set nobody waits for an answer.
  WorkplaceLink(std::string what, std::filesystem::path socket, const std::atomic<bool>& closing);
  /// Nothing of what it gave out may be used any more.
  ~WorkplaceLink();
  WorkplaceLink(const WorkplaceLink&) = delete;
  WorkplaceLink& operator=(const WorkplaceLink&) = delete;

  /// Whether somebody answers there now.
  [[nodiscard]] bool is_answered() const;
  /// What it answers. Refusal 503 where nobody answers or others wait already, 504 after a minute, 502 for
  /// what is no answer.
  Response ask(const Request& request);
  /// The same WebSocket there, joined to `output`, from which it takes the next message once the browser has
  /// taken the one before. Refusal as above, and its own.
  std::unique_ptr<SocketHandler> open(const Request& request, std::shared_ptr<SocketOutput> output);

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace kiroku::viewer

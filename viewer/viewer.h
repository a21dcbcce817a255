// The viewer as a whole: the page and its API on one address (docs/reference/viewer.md).
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <optional>
#include <string>

#include "viewer/api/viewer_context.h"
#include "viewer/http/router.h"
#include "viewer/people/session.h"
#include "viewer/server/web_server.h"

namespace kiroku::viewer {

struct ViewerOptions {
  ViewerHome home;
  /// Where `web.listen` is empty, people come through the inner door of planning_socket, breathing_socket or
  /// training_socket alone.
  WebServerOptions web;
  SessionLimits sessions;
  /// The page's files; nothing: the API alone.
  std::optional<std::filesystem::path> page;
  /// Adds what this program answers beside the API; null: nothing. What it adds must outlive the viewer.
  std::function<void(Router& router, ViewerContext& context)> more_routes = {};
  /// What should stand in the server's own log; called from several threads.
  std::function<void(const std::string& sentence)> tell;
};

/// Serves from construction to destruction.
class Viewer {
 public:
  /// Throws kiroku::UsageError for an address beyond loopback while there is no user, and where options
  /// cannot be used; kiroku::Error where it cannot listen. Where it has an address of its own, that its inner
  /// door cannot be opened is only told.
  explicit Viewer(ViewerOptions options);
  ~Viewer();
  Viewer(const Viewer&) = delete;
  Viewer& operator=(const Viewer&) = delete;

  [[nodiscard]] std::string url() const;  // "https://127.0.0.1:8443/"; "" without an address
  [[nodiscard]] std::uint16_t port() const;
  /// An address that signs in an administrator named `user`, once. The page reads the token from the
  /// fragment, which browsers never send.
  std::string sign_in_url(const std::string& user);

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace kiroku::viewer

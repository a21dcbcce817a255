// Routes before a real server on the loopback address, asked as a page asks: by requests that a dispatcher
// admits, and over WebSockets. One thread.
#pragma once

#include <functional>
#include <memory>
#include <optional>
#include <set>
#include <span>
#include <string>
#include <utility>

#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "tests/support/socket_client.h"
#include "tests/support/temporary_folder.h"
#include "viewer/api/workplaces.h"
#include "viewer/http/server_certificate.h"
#include "viewer/server/web_server.h"

namespace kiroku::test {

class ServedRoutes {
 public:
  /// `add` is called once, with the routes to be added to; what they use must outlive this. Somebody has
  /// signed in.
  ServedRoutes(const std::function<void(viewer::Router&)>& add, const std::string& user, viewer::Role role) {
    add(router_);
    bool made = false;
    viewer::ServerCertificate certificate = viewer::own_certificate(folder_.path(), {"127.0.0.1"}, made);
    viewer::WebServerOptions options;
    options.listen = "127.0.0.1:0";
    options.certificate_pem = std::move(certificate.certificate_pem);
    options.key_pem = std::move(certificate.key_pem);
    server_.emplace(std::move(options), dispatcher_);
    sign_in(user, role);
  }

  /// From now on this user asks.
  void sign_in(const std::string& user, viewer::Role role) { opened_ = sessions_.open(user, role, {}); }
  /// From now on nobody does.
  void sign_out() {
    opened_.session->end();
    sessions_.close(opened_.token);
  }

  viewer::Response ask(const std::string& method, const std::string& path, const std::string& body = "") {
    viewer::RequestHead head{method, "/api/" + path, "192.0.2.7", {{"host", "or-3"}, {"cookie", cookie()}}};
    if (method != "GET") {
      head.headers["x-kiroku-request"] = "1";
      head.headers["content-type"] = "application/json";
    }
    viewer::Dispatcher::Admission admission = dispatcher_.admit(std::move(head));
    if (admission.refusal) return std::move(*admission.refusal);
    admission.request.body = body;
    return dispatcher_.answer(admission);
  }
  nlohmann::json answer(const std::string& method, const std::string& path, const std::string& body = "") {
    return nlohmann::json::parse(std::get<std::string>(ask(method, path, body).body));
  }
  /// A WebSocket; of the server's own page where no other origin is given.
  std::unique_ptr<SocketClient> connect(const std::string& path, const std::string& origin = "") {
    const std::string own = "https://127.0.0.1:" + std::to_string(server_->port());
    return std::make_unique<SocketClient>(server_->port(), "/api/" + path, cookie(),
                                          origin.empty() ? own : origin);
  }

 private:
  [[nodiscard]] std::string cookie() const {
    return std::string(viewer::kSessionCookie) + "=" + opened_.token;
  }

  TemporaryFolder folder_;
  viewer::Router router_;
  viewer::SessionStore sessions_;
  viewer::SessionStore::Opened opened_;
  viewer::StaticFiles page_;
  viewer::Dispatcher dispatcher_{router_, sessions_, page_, [](const std::string& /*sentence*/) {}};
  std::optional<viewer::WebServer> server_;
};

/// Whether a program has the routes to which the viewer leads (viewer/api/workplaces.h), and no other.
inline void expect_to_be(const viewer::Router& router, std::span<const viewer::WorkplaceRoute> led_to) {
  const auto text = [](std::string_view method, std::string_view pattern, viewer::Right right,
                       bool is_socket) {
    return std::string(method) + " " + std::string(pattern) + ": " + std::string(viewer::right_name(right)) +
           (is_socket ? ", a WebSocket" : "");
  };
  std::set<std::string> there, wanted;
  for (const viewer::Route* route : router.routes()) {
    there.insert(text(route->method, route->pattern, route->right, route->socket != nullptr));
    EXPECT_LE(route->body_limit, viewer::kUsualBodyLimit) << route->pattern << ": the viewer takes no more";
  }
  for (const viewer::WorkplaceRoute& route : led_to)
    wanted.insert(text(route.method, route.pattern, route.right, route.is_socket));
  EXPECT_EQ(there, wanted);
}

/// What came over a WebSocket: text as JSON, or a picture's JSON with its size
/// (viewer/http/picture_message.h).
struct Said {
  nlohmann::json text;
  std::size_t jpeg_bytes = 0;  // 0: no picture
};
/// Nothing at the end of the connection.
inline std::optional<Said> next_said(SocketClient& client) {
  const std::optional<SocketClient::Message> message = client.receive();
  if (!message) return {};
  const std::string_view bytes = text_of(message->bytes);
  if (message->is_text) return Said{nlohmann::json::parse(bytes), 0};
  std::size_t head = 0;
  for (std::size_t i = 0; i < 4; ++i) head |= static_cast<std::size_t>(message->bytes[i]) << (8 * i);
  EXPECT_EQ(bytes.substr(4 + head, 2), "\xff\xd8");
  return Said{nlohmann::json::parse(bytes.substr(4, head)), bytes.size() - 4 - head};
}
/// The close code and sentence that the connection ends with, whatever comes before.
inline std::pair<int, std::string> refusal_of(SocketClient& client) {
  while (next_said(client)) {
  }
  return client.farewell();
}

}  // namespace kiroku::test

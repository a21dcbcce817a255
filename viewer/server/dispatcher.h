// From a request's head to its answer: finds the route, who calls, whether they may, and calls the handler.
// Everything about HTTP that needs no connection. Thread-safe.
#pragma once

#include <chrono>
#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <utility>

#include "viewer/http/request.h"
#include "viewer/http/response.h"
#include "viewer/http/router.h"
#include "viewer/http/static_files.h"
#include "viewer/people/session.h"

namespace kiroku::viewer {

/// The name of the session's cookie. With the prefix __Host- browsers accept it over TLS alone, from this
/// very host, for every path (RFC 6265bis section 4.1.3.2).
inline constexpr std::string_view kSessionCookie = "__Host-kiroku";
/// The same of a server of `serves` (ViewerHome): cookies know no port, so servers of one host that used one
/// name would end each other's sessions.
std::string session_cookie(std::string_view serves);

/// Whose request it is, by its head, and null where it is nobody's; may say in it from where it came. Called
/// from several threads at a time.
using WhoCalls = std::function<std::shared_ptr<Session>(Request& request, bool is_activity)>;
/// Whoever has the cookie of a session. `sessions` must outlive it.
WhoCalls whoever_has_cookie(SessionStore& sessions, std::string name);

/// What stands before the body.
struct RequestHead {
  std::string method, target, peer;
  std::map<std::string, std::string, std::less<>> headers;  // as in Request
};

class Dispatcher {
 public:
  /// Hears of what failed inside, one sentence each; called from several threads.
  using Tell = std::function<void(const std::string& sentence)>;
  /// What it is given must outlive it.
  Dispatcher(const Router& router, WhoCalls who_calls, const StaticFiles& page, Tell tell);
  /// Of whoever has the cookie kSessionCookie.
  Dispatcher(const Router& router, SessionStore& sessions, const StaticFiles& page, Tell tell)
      : Dispatcher(router, whoever_has_cookie(sessions, std::string(kSessionCookie)), page, std::move(tell)) {
  }

  /// A request that may go on: its body is read, up to `body_limit` bytes, and answer() called.
  struct Admission {
    std::optional<Response> refusal;  // to be sent at once, without reading a body
    Request request;
    const Route* route = nullptr;  // null: the page's files
    std::size_t body_limit = 0;
  };
  /// What a handler threw: {"error": sentence} with this status.
  struct Failure {
    int status = 500;
    std::string sentence;
    std::chrono::seconds retry_after{0};  // a header of it where it is not zero
  };
  /// Judges a request by its head, so that a stranger's body is never read.
  [[nodiscard]] Admission admit(RequestHead head) const;
  /// May block; never throws but std::bad_alloc. `admission.request.body` is the body. 401 where the session
  /// ended since the head was judged, or before the costly work begins. Where the response has
  /// costly work, `admission` must outlive it; the work gives the answer and throws no more than this.
  [[nodiscard]] Response answer(const Admission& admission) const;
  /// Of a route that is a WebSocket: its handler, or why there is none. May block.
  [[nodiscard]] std::optional<Response> open_socket(const Admission& admission,
                                                    const std::shared_ptr<SocketOutput>& output,
                                                    std::unique_ptr<SocketHandler>& handler) const;
  /// Gives the handler what its browser sent; nothing, or why the connection is to be closed. May block.
  [[nodiscard]] std::optional<Failure> take_message(const Admission& admission, SocketHandler& handler,
                                                    const SocketMessage& message) const;
  /// What the connection itself has to refuse (a header too large, no HTTP): with the headers of every
  /// answer.
  [[nodiscard]] static Response refuse(int status, const std::string& sentence,
                                       std::chrono::seconds retry_after = {});

 private:
  [[nodiscard]] Response finished(const Admission& admission, Response response) const;
  void tell_failures_of(StreamBody& stream, const Admission& admission) const;
  [[nodiscard]] Response call(const Route& route, const Request& request) const;
  /// Calls it; what it throws comes back.
  [[nodiscard]] std::optional<Failure> guarded(const Route& route, const Request& request,
                                               const std::function<void()>& action) const;
  const Router& router_;
  WhoCalls who_calls_;
  const StaticFiles& page_;
  Tell tell_;
};

}  // namespace kiroku::viewer

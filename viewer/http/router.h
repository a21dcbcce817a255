// Which handler answers which address. Filled before the server starts, immutable then; thread-safe then.
//
// A pattern is a path below the root without its first slash, "api/cases/{case:case}/streams/{stream:name}/
// pieces/{piece:number}.mp4". A part in braces is a parameter, {NAME:KIND}; a segment has at most one. Kinds:
//   case     the identifier of a case, "20260805T091502Z-3f9c21ab", or with its appliance, as
//            viewer/http/case_name.h has it
//   name     [a-z0-9][a-z0-9-]{0,31}: streams, rooms, authorities
//   number   decimal below 2^63 without needless zeros
//   text     1 to 128 bytes of UTF-8 without control characters, slashes or backslashes
// What does not fit its kind is no address of ours (404).
#pragma once

#include <functional>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "viewer/http/request.h"
#include "viewer/http/response.h"
#include "viewer/http/role.h"
#include "viewer/http/socket.h"

namespace kiroku::viewer {

/// Answers a request. Called from several threads at a time and may block; a handler owns no thread. What it
/// throws becomes an error: Refusal with its status, UsageError with 400, other errors of this project with
/// 409, IoError and everything else with 500.
using Handler = std::function<Response(const Request& request)>;

/// A body may have so many bytes unless the route says otherwise.
inline constexpr std::size_t kUsualBodyLimit = 64U << 10;

struct Route {
  std::string method;  // "GET", "POST", "DELETE"
  std::string pattern;
  Right right = Right::kSignedIn;
  Handler handler;
  /// Whether a call keeps the session alive. False for what a page asks by itself, again and again.
  bool is_activity = true;
  std::size_t body_limit = kUsualBodyLimit;
  /// For an address that is a WebSocket; `handler` is not called then, and `body_limit` is that of each
  /// message, every one of which is a deed where `is_activity` says so.
  SocketOpener socket = {};
  /// Whether somebody may call it who came by a one-time password and has not chosen their own yet.
  bool before_own_password = false;
  /// Whether it is answered at once, so that it does not wait behind the same person's pictures and files.
  bool is_quick = false;
};

class Router {
 public:
  Router();
  ~Router();
  Router(const Router&) = delete;
  Router& operator=(const Router&) = delete;

  /// Throws std::invalid_argument for a malformed pattern, one that is there already, or a WebSocket for
  /// everybody: Route::right of one is never Right::kNone.
  void add(Route route);
  void add(std::string method, std::string pattern, Right right, Handler handler);
  void add_socket(std::string pattern, Right right, SocketOpener opener);

  struct Match {
    const Route* route = nullptr;  // null: see `allowed`
    std::map<std::string, std::string, std::less<>> parameters;
    std::vector<std::string> allowed;  // methods of the address; none: there is no such address
  };
  [[nodiscard]] Match match(std::string_view method, const std::vector<std::string>& segments) const;
  /// In the order they were added.
  [[nodiscard]] std::vector<const Route*> routes() const;

 private:
  struct Entry;
  std::vector<std::unique_ptr<Entry>> entries_;
};

}  // namespace kiroku::viewer

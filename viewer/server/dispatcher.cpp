#include "viewer/server/dispatcher.h"

#include <algorithm>
#include <array>

#include "base/error.h"
#include "base/joined.h"
#include "viewer/http/http_fields.h"

namespace kiroku::viewer {
namespace {

/// Of every answer. Scripts, styles and everything else come from this server alone; pictures and films also
/// from what the page itself made of them (blob:).
constexpr std::array<std::pair<const char*, const char*>, 9> kSecurityHeaders{{
    {"Content-Security-Policy",
     "default-src 'self'; img-src 'self' blob: data:; media-src 'self' blob:; object-src 'none'; base-uri "
     "'none'; "
     "form-action 'self'; frame-ancestors 'none'"},
    {"Strict-Transport-Security", "max-age=31536000"},
    {"X-Content-Type-Options", "nosniff"},
    {"X-Frame-Options", "DENY"},
    {"Referrer-Policy", "no-referrer"},
    {"Cross-Origin-Opener-Policy", "same-origin"},
    {"Cross-Origin-Resource-Policy", "same-origin"},
    {"Cross-Origin-Embedder-Policy", "require-corp"},
    {"Permissions-Policy",
     "camera=(), microphone=(), geolocation=(), payment=(), usb=(), display-capture=()"},
}};

Response secured(Response response) {
  for (const auto& [name, value] : kSecurityHeaders) response.headers.emplace_back(name, value);
  return response;
}

bool is_api(const std::vector<std::string>& segments) { return !segments.empty() && segments[0] == "api"; }

bool changes_something(std::string_view method) { return method != "GET"; }

/// Why a request cannot have come from this server's own page, or "".
std::string foreign(const Request& request) {
  const std::string_view site = request.header("sec-fetch-site");
  if (!site.empty() && site != "same-origin" && site != "none") return "another site asked for this";
  const std::string_view origin = request.header("origin");
  if (!origin.empty() && origin != "https://" + std::string(request.header("host"))) {
    return "another site asked for this";
  }
  if (!changes_something(request.method)) return "";
  if (request.header("x-kiroku-request") != "1") {
    return "the header X-Kiroku-Request: 1 is missing, which shows that no other site sent this";
  }
  return "";
}

bool is_json(std::string_view type) {
  return type == "application/json" || type.starts_with("application/json;");
}

bool has_body(const Request& request) {
  const std::string_view length = request.header("content-length");
  return !request.header("transfer-encoding").empty() || (!length.empty() && length != "0");
}

/// The number of bytes of a body that has one.
std::optional<std::uint64_t> size_of(const Response& response) {
  if (const auto* text = std::get_if<std::string>(&response.body)) return text->size();
  if (const auto* bytes = std::get_if<BytesBody>(&response.body)) return bytes->size;
  if (const auto* file = std::get_if<FileBody>(&response.body)) return file->size;
  if (const auto* read = std::get_if<ReadBody>(&response.body)) return read->size;
  return {};
}

void cut(Response& response, const ByteRange& range) {
  if (auto* bytes = std::get_if<BytesBody>(&response.body)) {
    bytes->offset += range.first;
    bytes->size = range.size();
  } else if (auto* file = std::get_if<FileBody>(&response.body)) {
    file->offset += range.first;
    file->size = range.size();
  } else if (auto* read = std::get_if<ReadBody>(&response.body)) {
    read->offset += range.first;
    read->size = range.size();
  }
}

/// Conditional requests and ranges (RFC 9110 sections 13 and 14).
Response as_asked(const Request& request, Response response) {
  if (response.status != 200 || request.method != "GET") return response;
  if (!response.entity_tag.empty() &&
      names_entity_tag(request.header("if-none-match"), response.entity_tag)) {
    response.status = 304;
    response.type.clear();
    response.body = std::string();
    return response;
  }
  const std::optional<std::uint64_t> size = size_of(response);
  if (!size || std::holds_alternative<std::string>(response.body)) return response;
  response.headers.emplace_back("Accept-Ranges", "bytes");
  const std::string_view unchanged_since = request.header("if-range");
  if (!unchanged_since.empty() && (response.entity_tag.empty() || unchanged_since != response.entity_tag)) {
    return response;
  }
  const RangeRequest asked = parse_range(request.header("range"), *size);
  if (asked.kind == RangeRequest::Kind::kUnsatisfiable) {
    return Response::error(416, "the range begins after the end")
        .with("Content-Range", "bytes */" + std::to_string(*size));
  }
  if (asked.kind == RangeRequest::Kind::kPart) {
    cut(response, asked.range);
    response.status = 206;
    response.headers.emplace_back("Content-Range", "bytes " + std::to_string(asked.range.first) + "-" +
                                                       std::to_string(asked.range.last) + "/" +
                                                       std::to_string(*size));
  }
  return response;
}

/// Who may act by a request's head may have been removed since: while the body came, or the work waited.
void require_lasting(const Route& route, const Request& request) {
  if (route.right != Right::kNone && request.session->has_ended())
    throw Refusal(401, "the session has ended");
}

Response error_of(const Dispatcher::Failure& failure) {
  Response out = Response::error(failure.status, failure.sentence);
  if (failure.retry_after.count() == 0) return out;
  return std::move(out).with("Retry-After", std::to_string(failure.retry_after.count()));
}

}  // namespace

std::string session_cookie(std::string_view serves) {
  return std::string(kSessionCookie) + (serves == "cases" ? "" : "-" + std::string(serves));
}

WhoCalls whoever_has_cookie(SessionStore& sessions, std::string name) {
  return [&sessions, name = std::move(name)](Request& request, bool is_activity) -> std::shared_ptr<Session> {
    const std::optional<std::string> token = cookie_value(request.header("cookie"), name);
    return token ? sessions.find(*token, is_activity) : nullptr;
  };
}

Dispatcher::Dispatcher(const Router& router, WhoCalls who_calls, const StaticFiles& page, Tell tell)
    : router_(router), who_calls_(std::move(who_calls)), page_(page), tell_(std::move(tell)) {}

Response Dispatcher::refuse(int status, const std::string& sentence, std::chrono::seconds retry_after) {
  return secured(error_of({status, sentence, retry_after}));
}

Dispatcher::Admission Dispatcher::admit(RequestHead head) const {
  Admission out;
  Request& request = out.request;
  request.method = head.method == "HEAD" ? "GET" : std::move(head.method);
  request.target = std::move(head.target);
  request.headers = std::move(head.headers);
  request.peer = std::move(head.peer);
  const auto refused = [&](int status, const std::string& sentence) {
    out.refusal = refuse(status, sentence);
    return std::move(out);
  };

  std::optional<Target> target = parse_target(request.target);
  if (!target) return refused(400, "the address is malformed");
  request.query = std::move(target->query);
  if (request.header("host").empty()) return refused(400, "the header Host is missing");
  if (!is_api(target->segments)) {
    if (request.method != "GET") {
      out.refusal = secured(Response::error(405, "files can only be read").with("Allow", "GET, HEAD"));
    }
    return out;
  }

  Router::Match match = router_.match(request.method, target->segments);
  const bool is_public = match.route != nullptr && match.route->right == Right::kNone;
  request.session = who_calls_(request, match.route != nullptr && match.route->is_activity);
  // Who has not signed in learns nothing, not even which addresses there are.
  if (!is_public && request.session == nullptr) return refused(401, "sign in first");
  if (match.route == nullptr && match.allowed.empty())
    return refused(404, "there is nothing at this address");
  if (match.route == nullptr) {
    out.refusal = secured(Response::error(405, "this address does not know " + request.method)
                              .with("Allow", joined(match.allowed)));
    return out;
  }
  if (const std::string why = foreign(request); !why.empty()) return refused(403, why);
  if (!is_public && !may(request.session->role(), match.route->right)) {
    return refused(403, "the role " + std::string(role_name(request.session->role())) + " may not do this");
  }
  if (!is_public && request.session->must_change_password() && !match.route->before_own_password) {
    return refused(403, "this password was for signing in once: choose your own first");
  }
  if (has_body(request) && !is_json(request.header("content-type"))) {
    return refused(415, "the body must be JSON: Content-Type: application/json");
  }
  request.parameters = std::move(match.parameters);
  out.route = match.route;
  out.body_limit = changes_something(request.method) ? match.route->body_limit : 0;
  return out;
}

std::optional<Dispatcher::Failure> Dispatcher::guarded(const Route& route, const Request& request,
                                                       const std::function<void()>& action) const {
  constexpr const char* kInside = "this failed inside; the server's log says more";
  try {
    action();
    return {};
  } catch (const Refusal& refusal) {
    return Failure{refusal.status(), refusal.what(), refusal.retry_after()};
  } catch (const UsageError& error) {
    return Failure{400, error.what()};
  } catch (const IoError& error) {
    tell_(route.method + " " + route.pattern + ": " + error.what());
    return Failure{500, request.session ? error.what() : kInside};
  } catch (const Error& error) {
    return Failure{409, error.what()};
  } catch (const std::exception& error) {
    tell_(route.method + " " + route.pattern + ": " + error.what());
    return Failure{500, kInside};
  }
}

void Dispatcher::tell_failures_of(StreamBody& stream, const Admission& admission) const {
  stream = [this, more = std::move(stream), what = admission.route->pattern](Bytes& into) {
    try {
      return more(into);
    } catch (const std::exception& error) {
      tell_("GET " + what + ": " + error.what());
      throw;
    }
  };
}

Response Dispatcher::call(const Route& route, const Request& request) const {
  if (route.socket) return Response::error(426, "this address is a WebSocket").with("Upgrade", "websocket");
  Response response;
  const auto failure = guarded(route, request, [&] {
    require_lasting(route, request);
    response = route.handler(request);
  });
  return failure ? error_of(*failure) : std::move(response);
}

std::optional<Response> Dispatcher::open_socket(const Admission& admission,
                                                const std::shared_ptr<SocketOutput>& output,
                                                std::unique_ptr<SocketHandler>& handler) const {
  const auto failure = guarded(*admission.route, admission.request, [&] {
    require_lasting(*admission.route, admission.request);
    handler = admission.route->socket(admission.request, output);
  });
  return failure ? std::optional(refuse(failure->status, failure->sentence, failure->retry_after))
                 : std::nullopt;
}

std::optional<Dispatcher::Failure> Dispatcher::take_message(const Admission& admission,
                                                            SocketHandler& handler,
                                                            const SocketMessage& message) const {
  return guarded(*admission.route, admission.request, [&] {
    if (admission.request.session->has_ended()) throw Refusal(401, "the session has ended");
    if (admission.route->is_activity) SessionStore::note_activity(*admission.request.session);
    handler.receive(message);
  });
}

Response Dispatcher::answer(const Admission& admission) const {
  return finished(admission, admission.route == nullptr ? page_.respond(admission.request)
                                                        : call(*admission.route, admission.request));
}

Response Dispatcher::finished(const Admission& admission, Response response) const {
  if (response.costly) {
    response.costly->work = [this, &admission, work = std::move(response.costly->work)] {
      Response answered;
      const auto failure = guarded(*admission.route, admission.request, [&] {
        require_lasting(*admission.route, admission.request);
        answered = work();
      });
      return finished(admission, failure ? error_of(*failure) : std::move(answered));
    };
    return response;
  }
  // Made while the session ended, pictures or a file reach nobody. A text may be the answer to signing out.
  const Session* const session = admission.request.session.get();
  if (session != nullptr && session->has_ended() && !std::holds_alternative<std::string>(response.body))
    return refuse(401, "the session has ended");
  if (auto* stream = std::get_if<StreamBody>(&response.body)) tell_failures_of(*stream, admission);
  return secured(as_asked(admission.request, std::move(response)));
}

}  // namespace kiroku::viewer

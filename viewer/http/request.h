// What a handler is given: one request, checked as far as the router can. Plain values; one thread at a time.
#pragma once

#include <chrono>
#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include <nlohmann/json_fwd.hpp>

#include "base/error.h"

namespace kiroku::viewer {

class Session;

/// Thrown by handlers: becomes {"error": what()} with this status.
class Refusal : public Error {
 public:
  Refusal(int status, const std::string& sentence, std::chrono::seconds retry_after = {})
      : Error(sentence), status_(status), retry_after_(retry_after) {}
  [[nodiscard]] int status() const { return status_; }
  /// When asking again may help; zero: never said.
  [[nodiscard]] std::chrono::seconds retry_after() const { return retry_after_; }

 private:
  int status_;
  std::chrono::seconds retry_after_;
};

struct Request {
  Request() = default;
  Request(Request&&) = default;
  Request& operator=(Request&&) = default;
  Request(const Request&) = delete;
  Request& operator=(const Request&) = delete;
  /// The body, which may hold a passphrase, is zeroised.
  ~Request();

  std::string method;  // "GET"; HEAD arrives as GET
  std::string target;  // as it was sent
  std::map<std::string, std::string, std::less<>>
      headers;  // names in lower case; repeated ones joined by ", "
  std::vector<std::pair<std::string, std::string>> query;  // decoded
  std::map<std::string, std::string, std::less<>>
      parameters;  // of the route's pattern, checked by their kind
  std::string body;
  std::string peer;  // the caller's address, "192.0.2.7"
  /// Whose request it is: never null, except on routes that ask for Right::kNone.
  std::shared_ptr<Session> session;

  /// "" where it is absent. `name` in lower case.
  [[nodiscard]] std::string_view header(std::string_view name) const;
  /// A parameter the pattern has. Asking for another is a mistake in the handler: std::out_of_range.
  [[nodiscard]] const std::string& parameter(std::string_view name) const;
  [[nodiscard]] std::uint64_t number(std::string_view name) const;  // of a {name:number}
  /// Nothing where it is absent; 400 where it stands twice.
  [[nodiscard]] std::optional<std::string> query_text(std::string_view name) const;
  /// Every value of a field that may stand several times.
  [[nodiscard]] std::vector<std::string> query_texts(std::string_view name) const;
  /// As query_text(), for a decimal integer below 2^63; 400 for anything else.
  [[nodiscard]] std::optional<std::int64_t> query_integer(std::string_view name) const;
  /// The body as a JSON object; 400 where it is none.
  [[nodiscard]] nlohmann::json json() const;
};

}  // namespace kiroku::viewer

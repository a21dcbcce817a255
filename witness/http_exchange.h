// Requests to witnesses and published logs over HTTP, by libcurl. One thread at a time.
#pragma once

#include <chrono>
#include <cstddef>
#include <memory>
#include <string>

namespace kiroku::witness {

struct HttpReply {
  long status = 0;
  std::string body;
};

/// Keeps its connection for the next request. Redirects are not followed, and no proxy is asked. Both throw
/// kiroku::Error, half a sentence without the address, where there is no answer within the time limit, or one
/// of more than `most` bytes.
class HttpExchange {
 public:
  explicit HttpExchange(std::chrono::milliseconds time_limit);
  ~HttpExchange();
  HttpExchange(const HttpExchange&) = delete;
  HttpExchange& operator=(const HttpExchange&) = delete;

  [[nodiscard]] HttpReply get(const std::string& url, std::size_t most) const;
  [[nodiscard]] HttpReply post(const std::string& url, const std::string& body, std::size_t most) const;

 private:
  struct Handle;
  std::unique_ptr<Handle> handle_;
  std::chrono::milliseconds time_limit_;
};

}  // namespace kiroku::witness

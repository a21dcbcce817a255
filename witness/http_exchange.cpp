#include "witness/http_exchange.h"

#include <array>
#include <utility>

#include <curl/curl.h>

#include "base/error.h"

namespace kiroku::witness {
namespace {

struct Received {
  std::string body;
  std::size_t most = 0;
  bool too_large = false;
};

std::size_t receive(char* data, std::size_t size, std::size_t count, void* user) {
  auto& received = *static_cast<Received*>(user);
  if (received.body.size() + size * count > received.most) {
    received.too_large = true;
    return 0;
  }
  received.body.append(data, size * count);
  return size * count;
}

}  // namespace

struct HttpExchange::Handle {
  Handle() {
    static const CURLcode initialised = curl_global_init(CURL_GLOBAL_DEFAULT);
    curl = initialised == CURLE_OK ? curl_easy_init() : nullptr;
    if (curl == nullptr) throw Error("cannot start libcurl");
  }
  ~Handle() { curl_easy_cleanup(curl); }
  Handle(const Handle&) = delete;
  Handle& operator=(const Handle&) = delete;

  template <typename Value>
  void set(CURLoption option, Value value) const {
    if (const CURLcode result = curl_easy_setopt(curl, option, value); result != CURLE_OK)
      throw Error(std::string("cannot be asked: ") + curl_easy_strerror(result));
  }
  /// What both kinds of request have in common; then asks.
  HttpReply ask(const std::string& url, std::size_t most, std::chrono::milliseconds time_limit) const {
    Received received{.body = {}, .most = most};
    std::array<char, CURL_ERROR_SIZE> reason{};
    set(CURLOPT_URL, url.c_str());
    set(CURLOPT_PROTOCOLS_STR, "http,https");
    set(CURLOPT_NOSIGNAL, 1L);
    set(CURLOPT_PROXY, "");
    set(CURLOPT_NOPROXY, "");
    set(CURLOPT_USERAGENT, "kiroku");
    set(CURLOPT_TIMEOUT_MS, static_cast<long>(time_limit.count()));
    set(CURLOPT_WRITEFUNCTION, receive);
    set(CURLOPT_WRITEDATA, &received);
    set(CURLOPT_ERRORBUFFER, reason.data());
    const CURLcode result = curl_easy_perform(curl);
    if (received.too_large) throw Error("answered with more than " + std::to_string(most) + " bytes");
    if (result != CURLE_OK)
      throw Error(std::string("did not answer: ") +
                  (reason[0] != '\0' ? reason.data() : curl_easy_strerror(result)));
    long status = 0;
    curl_easy_getinfo(curl, CURLINFO_RESPONSE_CODE, &status);
    return {status, std::move(received.body)};
  }

  CURL* curl = nullptr;
};

HttpExchange::HttpExchange(std::chrono::milliseconds time_limit)
    : handle_(std::make_unique<Handle>()), time_limit_(time_limit) {}
HttpExchange::~HttpExchange() = default;

HttpReply HttpExchange::get(const std::string& url, std::size_t most) const {
  // What options of the request before pointed to is gone; the connection stays.
  curl_easy_reset(handle_->curl);
  return handle_->ask(url, most, time_limit_);
}

HttpReply HttpExchange::post(const std::string& url, const std::string& body, std::size_t most) const {
  curl_easy_reset(handle_->curl);
  handle_->set(CURLOPT_POSTFIELDSIZE_LARGE, static_cast<curl_off_t>(body.size()));
  handle_->set(CURLOPT_POSTFIELDS, body.c_str());
  return handle_->ask(url, most, time_limit_);
}

}  // namespace kiroku::witness

#include "timestamp/client.h"

#include <algorithm>
#include <array>
#include <cctype>
#include <string_view>

#include <curl/curl.h>

#include "base/ascii.h"
#include "timestamp/token.h"

namespace kiroku::timestamp {
namespace {

constexpr std::size_t kLargestResponse = 1 << 20;
constexpr long kMostRedirects = 3;
constexpr long kHttpOk = 200;
constexpr long kTooManyRequests = 429;
constexpr long kUnavailable = 503;
constexpr std::chrono::seconds kUsualPause{60};
constexpr std::chrono::seconds kLongestPause = std::chrono::hours(24);
constexpr long kFirstRedirect = 300;
constexpr long kLastRedirect = 399;
constexpr std::string_view kReplyType = "application/timestamp-reply";

struct EasyDeleter {
  void operator()(CURL* handle) const { curl_easy_cleanup(handle); }
};
using EasyHandle = std::unique_ptr<CURL, EasyDeleter>;
struct ListDeleter {
  void operator()(curl_slist* list) const { curl_slist_free_all(list); }
};
using HeaderList = std::unique_ptr<curl_slist, ListDeleter>;

/// libcurl's global state, made once and before any handle.
void initialise_curl() {
  static const CURLcode initialised = curl_global_init(CURL_GLOBAL_DEFAULT);
  if (initialised != CURLE_OK) {
    throw AuthorityError(std::string("cannot start libcurl: ") + curl_easy_strerror(initialised));
  }
}

/// "http" or "https".
std::string scheme_of(const std::string& url) {
  std::string scheme = lower_case(std::string_view(url).substr(0, url.find("://")));
  if (url.find("://") == std::string::npos || (scheme != "http" && scheme != "https")) {
    throw UsageError("'" + url +
                     "' is no address of a time-stamping authority: it must start with http:// or https://");
  }
  return scheme;
}

/// The address without user name and password, and without what stands behind the path, which may be a key:
/// for messages, logs and ledgers.
std::string without_credentials(const std::string& whole) {
  const std::size_t query = whole.find_first_of("?#");
  const std::string url = query == std::string::npos ? whole : whole.substr(0, query) + "?***";
  const std::size_t scheme = url.find("://");  // a proxy may be "host:port" alone
  const std::size_t host = scheme == std::string::npos ? 0 : scheme + 3;
  const std::size_t host_end = std::min(url.find_first_of("/?#", host), url.size());
  const std::size_t at = url.substr(0, host_end).rfind('@');
  return at == std::string::npos || at < host ? url : url.substr(0, host) + url.substr(at + 1);
}

std::string in_seconds(std::chrono::milliseconds time) {
  std::string text = std::to_string(time.count() / 1000);
  if (time.count() % 1000 != 0) text += "." + std::to_string(1000 + time.count() % 1000).substr(1);
  return text + " s";
}

/// The media type without parameters.
std::string media_type(const char* content_type) {
  std::string_view type = content_type == nullptr ? std::string_view() : std::string_view(content_type);
  type = type.substr(0, type.find(';'));
  while (!type.empty() && type.back() == ' ') type.remove_suffix(1);
  return lower_case(type);
}

struct Received {
  Bytes body;
  bool too_large = false;
};

std::size_t receive(char* data, std::size_t size, std::size_t count, void* user) {
  auto& received = *static_cast<Received*>(user);
  const std::size_t bytes = size * count;
  if (received.body.size() + bytes > kLargestResponse) {
    received.too_large = true;
    return 0;
  }
  append(received.body, bytes_of({data, bytes}));
  return bytes;
}

class HttpStampSource final : public StampSource {
 public:
  explicit HttpStampSource(AuthorityPath path)
      : path_(std::move(path)),
        scheme_(scheme_of(path_.url)),
        who_("the authority " + without_credentials(path_.url)) {
    initialise_curl();
    handle_.reset(curl_easy_init());
    for (const char* header :
         {"Content-Type: application/timestamp-query", "Accept: application/timestamp-reply", "Expect:"}) {
      curl_slist* extended = curl_slist_append(headers_.get(), header);
      if (extended == nullptr) break;
      static_cast<void>(headers_.release());
      headers_.reset(extended);
    }
    if (!handle_ || !headers_) throw AuthorityError("cannot start libcurl: out of memory");
    configure();
  }

  Bytes ask(ByteView query) override {
    Received received;
    reason_[0] = '\0';
    set(CURLOPT_POSTFIELDSIZE_LARGE, static_cast<curl_off_t>(query.size()));
    set(CURLOPT_POSTFIELDS, text_of(query).data());
    set(CURLOPT_WRITEDATA, &received);
    const CURLcode result = curl_easy_perform(handle_.get());
    if (result != CURLE_OK) throw AuthorityError(failure_text(result, received));
    check_reply();
    if (received.body.empty()) throw AuthorityError(who_ + " answered with nothing");
    answered_ = true;
    return std::move(received.body);
  }
  [[nodiscard]] std::string path() const override { return answered_ ? path_name(path_) : std::string(); }

 private:
  template <typename Value>
  void set(CURLoption option, Value value) {
    if (const CURLcode result = curl_easy_setopt(handle_.get(), option, value); result != CURLE_OK) {
      throw AuthorityError("cannot ask " + who_ + ": " + curl_easy_strerror(result));
    }
  }

  void configure() {
    set(CURLOPT_URL, path_.url.c_str());
    set(CURLOPT_PROTOCOLS_STR, scheme_.c_str());
    set(CURLOPT_REDIR_PROTOCOLS_STR, scheme_.c_str());
    set(CURLOPT_FOLLOWLOCATION, 1L);
    set(CURLOPT_MAXREDIRS, kMostRedirects);
    set(CURLOPT_POSTREDIR, static_cast<long>(CURL_REDIR_POST_ALL));
    set(CURLOPT_POST, 1L);
    set(CURLOPT_HTTPHEADER, headers_.get());
    set(CURLOPT_USERAGENT, "kiroku");
    set(CURLOPT_NOSIGNAL, 1L);
    // An empty proxy, and an empty list of exceptions, keep the environment's settings out.
    set(CURLOPT_PROXY, path_.proxy.c_str());
    set(CURLOPT_NOPROXY, "");
    if (!path_.network_interface.empty()) set(CURLOPT_INTERFACE, path_.network_interface.c_str());
    set(CURLOPT_CONNECTTIMEOUT_MS, static_cast<long>(path_.connect_timeout.count()));
    set(CURLOPT_TIMEOUT_MS, static_cast<long>(path_.total_timeout.count()));
    set(CURLOPT_WRITEFUNCTION, receive);
    set(CURLOPT_ERRORBUFFER, reason_.data());
  }

  [[nodiscard]] std::string failure_text(CURLcode result, const Received& received) const {
    const std::string reason = reason_[0] != '\0' ? reason_.data() : curl_easy_strerror(result);
    if (received.too_large) return who_ + " answered with more than 1 MiB, which is no time-stamp response";
    long status = 0;
    curl_easy_getinfo(handle_.get(), CURLINFO_RESPONSE_CODE, &status);
    if (status >= kFirstRedirect && status <= kLastRedirect) {
      return who_ + " redirects where it may not: " + reason;
    }
    switch (result) {
      case CURLE_OPERATION_TIMEDOUT:
        return who_ + " did not answer in time (" + in_seconds(path_.connect_timeout) + " to connect, " +
               in_seconds(path_.total_timeout) + " in all)";
      case CURLE_INTERFACE_FAILED:
        return who_ + " cannot be asked through the network interface '" + path_.network_interface +
               "': " + reason;
      case CURLE_COULDNT_RESOLVE_PROXY:
      case CURLE_COULDNT_RESOLVE_HOST:
      case CURLE_COULDNT_CONNECT:
        return who_ + " is unreachable: " + reason;
      default:
        return who_ + " could not be asked: " + reason;
    }
  }

  [[nodiscard]] std::optional<std::chrono::seconds> pause(long status) const {
    curl_off_t seconds = 0;  // also where Retry-After is a date
    curl_easy_getinfo(handle_.get(), CURLINFO_RETRY_AFTER, &seconds);
    if (status != kTooManyRequests && (status != kUnavailable || seconds <= 0)) return {};
    return seconds <= 0 ? kUsualPause : std::min(std::chrono::seconds(seconds), kLongestPause);
  }

  void check_reply() {
    long status = 0;
    const char* content_type = nullptr;
    curl_easy_getinfo(handle_.get(), CURLINFO_RESPONSE_CODE, &status);
    curl_easy_getinfo(handle_.get(), CURLINFO_CONTENT_TYPE, &content_type);
    const std::string type = media_type(content_type);
    if (status != kHttpOk) {
      throw AuthorityError(who_ + " answered with HTTP status " + std::to_string(status), pause(status));
    }
    if (type == kReplyType) return;
    const std::string what = type.empty() ? "without a content type" : type;
    throw AuthorityError(who_ + " answered " + what + ", not a time-stamp response" +
                         (type == "text/html" ? ": is there a captive portal or proxy login?" : ""));
  }

  AuthorityPath path_;
  std::string scheme_;
  std::string who_;
  HeaderList headers_;
  std::array<char, CURL_ERROR_SIZE> reason_{};
  bool answered_ = false;
  EasyHandle handle_;  // last: it refers to the members above
};

class SeveralPaths final : public StampSource {
 public:
  explicit SeveralPaths(const std::vector<AuthorityPath>& paths) {
    for (const AuthorityPath& path : paths) ways_.push_back({path_name(path), http_stamp_source(path)});
  }

  Bytes ask(ByteView query) override {
    std::string complaints;
    for (const std::size_t i : order()) {
      const Way& way = ways_[i];
      try {
        Bytes response = way.source->ask(query);
        std::string why;
        if (!parse_response(response, why)) throw AuthorityError("what answered is no authority: " + why);
        latest_ = i;
        return response;
      } catch (const AuthorityError& error) {
        if (error.leave_alone_for()) throw;
        complaints +=
            (complaints.empty() ? "" : "; ") + (ways_.size() == 1 ? "" : way.name + ": ") + error.what();
      }
    }
    throw AuthorityError(complaints);
  }
  [[nodiscard]] std::string path() const override { return latest_ ? ways_[*latest_].name : std::string(); }

 private:
  struct Way {
    std::string name;
    std::unique_ptr<StampSource> source;
  };

  /// The way that led to the latest answer, then the others as they were given.
  [[nodiscard]] std::vector<std::size_t> order() const {
    std::vector<std::size_t> order;
    if (latest_) order.push_back(*latest_);
    for (std::size_t i = 0; i < ways_.size(); ++i) {
      if (i != latest_) order.push_back(i);
    }
    return order;
  }

  std::vector<Way> ways_;
  std::optional<std::size_t> latest_;
};

}  // namespace

std::string path_name(const AuthorityPath& path) {
  std::string name = path.network_interface.empty() ? "" : "over " + path.network_interface;
  if (!path.proxy.empty()) {
    name += (name.empty() ? "" : " ") + ("through the proxy " + without_credentials(path.proxy));
  }
  return name.empty() ? "directly" : name;
}

std::unique_ptr<StampSource> http_stamp_source(AuthorityPath path) {
  return std::make_unique<HttpStampSource>(std::move(path));
}

std::unique_ptr<StampSource> http_stamp_source(const std::vector<AuthorityPath>& paths) {
  if (paths.empty()) throw UsageError("an authority cannot be asked without any path to it");
  return std::make_unique<SeveralPaths>(paths);
}

}  // namespace kiroku::timestamp

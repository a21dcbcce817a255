#include "fleet/object_store.h"

#include <algorithm>
#include <array>
#include <set>
#include <tuple>

#include "base/printable.h"
#include "crypto/encoding.h"
#include "fleet/curl_handles.h"

namespace kiroku::fleet {
namespace {

constexpr std::size_t kLargestAnswer = 1U << 20;
constexpr long kOk = 200, kPartialContent = 206;
constexpr long kBadRequest = 400, kForbidden = 403, kNotFound = 404, kTooLarge = 413, kTooManyRequests = 429,
               kServerError = 500;
/// More folders below one name than any store of recordings has.
constexpr std::size_t kMostFolders = 1'000'000;
constexpr const char* kMetadata = "x-amz-meta-kiroku-sha256";

/// The header lines of a request.
class Headers {
 public:
  void add(const std::string& line) {
    curl_slist* longer = curl_slist_append(list_.get(), line.c_str());
    if (longer == nullptr) throw std::bad_alloc();
    static_cast<void>(list_.release());
    list_.reset(longer);
  }
  [[nodiscard]] curl_slist* get() const { return list_.get(); }

 private:
  CurlList list_;
};

struct Sending {
  const crypto::ByteSource* body = nullptr;
  std::uint64_t offset = 0;
  std::exception_ptr failed;
};

struct Answer {
  long status = 0;
  std::chrono::seconds wait{};  // that the answer asks for
  bool has_whole_header = false;
  AnswerHeaders headers;
  std::string body;
  std::size_t most = kLargestAnswer;
  bool too_large = false;
  CURL* handle = nullptr;
  const std::function<void(ByteView)>* take = nullptr;  // of a success; null: `body`
  std::uint64_t taken = 0;
  std::exception_ptr failed;

  [[nodiscard]] std::string header(const std::string& name) const {
    const auto found = headers.find(name);
    return found == headers.end() ? "" : found->second;
  }
};

std::size_t send_body(char* into, std::size_t size, std::size_t count, void* user) {
  auto& sending = *static_cast<Sending*>(user);
  try {
    const std::size_t sent =
        sending.body->read_at(sending.offset, std::as_writable_bytes(std::span(into, size * count)));
    sending.offset += sent;
    return sent;
  } catch (...) {
    sending.failed = std::current_exception();
    return CURL_READFUNC_ABORT;
  }
}

/// A request that is sent again (on a connection that the store had closed meanwhile) begins with the first
/// byte.
int rewind_body(void* user, curl_off_t offset, int origin) {
  if (origin != SEEK_SET) return CURL_SEEKFUNC_CANTSEEK;
  static_cast<Sending*>(user)->offset = static_cast<std::uint64_t>(offset);
  return CURL_SEEKFUNC_OK;
}

std::size_t receive_body(char* data, std::size_t size, std::size_t count, void* user) {
  auto& answer = *static_cast<Answer*>(user);
  long status = 0;
  if (answer.take != nullptr) curl_easy_getinfo(answer.handle, CURLINFO_RESPONSE_CODE, &status);
  if (status == kOk) {
    answer.taken += size * count;
    answer.too_large = answer.taken > answer.most;
    if (answer.too_large) return 0;
    try {
      (*answer.take)(std::as_bytes(std::span(data, size * count)));
    } catch (...) {
      answer.failed = std::current_exception();
      return 0;
    }
    return size * count;
  }
  if (answer.body.size() + size * count > answer.most) {
    answer.too_large = true;
    return 0;
  }
  answer.body.append(data, size * count);
  return size * count;
}

std::size_t receive_header(char* data, std::size_t size, std::size_t count, void* user) {
  Answer& answer = *static_cast<Answer*>(user);
  const std::string_view line(data, size * count);
  take_header(line, answer.headers);
  answer.has_whole_header = line == "\r\n" || line == "\n";
  return size * count;
}

/// Of a query's value what must not stand there as it is (RFC 3986 2.1).
std::string percent_encoded(std::string_view text) {
  constexpr std::string_view kDigits = "0123456789ABCDEF";
  std::string out;
  for (const char c : text) {
    const bool plain = (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') ||
                       c == '-' || c == '.' || c == '_' || c == '~';
    if (plain) {
      out += c;
    } else {
      const auto byte = static_cast<unsigned char>(c);
      out += {'%', kDigits[byte >> 4U], kDigits[byte & 15U]};
    }
  }
  return out;
}

std::string of_version(const std::string& version) {
  return version.empty() ? "" : "versionId=" + percent_encoded(version);
}

/// What another version is says nothing of the one that was asked for. Some stores name none.
void require_version(const std::string& key, const std::string& asked, const StoredObject& told) {
  if (asked.empty() || told.version.empty() || told.version == asked) return;
  throw Error("the store was asked for version " + printable(asked) + " of " + key +
              ", and tells of version " + printable(told.version) +
              ": nothing it says of versions can be relied on");
}

/// "2036-11-23T15:00:00Z": stores take no fractions.
std::string lock_text(UtcTime time) {
  const std::string text = format_utc(std::chrono::floor<std::chrono::seconds>(time));
  return text.substr(0, std::string_view("2036-11-23T15:00:00").size()) + "Z";
}

}  // namespace

bool StoreError::passes() const {
  return status_ == 0 || status_ == kTooManyRequests || status_ >= kServerError ||
         code_ == "RequestTimeout" || code_ == "SlowDown";
}

bool StoreError::is_of_one_object() const {
  return !passes() && (status_ == kBadRequest || status_ == kTooLarge);
}

bool is_plain_key(std::string_view key) {
  return !key.empty() && key.front() != '/' && std::ranges::all_of(key, [](char c) {
    return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') || c == '.' ||
           c == '_' || c == '/' || c == '-';
  });
}

struct ObjectStore::State {
  struct Ask {
    std::string method;
    std::string key = {}, query = {};
    std::vector<std::string> headers = {};
    const crypto::ByteSource* body = nullptr;
    std::string sha256 = crypto::to_hex(crypto::sha256({}));
    std::size_t most = kLargestAnswer;
    const std::function<void(ByteView)>* take = nullptr;
    std::string range = {};  // "0-1023"
  };

  [[nodiscard]] std::string where() const { return "bucket '" + address.bucket + "' of " + address.endpoint; }

  Answer ask(const Ask& what) {
    static const CURLcode initialised = curl_global_init(CURL_GLOBAL_DEFAULT);
    if (!handle && initialised == CURLE_OK) handle.reset(curl_easy_init());
    if (!handle) throw Error("cannot start libcurl");
    curl_easy_reset(handle.get());  // keeps the connection
    const auto set = [&](CURLoption option, auto value) {
      if (const CURLcode result = curl_easy_setopt(handle.get(), option, value); result != CURLE_OK)
        throw Error("cannot ask " + address.endpoint + ": " + curl_easy_strerror(result));
    };
    Answer answer;
    answer.most = what.most;
    answer.take = what.take;
    answer.handle = handle.get();
    Sending sending{what.body, 0, {}};
    std::array<char, CURL_ERROR_SIZE> reason{};
    const std::string url = address.endpoint + "/" + address.bucket +
                            (what.key.empty() ? "" : "/" + what.key) +
                            (what.query.empty() ? "" : "?" + what.query);
    // libcurl copies both.
    const std::string signing = "aws:amz:" + address.region + ":s3";
    std::string user = credentials.access_key + ":" + std::string(credentials.secret_key.text());
    set(CURLOPT_AWS_SIGV4, signing.c_str());
    set(CURLOPT_USERPWD, user.c_str());
    std::ranges::fill(user, '\0');
    set(CURLOPT_URL, url.c_str());
    set(CURLOPT_PROTOCOLS_STR, "http,https");
    set(CURLOPT_NOSIGNAL, 1L);
    set(CURLOPT_PROXY, "");
    set(CURLOPT_USERAGENT, "kiroku");
    if (!what.range.empty()) set(CURLOPT_RANGE, what.range.c_str());
    if (!address.ca_file.empty()) {
      set(CURLOPT_CAINFO, address.ca_file.c_str());
      // Else the authorities that the machine trusts are believed beside it.
      set(CURLOPT_CAPATH, static_cast<const char*>(nullptr));
    }
    set(CURLOPT_CONNECTTIMEOUT, static_cast<long>(terms.connecting.count()));
    set(CURLOPT_LOW_SPEED_LIMIT, 1L);
    set(CURLOPT_LOW_SPEED_TIME, static_cast<long>(terms.silence.count()));
    set(CURLOPT_WRITEFUNCTION, receive_body);
    set(CURLOPT_WRITEDATA, &answer);
    set(CURLOPT_HEADERFUNCTION, receive_header);
    set(CURLOPT_HEADERDATA, &answer);
    set(CURLOPT_ERRORBUFFER, reason.data());
    Headers headers;
    headers.add("x-amz-content-sha256: " + what.sha256);
    for (const std::string& line : what.headers) headers.add(line);
    if (what.body != nullptr) {
      set(CURLOPT_UPLOAD, 1L);
      set(CURLOPT_READFUNCTION, send_body);
      set(CURLOPT_READDATA, &sending);
      set(CURLOPT_SEEKFUNCTION, rewind_body);
      set(CURLOPT_SEEKDATA, &sending);
      set(CURLOPT_INFILESIZE_LARGE, static_cast<curl_off_t>(what.body->size()));
      if (const std::uint64_t most = terms.bytes_per_second ? terms.bytes_per_second() : 0; most > 0)
        set(CURLOPT_MAX_SEND_SPEED_LARGE, static_cast<curl_off_t>(most));
    } else if (what.method == "HEAD") {
      set(CURLOPT_NOBODY, 1L);
    } else {
      set(CURLOPT_CUSTOMREQUEST, what.method.c_str());
    }
    set(CURLOPT_HTTPHEADER, headers.get());
    const CURLcode result = curl_easy_perform(handle.get());
    if (sending.failed) std::rethrow_exception(sending.failed);
    if (answer.failed) std::rethrow_exception(answer.failed);
    if (answer.too_large)
      throw Error("the answer of " + address.endpoint + " is longer than " + std::to_string(what.most) +
                  " bytes");
    if (result != CURLE_OK) {
      throw StoreError("the store at " + address.endpoint + " does not answer: " +
                           (reason[0] != '\0' ? reason.data() : curl_easy_strerror(result)),
                       0, "");
    }
    // libcurl takes a header that was cut off for one that ends there. What is missing would be taken for
    // what the store does not say: that an object has no lock, or no hash.
    if (!answer.has_whole_header)
      throw StoreError("the store at " + address.endpoint + " does not answer: its answer was cut off", 0,
                       "");
    told_time = time_of_answer(answer.headers);
    curl_easy_getinfo(handle.get(), CURLINFO_RESPONSE_CODE, &answer.status);
    curl_off_t wait = 0;
    if (curl_easy_getinfo(handle.get(), CURLINFO_RETRY_AFTER, &wait) == CURLE_OK && wait > 0)
      answer.wait = std::chrono::seconds(
          std::min<curl_off_t>(wait, StoreError::kLongestAskedWait / std::chrono::seconds(1)));
    return answer;
  }

  /// Puts `text` as a property of a version; `doing` completes "cannot …".
  void set_of_version(const std::string& key, const std::string& version, const std::string& property,
                      const std::string& text, const std::string& doing) {
    const crypto::Sha256Digest hash = crypto::sha256(bytes_of(text));
    const auto body = crypto::memory_source(bytes_of(text));
    const Answer answer =
        ask({.method = "PUT",
             .key = key,
             .query = property + "=&" + of_version(version),
             .headers = {"x-amz-sdk-checksum-algorithm: SHA256",
                         "x-amz-checksum-sha256: " + crypto::to_base64(hash, crypto::Base64Padding::kPadded)},
             .body = body.get(),
             .sha256 = crypto::to_hex(hash)});
    if (answer.status != kOk) throw refusal(answer, doing);
  }

  /// What an answer that is no success means to who runs the appliance.
  [[nodiscard]] StoreError refusal(const Answer& answer, const std::string& doing) const {
    const std::string code = error_code_of(answer.body);
    const auto is = [&](std::string_view name) { return code == name; };
    std::string why;
    if (is("NoSuchBucket")) {
      why = "there is no such bucket: have the store's administrator make it, with Object Lock";
    } else if (is("InvalidAccessKeyId")) {
      why = "the store does not know the access key '" + printable(credentials.access_key) + "'";
    } else if (is("SignatureDoesNotMatch")) {
      why = "the secret key is not the one of access key '" + printable(credentials.access_key) +
            "', or the store's region is not '" + address.region + "'";
    } else if (is("ExpiredToken") || is("UserSuspended")) {
      why = "access key '" + printable(credentials.access_key) +
            "' has expired or was suspended: have the store's administrator renew it";
    } else if (is("RequestTimeTooSkewed")) {
      why = "this machine's clock and the store's differ by more than the store accepts: set the clock";
    } else if (is("AccessDenied") || (code.empty() && answer.status == kForbidden)) {
      why = "access key '" + printable(credentials.access_key) + "' has no right to do this";
    } else if (is("InvalidBucketState") || is("InvalidRequest")) {
      why = "the bucket takes no locks: it must be made with Object Lock";
    } else if (is("PermanentRedirect") || is("AuthorizationHeaderMalformed")) {
      why = "the bucket is in another region than '" + address.region + "'";
    } else {
      why = "it answered with status " + std::to_string(answer.status) +
            (code.empty() ? "" : ", " + printable(code));
    }
    return {"cannot " + doing + " in " + where() + ": " + why, answer.status, code, answer.wait};
  }

  const StoreAddress address;
  const StoreCredentials credentials;
  const StoreTerms terms;
  CurlHandle handle;
  std::optional<UtcTime> told_time = {};
};

ObjectStore::ObjectStore(StoreAddress address, StoreCredentials credentials, StoreTerms terms)
    : state_(new State{std::move(address), std::move(credentials), terms, {}}) {
  const StoreAddress& asked = state_->address;
  const bool is_http = asked.endpoint.starts_with("http://") || asked.endpoint.starts_with("https://");
  const std::size_t host = asked.endpoint.find("//") + 2;
  if (!is_http || asked.endpoint.size() <= host ||
      asked.endpoint.find_first_of("/?#@ ", host) != std::string::npos) {
    throw UsageError("the store's endpoint is '" + printable(asked.endpoint) +
                     "': write https://HOST or https://HOST:PORT, without a path");
  }
  const auto fits = [](char c) {
    return (c >= 'a' && c <= 'z') || (c >= '0' && c <= '9') || c == '.' || c == '-';
  };
  if (asked.bucket.size() < 3 || asked.bucket.size() > 63 || !std::ranges::all_of(asked.bucket, fits)) {
    throw UsageError("the store's bucket is '" + printable(asked.bucket) +
                     "': a bucket's name has 3 to 63 small letters, digits, points and hyphens");
  }
  if (asked.region.empty() || !std::ranges::all_of(asked.region, fits))
    throw UsageError("the store's region is '" + printable(asked.region) + "', which is none");
}

ObjectStore::ObjectStore(ObjectStore&& other) noexcept = default;
ObjectStore::~ObjectStore() = default;

const StoreAddress& ObjectStore::address() const { return state_->address; }

std::optional<UtcTime> ObjectStore::told_time() const { return state_->told_time; }

void ObjectStore::require_lockable() {
  const Answer answer = state_->ask({.method = "GET", .query = "object-lock="});
  if (answer.status == 200 && answer.body.find("<ObjectLockEnabled>Enabled<") != std::string::npos) return;
  const std::string code = error_code_of(answer.body);
  if (answer.status == 200 || code == "ObjectLockConfigurationNotFoundError") {
    throw StoreError(
        state_->where() + " has no Object Lock, so what is in it can be removed: it must be made with it",
        answer.status, code);
  }
  throw state_->refusal(answer, "look at the locks");
}

std::string ObjectStore::put(const std::string& key, const crypto::ByteSource& body,
                             const crypto::Sha256Digest& sha256, const PutLock& lock) {
  if (!is_plain_key(key)) {
    throw Error(
        "'" + printable(key) +
        "' cannot be the name of an object: stores take letters, digits, points, hyphens and underlines "
        "alike");
  }
  const std::string hash = crypto::to_hex(sha256);
  std::vector<std::string> headers{std::string(kMetadata) + ": " + hash};
  if (lock.ends) {
    headers.emplace_back("x-amz-object-lock-mode: COMPLIANCE");
    headers.push_back("x-amz-object-lock-retain-until-date: " + lock_text(*lock.ends));
  }
  if (lock.legal_hold) headers.emplace_back("x-amz-object-lock-legal-hold: ON");
  const Answer answer = state_->ask(
      {.method = "PUT", .key = key, .headers = std::move(headers), .body = &body, .sha256 = hash});
  if (answer.status != 200) throw state_->refusal(answer, "put " + key);
  std::string version = answer.header("x-amz-version-id");
  if (version.empty()) {
    throw StoreError(state_->where() +
                         " keeps no versions, so what is in it can be overwritten: it must be made with "
                         "Object Lock",
                     answer.status, "");
  }
  return version;
}

std::optional<StoredObject> ObjectStore::look(const std::string& key, const std::string& version) {
  const Answer answer = state_->ask({.method = "HEAD", .key = key, .query = of_version(version)});
  if (answer.status == kNotFound) return {};
  if (answer.status != 200) throw state_->refusal(answer, "look at " + key);
  StoredObject object = object_of(key, answer.headers);
  require_version(key, version, object);
  return object;
}

void ObjectStore::for_each_page(const std::string& prefix, const std::string& after, bool by_folders,
                                const std::function<bool(const VersionPage&)>& visit) {
  constexpr std::size_t kLargestPage = 8U << 20;
  std::string next_key = after, next_version;
  for (bool more = true; more;) {
    // In the order of their names, as they are signed.
    const std::string query =
        std::string(by_folders ? "delimiter=%2F&" : "") +
        (next_key.empty() ? "" : "key-marker=" + percent_encoded(next_key) + "&") +
        "prefix=" + percent_encoded(prefix) +
        (next_version.empty() ? "" : "&version-id-marker=" + percent_encoded(next_version)) + "&versions=";
    const Answer answer = state_->ask({.method = "GET", .query = query, .most = kLargestPage});
    if (answer.status != 200) throw state_->refusal(answer, "list what begins with " + prefix);
    const VersionPage page = version_page_of(answer.body);
    // Keys are listed in their order, so a list that goes back would never end.
    if (page.more && (page.next_key < next_key ||
                      std::tie(page.next_key, page.next_version) == std::tie(next_key, next_version)))
      throw Error("the store's list of versions goes on with what it told before");
    more = visit(page) && page.more;
    next_key = page.next_key;
    next_version = page.next_version;
  }
}

void ObjectStore::for_each_version(const std::string& prefix,
                                   const std::function<void(const ListedVersion&)>& visit) {
  for_each_version_after(prefix, "", [&](const ListedVersion& each) {
    visit(each);
    return true;
  });
}

void ObjectStore::for_each_version_after(const std::string& prefix, const std::string& key,
                                         const std::function<bool(const ListedVersion&)>& visit) {
  for_each_page(prefix, key, false, [&](const VersionPage& page) {
    for (const ListedVersion& each : page.versions) {
      if (!each.key.starts_with(prefix))
        throw Error("the store lists '" + printable(each.key) + "' among what begins with " + prefix);
      // Ceph begins with the key of the marker itself where that names no version.
      if (!key.empty() && each.key == key) continue;
      if (!visit(each)) return false;
    }
    return true;
  });
}

std::vector<ListedVersion> versions_to_try(std::vector<ListedVersion> versions) {
  if (versions.size() <= kMostVersionsTried) return versions;
  constexpr std::ptrdiff_t kHalf = kMostVersionsTried / 2;
  versions.erase(versions.begin() + kHalf, versions.end() - kHalf);
  return versions;
}

std::vector<std::string> ObjectStore::folders(const std::string& prefix) {
  std::set<std::string> found;
  for_each_page(prefix, "", true, [&](const VersionPage& page) {
    for (const std::string& each : page.folders) {
      if (each.size() > prefix.size() + 1 && each.starts_with(prefix) && each.ends_with('/'))
        found.insert(each.substr(prefix.size(), each.size() - prefix.size() - 1));
    }
    if (found.size() > kMostFolders) {
      throw Error("the store lists more than " + std::to_string(kMostFolders) + " names below '" + prefix +
                  "': it makes them up, or something else's objects lie there");
    }
    return true;
  });
  return {found.begin(), found.end()};
}

void ObjectStore::set_legal_hold(const std::string& key, const std::string& version, bool on) {
  state_->set_of_version(
      key, version, "legal-hold",
      std::string("<LegalHold xmlns=\"http://s3.amazonaws.com/doc/2006-03-01/\"><Status>") +
          (on ? "ON" : "OFF") + "</Status></LegalHold>",
      std::string(on ? "set" : "lift") + " the legal hold of " + key);
}

void ObjectStore::set_retention(const std::string& key, const std::string& version, UtcTime ends) {
  state_->set_of_version(
      key, version, "retention",
      "<Retention xmlns=\"http://s3.amazonaws.com/doc/2006-03-01/\"><Mode>COMPLIANCE</Mode>"
      "<RetainUntilDate>" +
          lock_text(ends) + "</RetainUntilDate></Retention>",
      "lock " + key);
}

Bytes ObjectStore::get(const std::string& key, const std::string& version, std::size_t most) {
  const Answer answer = state_->ask(
      {.method = "GET", .key = key, .query = of_version(version), .most = std::max(most, kLargestAnswer)});
  if (answer.status != 200) throw state_->refusal(answer, "get " + key);
  if (answer.body.size() > most) throw Error(key + " is longer than " + std::to_string(most) + " bytes");
  return to_bytes(answer.body);
}

StoredObject ObjectStore::get(const std::string& key, const std::string& version, std::uint64_t most,
                              const std::function<void(ByteView)>& take) {
  const Answer answer =
      state_->ask({.method = "GET", .key = key, .query = of_version(version), .most = most, .take = &take});
  if (answer.status != kOk) throw state_->refusal(answer, "get " + key);
  StoredObject object = object_of(key, answer.headers);
  require_version(key, version, object);
  return object;
}

Bytes ObjectStore::get_range(const std::string& key, const std::string& version, std::uint64_t offset,
                             std::size_t size) {
  if (size == 0) return {};
  const Answer answer =
      state_->ask({.method = "GET",
                   .key = key,
                   .query = of_version(version),
                   .most = std::max(size, kLargestAnswer),
                   .range = std::to_string(offset) + "-" + std::to_string(offset + size - 1)});
  if (answer.status >= kBadRequest) throw state_->refusal(answer, "get a part of " + key);
  if (answer.status != kPartialContent || answer.body.size() > size) {
    throw Error("of " + key + " the store at " + state_->address.endpoint + " sent " +
                std::to_string(answer.body.size()) + " bytes with status " + std::to_string(answer.status) +
                " where " + std::to_string(size) + " from byte " + std::to_string(offset) +
                " on were asked for: it must send ranges");
  }
  return to_bytes(answer.body);
}

bool ObjectStore::remove(const std::string& key, const std::string& version) {
  const Answer answer = state_->ask({.method = "DELETE", .key = key, .query = of_version(version)});
  if (answer.status >= kServerError) throw state_->refusal(answer, "remove " + key);
  return answer.status < 300;
}

}  // namespace kiroku::fleet

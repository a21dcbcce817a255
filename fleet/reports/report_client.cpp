#include "fleet/reports/report_client.h"

#include <array>
#include <cerrno>
#include <fcntl.h>
#include <sys/file.h>
#include <sys/stat.h>

#include <nlohmann/json.hpp>

#include "base/foreign_json.h"
#include "base/printable.h"
#include "fleet/curl_handles.h"
#include "fleet/reports/fleet_authority.h"
#include "timestamp/small_files.h"

namespace kiroku::fleet {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;

constexpr std::size_t kLargestAnswer = 64U << 10;
constexpr long kConnecting_ms = 5'000, kAll_ms = 15'000;
constexpr long kOk = 200, kAccepted = 202;
constexpr mode_t kOwnerOnly = 0600, kGroupAndOthers = 0077;

struct Server {
  std::string host, port;  // an IPv6 address has its brackets
};

/// "" where the address has no such part.
std::string part_of(CURLU* address, CURLUPart part, unsigned flags = 0) {
  char* text = nullptr;
  if (curl_url_get(address, part, &text, flags) != CURLUE_OK) return {};
  std::string out = text;
  curl_free(text);
  return out;
}

Server server_of(const std::string& url) {
  const CurlAddress address(curl_url());
  const bool is_read = address && curl_url_set(address.get(), CURLUPART_URL, url.c_str(), 0) == CURLUE_OK;
  const std::string path = is_read ? part_of(address.get(), CURLUPART_PATH) : "";
  const bool fits = is_read && part_of(address.get(), CURLUPART_SCHEME) == "https" &&
                    (path.empty() || path == "/") && part_of(address.get(), CURLUPART_USER).empty() &&
                    part_of(address.get(), CURLUPART_QUERY).empty();
  if (!fits) {
    throw UsageError("'" + printable(url) +
                     "' is no address of a report server: it reads https://fleet.hospital.example:8444, as "
                     "'kiroku-fleet serve' tells it");
  }
  return {part_of(address.get(), CURLUPART_HOST), part_of(address.get(), CURLUPART_PORT, CURLU_DEFAULT_PORT)};
}

struct Answer {
  std::string body;
  bool too_large = false;
};

std::size_t receive(char* data, std::size_t size, std::size_t count, void* user) {
  auto& answer = *static_cast<Answer*>(user);
  answer.too_large = answer.body.size() + size * count > kLargestAnswer;
  if (answer.too_large) return 0;
  answer.body.append(data, size * count);
  return size * count;
}

/// The server's own sentence, or what its status says.
std::string sentence_of(const Answer& answer, long status) {
  const json told = parse_foreign_json(answer.body);
  if (told.is_object() && told.contains("error") && told["error"].is_string())
    return printable(told["error"].get<std::string>());
  return "HTTP status " + std::to_string(status) + ", which no report server of Kiroku answers so";
}

}  // namespace

std::optional<ReportingIdentity> ReportingIdentity::read(const fs::path& file) {
  struct stat about {};
  if (::stat(file.c_str(), &about) != 0) return {};
  if ((about.st_mode & kGroupAndOthers) != 0)
    throw UsageError(
        file.string() +
        " is open to others than its owner: revoke this appliance ('kiroku-fleet revoke'), remove the "
        "file, and enrol anew");
  Bytes bytes = timestamp::read_small_file(file);
  const json told = parse_foreign_json(text_of(bytes));
  crypto::zeroise(bytes);
  const auto text = [&](const char* name) {
    if (!told.is_object() || !told.contains(name) || !told[name].is_string())
      throw UsageError(file.string() + " is not what 'kiroku fleet enrol' wrote: remove it, and enrol anew");
    return told[name].get<std::string>();
  };
  ReportingIdentity identity{text("url"), text("appliance"), text("certificate"), text("authority"), {}};
  std::string key = text("key");
  identity.key_pem = crypto::Secret::copy_of(key);
  crypto::zeroise(std::as_writable_bytes(std::span(key)));
  return identity;
}

void ReportingIdentity::write(const fs::path& file) const {
  std::string text = nlohmann::ordered_json{{"url", url},
                                            {"appliance", appliance},
                                            {"certificate", certificate_pem},
                                            {"authority", authority_pem},
                                            {"key", key_pem.text()}}
                         .dump(1) +
                     "\n";
  timestamp::replace_file(file, bytes_of(text), kOwnerOnly);
  crypto::zeroise(std::as_writable_bytes(std::span(text)));
}

std::optional<ReportingTurn> ReportingTurn::take(const fs::path& file) {
  // The folder's own lock: a file for it would be root's where root renewed first.
  const fs::path home = fs::absolute(file).parent_path();
  Descriptor folder(::open(home.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC));
  if (!folder) throw IoError("open", home, errno);
  int status = 0;
  do {
    status = ::flock(folder.number(), LOCK_EX | LOCK_NB);
  } while (status != 0 && errno == EINTR);
  if (status != 0 && errno == EWOULDBLOCK) return {};
  if (status != 0) throw IoError("lock", home, errno);
  return ReportingTurn(std::move(folder));
}

struct ReportClient::State {
  std::string url;
  Server server;
  std::string certificate, authority;
  crypto::Secret key;
  bool has_identity = false;
  long status = 0;
  std::array<char, CURL_ERROR_SIZE> reason{};
  CurlHandle handle = {};  // last: it refers to the members above

  explicit State(const std::string& address) : url(address), server(server_of(address)) {}

  template <typename Value>
  void set(CURLoption option, Value value) {
    if (const CURLcode result = curl_easy_setopt(handle.get(), option, value); result != CURLE_OK)
      throw ReportError("cannot speak to " + url + ": " + curl_easy_strerror(result), 0);
  }
  void set_blob(CURLoption option, std::string_view pem) {
    curl_blob blob{const_cast<char*>(pem.data()), pem.size(), CURL_BLOB_NOCOPY};
    set(option, &blob);
  }

  std::string ask(const std::string& path, const std::string* body) {
    static const CURLcode initialised = curl_global_init(CURL_GLOBAL_DEFAULT);
    if (!handle && initialised == CURLE_OK) handle.reset(curl_easy_init());
    if (!handle) throw ReportError("cannot start libcurl", 0);
    curl_easy_reset(handle.get());  // keeps the connection
    reason[0] = '\0';
    // The certificate is of one name, whatever the address.
    const std::string name = std::string(kReportServerName) + ":" + server.port;
    const CurlList way(curl_slist_append(nullptr, (name + ":" + server.host + ":" + server.port).c_str()));
    CurlList fields(curl_slist_append(nullptr, "Content-Type: application/json"));
    if (!way || !fields) throw std::bad_alloc();
    set(CURLOPT_CONNECT_TO, way.get());
    set(CURLOPT_URL, ("https://" + name + path).c_str());
    set(CURLOPT_PROTOCOLS_STR, "https");
    set(CURLOPT_HTTPHEADER, fields.get());
    set(CURLOPT_USERAGENT, "kiroku");
    set(CURLOPT_NOSIGNAL, 1L);
    // An empty proxy, and an empty list of exceptions, keep the environment's settings out.
    set(CURLOPT_PROXY, "");
    set(CURLOPT_NOPROXY, "");
    set(CURLOPT_SSLVERSION, static_cast<long>(CURL_SSLVERSION_TLSv1_2));
    set(CURLOPT_CONNECTTIMEOUT_MS, kConnecting_ms);
    set(CURLOPT_TIMEOUT_MS, kAll_ms);
    set(CURLOPT_ERRORBUFFER, reason.data());
    if (has_identity) {
      set_blob(CURLOPT_CAINFO_BLOB, authority);
      // Else the authorities that the machine trusts are believed beside it.
      set(CURLOPT_CAPATH, static_cast<const char*>(nullptr));
      set_blob(CURLOPT_SSLCERT_BLOB, certificate);
      set_blob(CURLOPT_SSLKEY_BLOB, key.text());
    } else {
      set(CURLOPT_SSL_VERIFYPEER, 0L);
      set(CURLOPT_SSL_VERIFYHOST, 0L);
    }
    if (body != nullptr) {
      set(CURLOPT_POST, 1L);
      set(CURLOPT_POSTFIELDSIZE_LARGE, static_cast<curl_off_t>(body->size()));
      set(CURLOPT_POSTFIELDS, body->data());
    }
    Answer answer;
    set(CURLOPT_WRITEFUNCTION, receive);
    set(CURLOPT_WRITEDATA, &answer);
    const CURLcode result = curl_easy_perform(handle.get());
    status = 0;
    if (result != CURLE_OK) throw ReportError(failure(result, answer), 0);
    curl_easy_getinfo(handle.get(), CURLINFO_RESPONSE_CODE, &status);
    if (status != kOk && status != kAccepted)
      throw ReportError(url + " does not take it: " + sentence_of(answer, status), status);
    return std::move(answer.body);
  }

  [[nodiscard]] std::string failure(CURLcode result, const Answer& answer) const {
    const std::string why = reason[0] != '\0' ? reason.data() : curl_easy_strerror(result);
    if (answer.too_large) return url + " answers with more than any report server of Kiroku";
    if (result == CURLE_PEER_FAILED_VERIFICATION) {
      return "whoever answers at " + url +
             " is not the fleet that this appliance was enrolled with, or this appliance's clock is years "
             "off (" +
             printable(why) + "): it was told nothing";
    }
    return "cannot reach " + url + ": " + printable(why);
  }
};

ReportClient::ReportClient(const std::string& url) : state_(std::make_unique<State>(url)) {}
ReportClient::ReportClient(const ReportingIdentity& identity)
    : state_(std::make_unique<State>(identity.url)) {
  state_->certificate = identity.certificate_pem;
  state_->authority = identity.authority_pem;
  state_->key = identity.key_pem.clone();
  state_->has_identity = true;
}
ReportClient::~ReportClient() = default;
std::string ReportClient::post(const std::string& path, const std::string& json) {
  return state_->ask(path, &json);
}
std::string ReportClient::get(const std::string& path) { return state_->ask(path, nullptr); }
long ReportClient::status() const { return state_->status; }

}  // namespace kiroku::fleet

// What a handler answers. Knows nothing of how it is sent. Plain values; one thread at a time.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include <nlohmann/json_fwd.hpp>

#include "base/bytes.h"
#include "http/message.h"

namespace kiroku::viewer {

using http::BytesBody;
using http::FileBody;
using http::ReadBody;
using http::StreamBody;

struct Response;

/// What is still to be done before there is an answer, and costs much (hashing a password). It is done by
/// threads of its own (viewer/server/costly_work.h), so that no other request waits behind it.
struct CostlyAnswer {
  std::function<Response()> work;  // called once at most; throws as a handler does
  bool goes_first = false;
  std::string who;  // of whom only a few wait at a time
};

struct Response {
  int status = 200;
  std::string type;  // Content-Type; none where it is empty
  std::vector<std::pair<std::string, std::string>> headers;
  /// Cache-Control. Nothing of a patient may lie in a browser's cache.
  std::string cache = "no-store";
  /// A strong entity tag with its quotes, or none. With one, If-None-Match is answered by the server.
  std::string entity_tag;
  http::Body body;
  /// Where it is there, this is no answer yet, and nothing else of it counts.
  std::optional<CostlyAnswer> costly;

  static Response json(const nlohmann::ordered_json& object, int status = 200);
  static Response error(int status, const std::string& sentence);  // {"error": sentence}
  static Response nothing();                                       // 204
  static Response text(std::string body, std::string type);
  /// Ranges of these, of files and of what is read are answered by the server (206, 416).
  static Response bytes(std::shared_ptr<const Bytes> body, std::string type);
  static Response bytes(Bytes body, std::string type);
  static Response file(FileBody body, std::string type);
  static Response read(ReadBody body, std::string type);
  static Response stream(StreamBody body, std::string type);
  static Response later(CostlyAnswer costly);

  /// Adds a header and returns itself.
  Response with(std::string name, std::string value) &&;
  /// As a file to be kept rather than shown; `name` is plain ASCII.
  Response as_download(std::string_view name) &&;
};

}  // namespace kiroku::viewer

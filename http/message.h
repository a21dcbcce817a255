// What is asked of a server and what it answers, apart from how both travel. Plain values; one thread at a
// time.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <variant>
#include <vector>

#include "base/bytes.h"
#include "base/descriptor.h"

namespace kiroku::http {

/// Names and values, in the order in which they are sent.
using Fields = std::vector<std::pair<std::string, std::string>>;

/// Part of some bytes in memory.
struct BytesBody {
  std::shared_ptr<const Bytes> bytes;
  std::uint64_t offset = 0, size = 0;
};
/// Part of an open file.
struct FileBody {
  std::shared_ptr<const Descriptor> file;
  std::uint64_t offset = 0, size = 0;
};
/// Part of something that is read as the client takes it: `read` fills all of `into` with what lies from
/// `offset` on, called by one thread at a time. What it throws cuts the connection.
struct ReadBody {
  std::function<void(std::uint64_t offset, std::span<std::byte> into)> read;
  std::uint64_t offset = 0, size = 0;
};
/// A body whose size is not known before, sent in chunks: called by one thread at a time, each time the
/// client has taken what came before. Puts more into the empty `into` and returns true, or returns false at
/// the end. What it throws cuts the connection, so that the client knows that something is missing.
using StreamBody = std::function<bool(Bytes& into)>;
using Body = std::variant<std::string, BytesBody, FileBody, ReadBody, StreamBody>;

/// A whole request. Its body ends in one way only (http/http_head.h).
struct Request {
  std::string method, target;
  Fields fields;
  std::string body;
  std::string holder;  // who asks, as connections are counted (base/network_address.h)
  /// DER of the certificate by which the client showed who it is, judged by the server's authority for
  /// clients; empty without one.
  Bytes certificate = {};

  /// The first field of that name, in whatever case; "" without one.
  [[nodiscard]] std::string_view field(std::string_view name) const;
};

struct Response {
  int status = 200;
  Fields fields;  // without Content-Length, Transfer-Encoding and Connection, which are the sender's
  Body body;
};

/// Why a request is not answered, and its connection closed: a status and half a sentence.
struct Refusal {
  int status = 400;
  std::string why;
};

}  // namespace kiroku::http

#include "http/exchange.h"

namespace kiroku::http {
namespace {

namespace beast = boost::beast;

bool is_field_text(const std::string& text) {
  return text.find_first_of(std::string_view("\r\n\0", 3)) == std::string::npos;
}

}  // namespace

std::optional<Refusal> refusal_of(const boost::system::error_code& failed) {
  if (failed == beast::http::error::body_limit) return Refusal{413, "the body is too large"};
  if (failed == beast::http::error::bad_chunk_extension) {
    return Refusal{400, "chunks with extensions are not known here"};
  }
  const bool is_gone = failed == beast::http::error::end_of_stream ||
                       failed == beast::http::error::partial_message ||
                       failed.category() != make_error_code(beast::http::error::bad_method).category();
  return is_gone ? std::nullopt : std::optional(Refusal{400, "this is not HTTP"});
}

beast::http::response<beast::http::buffer_body> head_to_send(int status, const Fields& fields,
                                                             std::optional<std::uint64_t> size,
                                                             bool keep_alive) {
  beast::http::response<beast::http::buffer_body> message;
  message.version(11);
  message.result(static_cast<unsigned>(status));
  for (const auto& [name, value] : fields) {
    if (!is_field_text(name) || !is_field_text(value)) {
      throw std::invalid_argument("a line break in the header " + name);
    }
    message.insert(name, value);
  }
  if (status != 204 && status != 304) {
    if (size) {
      message.content_length(*size);
    } else {
      message.chunked(true);
    }
  }
  message.set(beast::http::field::connection, keep_alive ? "keep-alive" : "close");
  message.body().data = nullptr;
  message.body().more = false;
  return message;
}

}  // namespace kiroku::http

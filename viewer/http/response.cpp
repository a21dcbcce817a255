#include "viewer/http/response.h"

#include <nlohmann/json.hpp>

namespace kiroku::viewer {

Response Response::json(const nlohmann::ordered_json& object, int status) {
  Response out;
  out.status = status;
  out.type = "application/json";
  out.body = object.dump(-1, ' ', false, nlohmann::ordered_json::error_handler_t::replace) + "\n";
  return out;
}

Response Response::error(int status, const std::string& sentence) {
  return json({{"error", sentence}}, status);
}

Response Response::nothing() {
  Response out;
  out.status = 204;
  return out;
}

Response Response::later(CostlyAnswer costly) {
  Response out;
  out.costly = std::move(costly);
  return out;
}

Response Response::text(std::string body, std::string type) {
  Response out;
  out.type = std::move(type);
  out.body = std::move(body);
  return out;
}

Response Response::bytes(std::shared_ptr<const Bytes> body, std::string type) {
  Response out;
  out.type = std::move(type);
  const std::uint64_t size = body->size();
  out.body = BytesBody{std::move(body), 0, size};
  return out;
}

Response Response::bytes(Bytes body, std::string type) {
  return bytes(std::make_shared<const Bytes>(std::move(body)), std::move(type));
}

Response Response::file(FileBody body, std::string type) {
  Response out;
  out.type = std::move(type);
  out.body = std::move(body);
  return out;
}

Response Response::read(ReadBody body, std::string type) {
  Response out;
  out.type = std::move(type);
  out.body = std::move(body);
  return out;
}

Response Response::stream(StreamBody body, std::string type) {
  Response out;
  out.type = std::move(type);
  out.body = std::move(body);
  return out;
}

Response Response::with(std::string name, std::string value) && {
  headers.emplace_back(std::move(name), std::move(value));
  return std::move(*this);
}

Response Response::as_download(std::string_view name) && {
  return std::move(*this).with("Content-Disposition", "attachment; filename=\"" + std::string(name) + "\"");
}

}  // namespace kiroku::viewer

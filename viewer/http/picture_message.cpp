#include "viewer/http/picture_message.h"

#include <nlohmann/json.hpp>

namespace kiroku::viewer {

Bytes picture_message(const nlohmann::ordered_json& about, ByteView jpeg) {
  const std::string head = about.dump();
  Bytes message;
  message.reserve(sizeof(std::uint32_t) + head.size() + jpeg.size());
  for (unsigned shift = 0; shift < 32; shift += 8)
    message.push_back(static_cast<std::byte>((head.size() >> shift) & 0xff));
  append(message, bytes_of(head));
  append(message, jpeg);
  return message;
}

}  // namespace kiroku::viewer

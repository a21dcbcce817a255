// Fields of messages that come over a WebSocket. Pure functions, thread-safe; each throws a Refusal 400 in
// one sentence that names the field.
#pragma once

#include <cstdint>
#include <string>

#include <nlohmann/json_fwd.hpp>

namespace kiroku::viewer {

const nlohmann::json& message_field(const nlohmann::json& object, const char* key);
std::string message_text(const nlohmann::json& object, const char* key);
double message_number(const nlohmann::json& object, const char* key, double least, double most);
std::uint64_t message_count(const nlohmann::json& object, const char* key);
bool message_flag(const nlohmann::json& object, const char* key);

}  // namespace kiroku::viewer

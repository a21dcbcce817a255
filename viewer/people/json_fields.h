// Fields of a JSON body, as handlers take them. Functions; thread-safe.
#pragma once

#include <string>

#include <nlohmann/json_fwd.hpp>

#include "crypto/secret.h"

namespace kiroku::viewer {

/// A text; Refusal 400 where it is missing or something else.
std::string take_text(const nlohmann::json& object, const char* key);
/// A text into locked memory, zeroised where it stood; empty where it is absent or null.
crypto::Secret take_secret(nlohmann::json& object, const char* key);

/// The beginning of every key under which failures with a user's name are counted (base/attempt_guard.h);
/// what follows says from where they came. Texts that are no user's name are one.
std::string user_key(const std::string& name);

}  // namespace kiroku::viewer

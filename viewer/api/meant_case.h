// The case that whoever asks means: a room may have gone on to the next patient's while they typed or
// pointed. Functions; thread-safe.
#pragma once

#include <optional>
#include <string>

#include <nlohmann/json_fwd.hpp>

namespace kiroku::viewer {

/// The `case` that a body or message names; nothing where it names none. Refusal 400 where that is no name of
/// a case, nor "" where `may_be_none`: none runs then.
std::optional<std::string> meant_case(const nlohmann::json& asked, bool may_be_none = false);

/// Throws the Refusal (409) of something that means `meant`, where the room records `running` ("": none).
[[noreturn]] void refuse_meant(const std::string& room, const std::string& meant, const std::string& running);

}  // namespace kiroku::viewer

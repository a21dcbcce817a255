// Speaking with a running recorder (recorder/daemon/control_server.h tells the words). Needs nothing of what
// records. Functions are thread-safe.
#pragma once

#include <chrono>
#include <filesystem>
#include <optional>

#include <nlohmann/json_fwd.hpp>

#include "base/error.h"

namespace kiroku::recorder {

/// No recorder listens there, or it ended before it answered.
class NobodyAnswers : public Error {
 public:
  using Error::Error;
};
/// One listens, but its answer did not come in time; what was asked may still be done.
class AnswersTooLate : public Error {
 public:
  using Error::Error;
};

/// sun_path, with its zero byte.
inline constexpr std::size_t kLongestSocketPath = 107;
/// Throws kiroku::UsageError for a path that no Unix socket can have.
void require_socket_path(const std::filesystem::path& socket);

/// Sends one request to the recorder that listens on `socket` and returns its answer, waiting at most
/// `patience` for each part of it; without one, for as long as it takes. Throws NobodyAnswers,
/// AnswersTooLate, kiroku::Error with the recorder's own sentence where it could not do what was asked, and
/// kiroku::UsageError for a path that is too long.
nlohmann::json ask_recorder(const std::filesystem::path& socket, const nlohmann::json& request,
                            std::optional<std::chrono::seconds> patience = {});

}  // namespace kiroku::recorder

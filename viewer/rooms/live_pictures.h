// Pictures while they are recorded, as the server knows them: which there are, and how to look on.
#pragma once

#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "viewer/http/socket.h"
#include "viewer/people/session.h"

namespace kiroku::viewer {

struct LiveStream {
  std::string room, stream;
  bool operator==(const LiveStream&) const = default;
};

struct LivePictures {
  /// Those of this process; empty: it records nothing.
  std::vector<LiveStream> streams;
  /// Sends what docs/reference/viewer.md says until the handler is destroyed. Called from several threads
  /// with one of `streams`; null where there are none.
  std::function<std::unique_ptr<SocketHandler>(const LiveStream& stream, std::shared_ptr<Session> session,
                                               std::shared_ptr<SocketOutput> output)>
      watch;
};

}  // namespace kiroku::viewer

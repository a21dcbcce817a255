// What the server asks of the recorder that runs in its own process.
#pragma once

#include <functional>
#include <string>

namespace kiroku::viewer {

struct LiveRooms {
  /// The case that is being recorded in the room; "": none. Called often, from several threads; null where
  /// this process records nothing.
  std::function<std::string(const std::string& room)> running_case;
};

}  // namespace kiroku::viewer

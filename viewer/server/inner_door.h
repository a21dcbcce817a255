// A Unix socket in the home, through which the viewer (kiroku view, kirokud) leads people to a program that
// plans or trains (docs/explanation/architecture.md, "One entrance"). Nobody but the same user of the
// machine, or root, gets a word through it. Thread-safe where nothing else is said.
#pragma once

#include <filesystem>
#include <optional>
#include <utility>

#include "base/descriptor.h"

namespace kiroku::viewer {

/// The end that answers, from construction to destruction. An object belongs to one thread.
class InnerDoor {
 public:
  /// Listens; a socket that a dead program left behind is replaced. kiroku::UsageError for a path that no
  /// socket can have, kiroku::Error where a living program has the door or nothing can be put there.
  explicit InnerDoor(std::filesystem::path socket);
  /// Nobody finds it any more.
  ~InnerDoor();
  InnerDoor(const InnerDoor&) = delete;
  InnerDoor& operator=(const InnerDoor&) = delete;

  /// What listens, for whoever accepts; once.
  [[nodiscard]] Descriptor take_listener() { return std::move(listener_); }

 private:
  const std::filesystem::path socket_;
  /// Of a file beside the socket, which stays: whoever holds it has the door. So no program takes away a
  /// socket that is another's.
  Descriptor lock_;
  Descriptor listener_;
};

/// Whether the other end of a connected Unix socket is a process of this very user, or of root: the kernel
/// says so (unix(7), SO_PEERCRED).
bool is_of_this_user(int socket);

/// A connection to whoever answers there; nothing where nobody does, or another user of the machine.
std::optional<Descriptor> knock(const std::filesystem::path& socket);

}  // namespace kiroku::viewer

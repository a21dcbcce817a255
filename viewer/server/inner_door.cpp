#include "viewer/server/inner_door.h"

#include <cerrno>
#include <cstring>
#include <fcntl.h>
#include <string>
#include <sys/file.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/un.h>
#include <unistd.h>

#include "base/error.h"

namespace kiroku::viewer {
namespace {

constexpr mode_t kOwnerAlone = 0600;
constexpr int kWaiting = 64;

/// Nothing for a path that does not fit.
std::optional<sockaddr_un> address_of(const std::filesystem::path& socket) {
  sockaddr_un address{};
  address.sun_family = AF_UNIX;
  const std::string& path = socket.native();
  if (path.size() >= sizeof address.sun_path) return {};
  std::memcpy(address.sun_path, path.c_str(), path.size() + 1);
  return address;
}

/// None where another program holds it.
Descriptor hold(const std::filesystem::path& file) {
  Descriptor lock(::open(file.c_str(), O_RDWR | O_CREAT | O_NOFOLLOW | O_CLOEXEC, kOwnerAlone));
  if (!lock) throw IoError("make", file, errno);
  int status = -1;
  do {
    status = ::flock(lock.number(), LOCK_EX | LOCK_NB);
  } while (status != 0 && errno == EINTR);
  if (status == 0) return lock;
  if (errno != EWOULDBLOCK) throw IoError("hold", file, errno);
  return Descriptor();
}

}  // namespace

InnerDoor::InnerDoor(std::filesystem::path socket) : socket_(std::move(socket)) {
  const std::optional<sockaddr_un> address = address_of(socket_);
  if (!address) {
    throw UsageError("the path " + socket_.string() + " is longer than a socket's may be (" +
                     std::to_string(sizeof address->sun_path - 1) + " bytes): use a home with a shorter one");
  }
  lock_ = hold(socket_.native() + ".lock");
  // A program of before this version holds no lock.
  if (!lock_ || knock(socket_)) {
    throw Error("another program answers on " + socket_.string() +
                " already: only one of its kind may be behind the viewer of a home");
  }
  std::error_code ignored;
  if (std::filesystem::is_socket(std::filesystem::symlink_status(socket_, ignored)))
    std::filesystem::remove(socket_, ignored);
  listener_ = Descriptor(::socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0));
  // Whoever connects before the mode is set is known by who they are.
  if (!listener_ ||
      ::bind(listener_.number(), reinterpret_cast<const sockaddr*>(&*address), sizeof *address) != 0 ||
      ::chmod(socket_.c_str(), kOwnerAlone) != 0 || ::listen(listener_.number(), kWaiting) != 0) {
    throw Error("cannot listen on " + socket_.string() + ": " + std::strerror(errno));
  }
}

InnerDoor::~InnerDoor() {
  std::error_code ignored;
  std::filesystem::remove(socket_, ignored);
}

bool is_of_this_user(int socket) {
  ucred peer{};
  socklen_t size = sizeof peer;
  if (::getsockopt(socket, SOL_SOCKET, SO_PEERCRED, &peer, &size) != 0) return false;
  return peer.uid == ::geteuid() || peer.uid == 0;
}

std::optional<Descriptor> knock(const std::filesystem::path& socket) {
  const std::optional<sockaddr_un> address = address_of(socket);
  Descriptor connection(::socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0));
  if (!address || !connection) return {};
  // A full queue is no connection either (EAGAIN): nobody waits here.
  if (::connect(connection.number(), reinterpret_cast<const sockaddr*>(&*address), sizeof *address) != 0)
    return {};
  if (!is_of_this_user(connection.number())) return {};
  return connection;
}

}  // namespace kiroku::viewer

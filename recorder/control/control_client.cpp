#include "recorder/control/control_client.h"

#include <array>
#include <cerrno>
#include <cstring>
#include <string>
#include <sys/socket.h>
#include <sys/un.h>

#include <nlohmann/json.hpp>

#include "base/descriptor.h"

namespace kiroku::recorder {
namespace {

[[noreturn]] void fail(const std::filesystem::path& socket, int error_number) {
  if (error_number == EAGAIN || error_number == EWOULDBLOCK) {
    throw AnswersTooLate(
        "the recorder on " + socket.string() +
        " is there but did not answer in time; it may still do what was asked: look at its status");
  }
  throw NobodyAnswers("no recorder answers on " + socket.string() + " (" + std::strerror(error_number) +
                      "): start kirokud, or name its home with --home");
}

Descriptor connect_to(const std::filesystem::path& socket, std::optional<std::chrono::seconds> patience) {
  sockaddr_un address{};
  address.sun_family = AF_UNIX;
  std::strncpy(address.sun_path, socket.c_str(), sizeof address.sun_path - 1);
  Descriptor peer(::socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0));
  if (!peer) fail(socket, errno);
  if (patience) {
    const timeval limit{.tv_sec = patience->count(), .tv_usec = 0};
    ::setsockopt(peer.number(), SOL_SOCKET, SO_RCVTIMEO, &limit, sizeof limit);
    ::setsockopt(peer.number(), SOL_SOCKET, SO_SNDTIMEO, &limit, sizeof limit);
  }
  if (::connect(peer.number(), reinterpret_cast<const sockaddr*>(&address), sizeof address) != 0) {
    fail(socket, errno);
  }
  return peer;
}

}  // namespace

void require_socket_path(const std::filesystem::path& socket) {
  if (socket.string().size() > kLongestSocketPath) {
    throw UsageError("the path of the control socket, " + socket.string() + ", is longer than " +
                     std::to_string(kLongestSocketPath) +
                     " characters: name a shorter one in kiroku.toml, [daemon] socket");
  }
}

nlohmann::json ask_recorder(const std::filesystem::path& socket, const nlohmann::json& request,
                            std::optional<std::chrono::seconds> patience) {
  require_socket_path(socket);
  const Descriptor peer = connect_to(socket, patience);
  const std::string question = request.dump(-1, ' ', false, nlohmann::json::error_handler_t::replace) + "\n";
  for (std::size_t sent = 0; sent < question.size();) {
    const ssize_t count = ::send(peer.number(), question.data() + sent, question.size() - sent, MSG_NOSIGNAL);
    if (count < 0 && errno == EINTR) continue;
    if (count < 0) fail(socket, errno);
    sent += static_cast<std::size_t>(count);
  }
  std::string received;
  std::array<char, 16384> some;
  while (received.find('\n') == std::string::npos) {
    const ssize_t count = ::recv(peer.number(), some.data(), some.size(), 0);
    if (count < 0 && errno == EINTR) continue;
    if (count <= 0) fail(socket, count == 0 ? ECONNRESET : errno);
    received.append(some.data(), static_cast<std::size_t>(count));
  }
  nlohmann::json reply = nlohmann::json::parse(received, nullptr, false);
  if (!reply.is_object()) throw Error("what answers on " + socket.string() + " is no recorder");
  if (!reply.value("ok", false)) throw Error(reply.value("error", "the recorder gave no reason"));
  return reply;
}

}  // namespace kiroku::recorder

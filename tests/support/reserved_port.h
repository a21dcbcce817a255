// TCP and UDP ports for servers that must be told theirs before they start.
#pragma once

#include <cerrno>
#include <cstdint>
#include <fcntl.h>
#include <filesystem>
#include <random>
#include <string>
#include <sys/file.h>
#include <system_error>
#include <vector>

#include <boost/asio/io_context.hpp>
#include <boost/asio/ip/tcp.hpp>

#include "base/descriptor.h"

namespace kiroku::test {

/// A port of 127.0.0.1 where nobody listens, and which no other test gets until this process ends: tests hold
/// locks on files named after ports. It lies below those that the system gives to connections.
inline std::uint16_t reserved_port() {
  static std::vector<Descriptor> held;
  std::mt19937 random(std::random_device{}());
  const auto folder = std::filesystem::temp_directory_path() / "kiroku-test-ports";
  std::filesystem::create_directories(folder);
  std::error_code not_ours;  // another user's folder is as good
  std::filesystem::permissions(folder, std::filesystem::perms::all, not_ours);
  for (int tries = 0; tries < 1000; ++tries) {
    const auto port = std::uniform_int_distribution<std::uint16_t>(20000, 32000)(random);
    Descriptor lock(::open((folder / std::to_string(port)).c_str(), O_RDWR | O_CREAT | O_CLOEXEC, 0666));
    if (!lock || ::flock(lock.number(), LOCK_EX | LOCK_NB) != 0) continue;
    boost::asio::io_context context;
    boost::asio::ip::tcp::acceptor acceptor(context);
    boost::system::error_code taken;
    acceptor.open(boost::asio::ip::tcp::v4());
    acceptor.bind({boost::asio::ip::make_address("127.0.0.1"), port}, taken);
    if (taken) continue;
    held.push_back(std::move(lock));
    return port;
  }
  throw std::system_error(EADDRINUSE, std::generic_category(), "no port is free for a test");
}

}  // namespace kiroku::test

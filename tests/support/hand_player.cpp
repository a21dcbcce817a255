// A hand on the network: plays a file of hand motion as datagrams of a UDP device
// (docs/reference/simulation.md, "Haptic rate"), 500 a second, and counts the forces that come back. It
// writes the datagrams by itself, so that it proves what is documented.
//   hand_player FILE PORT
#include <algorithm>
#include <arpa/inet.h>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <exception>
#include <fstream>
#include <iterator>
#include <optional>
#include <string>
#include <sys/socket.h>
#include <thread>
#include <unistd.h>
#include <vector>

#include "trainer/hand/hand_motion.h"

namespace {

void put(std::vector<unsigned char>& datagram, const void* number, std::size_t size) {
  const auto* const bytes = static_cast<const unsigned char*>(number);
  datagram.insert(datagram.end(), bytes, bytes + size);  // little-endian, as this machine
}

int play(const char* file, int port) {
  std::ifstream in(file);
  const kiroku::trainer::HandMotion motion =
      kiroku::trainer::parse_hand_motion(std::string(std::istreambuf_iterator<char>(in), {}), file);
  const int socket = ::socket(AF_INET, SOCK_DGRAM, 0);
  sockaddr_in to{};
  to.sin_family = AF_INET;
  to.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  to.sin_port = htons(static_cast<std::uint16_t>(port));
  if (socket < 0 || ::connect(socket, reinterpret_cast<const sockaddr*>(&to), sizeof to) != 0) return 1;
  constexpr double kPerSecond = 500, kStaysSeconds = 2;
  const auto fingers = static_cast<std::uint16_t>(motion.fingers);
  const std::uint16_t zero = 0;
  std::uint32_t sequence = 0, answers = 0;
  double largest_n = 0;
  const auto begun = std::chrono::steady_clock::now();
  for (double time_s = 0; time_s < motion.duration_s() + kStaysSeconds; time_s = ++sequence / kPerSecond) {
    std::this_thread::sleep_until(begun + std::chrono::duration<double>(time_s));
    const std::optional<kiroku::sim::Pose> wrist = motion.wrist_at(time_s);
    const unsigned char version = wrist ? '2' : '1';
    std::vector<unsigned char> datagram{'K', 'H', 'P', version};
    put(datagram, &sequence, sizeof sequence);
    put(datagram, &fingers, sizeof fingers);
    put(datagram, &zero, sizeof zero);
    std::vector<kiroku::sim::Pose> poses = motion.at(time_s);
    if (wrist) poses.push_back(*wrist);
    for (const kiroku::sim::Pose& pose : poses) {
      const auto& q = pose.orientation;
      for (const double number :
           {pose.position_m.x(), pose.position_m.y(), pose.position_m.z(), q.w(), q.x(), q.y(), q.z()})
        put(datagram, &number, sizeof number);
    }
    // Nobody may listen yet, or any more.
    static_cast<void>(::send(socket, datagram.data(), datagram.size(), 0));
    unsigned char answer[2048];
    for (ssize_t size = 0; (size = ::recv(socket, answer, sizeof answer, MSG_DONTWAIT)) > 0;) {
      const ssize_t expected = 12 + 24 * fingers + (wrist ? 48 : 0);
      if (size != expected || std::memcmp(answer, "KHF", 3) != 0 || answer[3] != version) return 2;
      ++answers;
      for (std::size_t finger = 0; finger < fingers; ++finger) {
        double n[3];
        std::memcpy(n, answer + 12 + 24 * finger, sizeof n);
        largest_n = std::max(largest_n, std::sqrt(n[0] * n[0] + n[1] * n[1] + n[2] * n[2]));
      }
    }
  }
  ::close(socket);
  std::printf("%u %g\n", answers, largest_n);
  return 0;
}

}  // namespace

int main(int argc, char** argv) {
  if (argc != 3) return 1;
  try {
    return play(argv[1], std::atoi(argv[2]));
  } catch (const std::exception& error) {
    std::fprintf(stderr, "%s\n", error.what());
    return 1;
  }
}

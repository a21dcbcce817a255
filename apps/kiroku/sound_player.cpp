#include "apps/kiroku/sound_player.h"

#include <algorithm>
#include <array>
#include <cerrno>
#include <chrono>
#include <exception>
#include <fcntl.h>
#include <poll.h>
#include <span>
#include <string>
#include <unistd.h>

#include "apps/common/command_line.h"

namespace kiroku::apps {
namespace {

using std::chrono::milliseconds;
using SteadyClock = std::chrono::steady_clock;

constexpr milliseconds kPiece{20};
constexpr int kPieceSamples = light::SoundCoder::kRate / 1'000 * static_cast<int>(kPiece.count());
// What a pipe keeps sounds late: a sixth of a second of it, in the place of Linux's two thirds.
constexpr int kPipeBytes = 16'384;
// A reader that is so late is a player whose crystal is slow, or that was stopped.
constexpr milliseconds kLatest{200};

}  // namespace

SoundPlayer::SoundPlayer(int descriptor, const light::SoundCoder& coder, CodeOfSecond code,
                         std::function<void()> ended)
    : descriptor_(descriptor), coder_(coder), code_(std::move(code)), ended_(std::move(ended)) {
  ::fcntl(descriptor, F_SETPIPE_SZ, kPipeBytes);  // of a pipe alone; a file keeps nothing back
  thread_ = std::thread([this] { run(); });
}

SoundPlayer::~SoundPlayer() {
  ending_ = true;
  thread_.join();
}

void SoundPlayer::run() {
  std::vector<std::int16_t> sounding, piece;
  std::size_t played = 0;
  bool began = false;  // in this second
  bool is_warned = false;
  auto due = SteadyClock::now();
  while (!ending_) {
    std::this_thread::sleep_until(due);
    const auto late = std::chrono::duration_cast<milliseconds>(SteadyClock::now() - due);
    if (late > kLatest) {
      played += static_cast<std::size_t>(late / kPiece) * kPieceSamples;
      due += late / kPiece * kPiece;
    }
    std::optional<std::uint64_t> code;
    try {
      code = code_();
      if (code && !began) {
        sounding = coder_.sound_of(*code);
        played = 0;
      }
    } catch (const std::exception& error) {  // an archive's folder that is away, say: no code begins
      code.reset();
      if (!is_warned) print_error("kiroku", std::string("warning: no code sounds: ") + error.what());
      is_warned = true;
    }
    began = code.has_value();
    piece.assign(kPieceSamples, 0);
    if (played < sounding.size()) {
      const auto left = std::span(sounding).subspan(played, std::min(piece.size(), sounding.size() - played));
      std::copy(left.begin(), left.end(), piece.begin());
      played += left.size();
    }
    if (!write(piece)) break;
    due += kPiece;
  }
  if (!ending_) ended_();
}

bool SoundPlayer::write(const std::vector<std::int16_t>& piece) {
  std::array<std::byte, 2 * kPieceSamples> bytes{};
  for (std::size_t i = 0; i < std::min<std::size_t>(piece.size(), kPieceSamples); ++i) {
    const auto bits = static_cast<std::uint16_t>(piece[i]);
    bytes[2 * i] = static_cast<std::byte>(bits & 0xffU);
    bytes[2 * i + 1] = static_cast<std::byte>(bits >> 8U);
  }
  std::size_t written = 0;
  while (written < bytes.size()) {
    // Writing may wait for a reader as long as it likes; ending must not.
    pollfd room{descriptor_, POLLOUT, 0};
    const int ready = ::poll(&room, 1, static_cast<int>(kLatest.count()));
    if (ending_) return false;
    if (ready == 0 || (ready < 0 && errno == EINTR)) continue;
    if (ready < 0) return false;
    const ssize_t result = ::write(descriptor_, bytes.data() + written, bytes.size() - written);
    if (result < 0 && errno != EINTR && errno != EAGAIN) return false;
    if (result > 0) written += static_cast<std::size_t>(result);
  }
  return true;
}

}  // namespace kiroku::apps

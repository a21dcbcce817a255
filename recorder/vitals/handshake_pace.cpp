#include "recorder/vitals/handshake_pace.h"

#include "base/network_address.h"

namespace kiroku::recorder {
namespace {

constexpr std::size_t kMostMonitors = 1024;

}  // namespace

HandshakePace::HandshakePace(AttemptLimits of_address, AttemptLimits of_network)
    : addresses_(of_address), networks_(of_network) {}

bool HandshakePace::must_wait(const std::string& address, Time now) const {
  constexpr std::chrono::seconds kNone{0};
  return !monitors_.contains(address) &&
         (addresses_.wait(address, now) > kNone || networks_.wait(address_holder(address), now) > kNone);
}

void HandshakePace::note_failure(const std::string& address, Time now) {
  addresses_.failed(address, now);
  networks_.failed(address_holder(address), now);
}

void HandshakePace::note_message(const std::string& address) {
  addresses_.succeeded(address);
  if (monitors_.size() < kMostMonitors) monitors_.insert(address);
}

}  // namespace kiroku::recorder

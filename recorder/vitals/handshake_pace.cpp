#include "recorder/vitals/handshake_pace.h"

#include "base/network_address.h"

namespace kiroku::recorder {
namespace {

constexpr std::size_t kMostMonitors = 1024, kMostNetworks = 1024;
constexpr std::chrono::seconds kSecond{1};

}  // namespace

HandshakePace::HandshakePace(AttemptLimits of_address, std::size_t network_each_second)
    : addresses_(of_address), network_each_second_(network_each_second) {}

bool HandshakePace::may_begin(const std::string& address, Time now) {
  if (monitors_.contains(address)) return true;
  return addresses_.wait(address, now).count() == 0 && take_of_network(address_holder(address), now);
}

bool HandshakePace::take_of_network(const std::string& network, Time now) {
  if (networks_.size() >= kMostNetworks && !networks_.contains(network))
    std::erase_if(networks_, [now](const auto& each) { return now - each.second.begin >= kSecond; });
  // So many networks at once are an attack, and the machine's limit of connections stands against that.
  if (networks_.size() >= kMostNetworks && !networks_.contains(network)) return true;
  Second& second = networks_.try_emplace(network, Second{now, 0}).first->second;
  if (now - second.begin >= kSecond) second = {now, 0};
  if (second.taken >= network_each_second_) return false;
  ++second.taken;
  return true;
}

void HandshakePace::note_message(const std::string& address) {
  addresses_.succeeded(address);
  if (monitors_.size() < kMostMonitors) monitors_.insert(address);
}

}  // namespace kiroku::recorder

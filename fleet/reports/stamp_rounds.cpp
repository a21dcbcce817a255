#include "fleet/reports/stamp_rounds.h"

#include <algorithm>
#include <array>
#include <condition_variable>
#include <deque>
#include <map>
#include <mutex>
#include <thread>
#include <unordered_map>
#include <utility>
#include <vector>

#include "base/error.h"
#include "crypto/encoding.h"
#include "crypto/secret.h"
#include "evidence/shared_token.h"

namespace kiroku::fleet {
namespace {

using std::chrono::milliseconds;

constexpr std::size_t kTicketBytes = 16;

struct Entry {
  std::string appliance;
  std::size_t group;
};

struct Round {
  Clock::Time end;
  std::vector<evidence::HashList> groups;
  std::unordered_map<std::string, Entry> by_ticket;
  std::map<std::string, std::size_t> of_appliance;
  bool over = false;                              // stamped, or not to be had
  std::string why_not;                            // where it is not to be had
  std::optional<evidence::StampedRound> stamped;  // never changed once it is there
};

}  // namespace

struct StampRounds::State {
  explicit State(Options given)
      : options(std::move(given)),
        every(std::chrono::duration_cast<Clock::Duration>(options.every)),
        open(new_round(options.clock->now() + every)),
        thread([this] { run(); }) {}
  ~State() {
    {
      const std::lock_guard guard(mutex);
      stopping = true;
    }
    changed.notify_all();
    thread.join();
  }

  static std::shared_ptr<Round> new_round(Clock::Time end) {
    auto round = std::make_shared<Round>();
    round->end = end;
    return round;
  }

  void run() {
    const Clock& clock = *options.clock;
    std::unique_lock lock(mutex);
    for (;;) {
      clock.wait_until(changed, lock, open->end, [this] { return stopping; });
      if (stopping) return;
      if (clock.now() < open->end) continue;
      Clock::Time next = open->end;
      while (next <= clock.now()) next += every;
      if (open->groups.empty()) {
        open->end = next;
        continue;
      }
      const std::shared_ptr<Round> closed = std::exchange(open, new_round(next));
      before.push_back(closed);
      std::vector<evidence::HashList> groups = std::move(closed->groups);
      lock.unlock();
      std::optional<evidence::StampedRound> stamped;
      std::string why_not;
      try {
        stamped.emplace(std::move(groups), options.stamp);
      } catch (const std::exception& error) {
        why_not = error.what();
      }
      tell(why_not, closed->by_ticket.size());
      lock.lock();
      closed->stamped = std::move(stamped);
      closed->why_not = std::move(why_not);
      closed->over = true;
      while (before.size() > options.limits.kept) before.pop_front();
    }
  }

  /// The same trouble once, and that it is over. Of the thread of rounds alone.
  void tell(const std::string& why_not, std::size_t hashes) {
    if (why_not == told) return;
    told = why_not;
    if (!options.tell) return;
    options.tell(why_not.empty() ? "rounds are stamped again"
                                 : "no time-stamp for a round of " + std::to_string(hashes) + ": " + why_not);
  }

  [[nodiscard]] milliseconds until(Clock::Time time) const {
    const auto left = std::chrono::ceil<milliseconds>(time - options.clock->now());
    return std::max(left, milliseconds(0));
  }

  const Options options;
  const Clock::Duration every;
  mutable std::mutex mutex;  // of what follows
  std::condition_variable changed;
  std::shared_ptr<Round> open;
  std::deque<std::shared_ptr<const Round>> before;  // oldest first; the newest may be being stamped
  bool stopping = false;
  std::string told;    // of the thread alone
  std::thread thread;  // last: uses the rest
};

StampRounds::StampRounds(Options options) : state_(std::make_unique<State>(std::move(options))) {}
StampRounds::~StampRounds() = default;

StampRounds::Entered StampRounds::enter(const std::string& appliance, ByteView digest, ByteView nonce) {
  std::array<std::byte, kTicketBytes> random{};
  crypto::fill_random(random);
  const std::string ticket = crypto::to_hex(random);
  const std::lock_guard guard(state_->mutex);
  Round& open = *state_->open;
  const RoundLimits& limits = state_->options.limits;
  if (open.groups.size() >= limits.of_round) return {{}, Refusal::kFull};
  std::size_t& its = open.of_appliance[appliance];
  if (its >= limits.of_appliance) return {{}, Refusal::kTooManyOfAppliance};
  ++its;
  open.by_ticket.emplace(ticket, Entry{appliance, open.groups.size()});
  open.groups.push_back({to_bytes(digest), to_bytes(nonce)});
  return {{ticket, state_->until(open.end)}, {}};
}

StampRounds::Fetched StampRounds::fetch(const std::string& appliance, const std::string& ticket) const {
  Fetched fetched;
  std::shared_ptr<const Round> round;
  std::size_t group = 0;
  {
    const std::lock_guard guard(state_->mutex);
    const auto has = [&](const Round& each) {
      const auto found = each.by_ticket.find(ticket);
      if (found == each.by_ticket.end() || found->second.appliance != appliance) return false;
      group = found->second.group;
      return true;
    };
    using enum Fetched::State;
    if (has(*state_->open)) {
      fetched.state = kWaiting;
      fetched.ready_in = state_->until(state_->open->end);
      return fetched;
    }
    for (const auto& each : state_->before) {
      if (has(*each)) round = each;
    }
    if (!round) return fetched;
    if (!round->over) {
      fetched.state = kWaiting;
      return fetched;
    }
    if (!round->stamped) {
      fetched.state = kFailed;
      fetched.why = round->why_not;
      return fetched;
    }
    fetched.state = kReady;
  }
  fetched.record = round->stamped->file_of(group);
  return fetched;
}

}  // namespace kiroku::fleet

#include "apps/fleet/stamp_desk.h"

#include <utility>

#include "apps/fleet/desk_refusal.h"
#include "base/error.h"
#include "base/joined.h"
#include "recorder/clock/whole_seconds.h"
#include "timestamp/client.h"
#include "timestamp/token.h"

namespace kiroku::apps {
namespace {

/// By one certificate in a minute: sixteen for each room of its appliance, which needs about three for each
/// authority.
constexpr std::size_t kMostRequests = 16 * fleet::RoundLimits().of_appliance;
constexpr std::chrono::minutes kRequestWindow{1};
constexpr std::size_t kMostCertificates = 10'000;
/// Of the way through a round's tree and what stands around it: 64 lists of two hashes are less.
constexpr std::size_t kPathBytes = 6U << 10;

constexpr int kOk = 200, kAccepted = 202, kNotFound = 404, kTooMany = 429, kBadGateway = 502,
              kUnavailable = 503;

std::shared_ptr<timestamp::StampSource> over_http(const AuthorityConfiguration& authority) {
  return timestamp::http_stamp_source(authority.paths);
}

}  // namespace

StampDesk::StampDesk(Options options)
    : options_(std::move(options)),
      budget_(kMostRequests, kRequestWindow, kMostCertificates, *options_.clock) {
  for (const AuthorityConfiguration& authority : options_.authorities) {
    recorder::BackOffPolicy pauses;
    pauses.min_interval = authority.min_interval;
    Collected& its = authorities_[authority.name];
    its.contact = std::make_unique<recorder::AuthorityContact>(
        recorder::NamedAuthority{authority.name,
                                 options_.reach ? options_.reach(authority) : over_http(authority), pauses},
        options_.trust, nullptr, *options_.clock);
    fleet::StampRounds::Options rounds;
    rounds.stamp = [&contact = *its.contact, &clock = *options_.clock](crypto::HashAlgorithm algorithm,
                                                                       ByteView imprint) {
      return stamp(contact, clock, algorithm, imprint);
    };
    rounds.every = options_.round;
    rounds.clock = options_.clock;
    if (options_.tell)
      rounds.tell = [this, name = authority.name](const std::string& what) {
        options_.tell(name + ": " + what);
      };
    its.rounds = std::make_unique<fleet::StampRounds>(std::move(rounds));
  }
}

Bytes StampDesk::stamp(recorder::AuthorityContact& contact, const Clock& clock,
                       crypto::HashAlgorithm algorithm, ByteView imprint) {
  // A round that was open when the authority said so asks it no sooner. Without a failure, its limit is
  // min_interval, which no round is shorter than.
  const recorder::AuthorityStatus status = contact.status();
  const Clock::Duration left = contact.limit() - clock.now();
  if (status.failures > 0 && left.count() > 0)
    throw Error("not asked, since it is to be left alone for another " + recorder::whole_seconds(left) +
                ": " + status.last_error);
  const recorder::AuthorityAnswer answer = contact.ask_over(algorithm, imprint);
  if (!answer.valid()) throw Error(answer.cause);
  std::string ignored;
  Bytes token = timestamp::parse_response(answer.response, ignored)->token;
  if (token.size() > fleet::kLargestSharedToken - kPathBytes)
    throw Error("its tokens are too large to be shared: " + std::to_string(token.size()) + " bytes");
  return token;
}

void StampDesk::count(const std::string& fingerprint) {
  if (!budget_.take(fingerprint))
    throw DeskRefusal{kTooMany, "more requests came from this appliance in a minute than all its rooms need"};
}

const StampDesk::Collected& StampDesk::of(const std::string& authority) const {
  const auto found = authorities_.find(authority);
  if (found != authorities_.end()) return found->second;
  std::vector<std::string> names;
  for (const auto& [name, its] : authorities_) names.push_back(name);
  throw DeskRefusal{kNotFound,
                    "no authority named " + authority + " is shared here; there are: " + joined(names)};
}

StampDesk::Answer StampDesk::enter(const std::string& appliance, const fleet::StampRequest& request) {
  const Collected& its = of(request.authority);
  // Whoever would fail at the end of the round is told now, and asks by itself.
  const recorder::AuthorityStatus status = its.contact->status();
  if (status.failures > 0 && status.pause.count() > 0)
    throw DeskRefusal{kUnavailable, request.authority + " is left alone for another " +
                                        recorder::whole_seconds(status.pause) + ": " + status.last_error};
  const fleet::StampRounds::Entered entered = its.rounds->enter(appliance, request.digest, request.nonce);
  if (!entered.refused) return {kAccepted, fleet::place_json(entered.place)};
  if (*entered.refused == fleet::StampRounds::Refusal::kFull)
    throw DeskRefusal{kUnavailable, "this round is full: ask the authority itself"};
  throw DeskRefusal{kTooMany, appliance + " has as many checkpoints in this round as it may have"};
}

StampDesk::Answer StampDesk::fetch(const std::string& appliance, const fleet::StampQuestion& question) const {
  using enum fleet::StampRounds::Fetched::State;
  const fleet::StampRounds::Fetched fetched =
      of(question.authority).rounds->fetch(appliance, question.ticket);
  switch (fetched.state) {
    case kWaiting:
      return {kAccepted, fleet::waiting_json(fetched.ready_in)};
    case kReady:
      return {kOk, fleet::record_json(fetched.record)};
    case kFailed:
      throw DeskRefusal{kBadGateway, question.authority + " gave no time-stamp: " + fetched.why};
    case kUnknown:
      break;
  }
  throw DeskRefusal{kNotFound, "there is no such ticket of " + appliance +
                                   ": its round is long over, or this server was started anew"};
}

}  // namespace kiroku::apps

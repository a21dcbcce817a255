#include "recorder/authority_contact.h"

#include <algorithm>
#include <array>
#include <utility>

#include "crypto/secret.h"
#include "evidence/shared_token.h"
#include "recorder/clock/whole_seconds.h"

namespace kiroku::recorder {
namespace {

using std::chrono::nanoseconds;

/// How often a round that is over is looked at until its token is there.
constexpr std::chrono::seconds kLookAgain{1};
/// Where nobody answers, after twice as long each time up to this.
constexpr std::chrono::seconds kLongestLook{16};

const timestamp::TrustStore& trust_or_nothing(const timestamp::TrustStore* trust) {
  static const timestamp::TrustStore kNothing;
  return trust == nullptr ? kNothing : *trust;
}

/// Of a shared token over this hash that came for this nonce. Throws kiroku::Error for one that proves
/// nothing.
timestamp::TokenJudgement judge_shared(ByteView record, ByteView digest, ByteView nonce,
                                       const timestamp::TrustStore& trust) {
  const evidence::SharedTokenParse parsed = evidence::parse_shared_token(record);
  if (!parsed.shared) throw Error("what came is no shared token: " + parsed.explanation);
  if (!parsed.shared->begins_with(nonce))
    throw Error("what came is not for this question: the nonce is not in it");
  timestamp::Expectation expectation;
  expectation.algorithm = crypto::HashAlgorithm::kSha256;
  expectation.imprint = parsed.shared->imprint_for(digest).value_or(Bytes());
  timestamp::TokenJudgement judgement = timestamp::judge_token(parsed.shared->token, expectation, trust);
  if (judgement.code != timestamp::TokenCode::kValid)
    throw Error("what came does not hold: " + judgement.explanation);
  return judgement;
}

AuthorityAnswer exchange(const NamedAuthority& authority, const timestamp::TrustStore& trust,
                         const Clock& clock, const timestamp::Request& request,
                         archive::StoredCheckpoint checkpoint, std::optional<nanoseconds>& leave_alone_for) {
  AuthorityAnswer answer;
  answer.authority = authority.name;
  answer.checkpoint = std::move(checkpoint);
  answer.asked = answer.answered = clock.since_boot();
  try {
    answer.response = authority.source->ask(timestamp::encode_request(request));
    answer.answered = clock.since_boot();
    timestamp::Expectation expectation;
    expectation.algorithm = request.algorithm;
    expectation.imprint = request.imprint;
    expectation.nonce = request.nonce;
    answer.judgement = timestamp::judge_token(answer.response, expectation, trust);
    if (answer.judgement.code != timestamp::TokenCode::kValid) answer.cause = answer.judgement.explanation;
    answer.path = authority.source->path();
  } catch (const timestamp::AuthorityError& error) {
    answer.cause = error.what();
    leave_alone_for = error.leave_alone_for();
  } catch (const std::exception& error) {
    answer.cause = error.what();
  }
  if (!answer.valid()) answer.answered = clock.since_boot();
  return answer;
}

UtcTime utc_after(UtcTime now, nanoseconds pause) {
  return now + std::chrono::ceil<UtcTime::duration>(std::max(pause, nanoseconds(0)));
}

/// What remains of a pause that ended at `end` when it was `written`, however the wall clock was set since.
nanoseconds remaining(UtcTime end, UtcTime written, UtcTime now) {
  const auto whole = std::max(end - written, UtcTime::duration(0));
  return std::clamp(end - now, UtcTime::duration(0), whole);
}

}  // namespace

archive::TokenEntry token_facts(const AuthorityAnswer& answer) {
  archive::TokenEntry entry;
  entry.gen_time = answer.judgement.info->gen_time;
  entry.accuracy_ns = answer.judgement.info->accuracy_ns;
  entry.serial = answer.judgement.info->serial;
  return entry;
}

AuthorityContact::AuthorityContact(NamedAuthority authority, const timestamp::TrustStore* trust,
                                   StampingQueue* queue, const Clock& clock)
    : authority_(std::move(authority)),
      trust_(trust),
      queue_(queue),
      clock_(clock),
      back_off_(authority_.pauses, std::random_device{}()),
      shared_back_off_({}, std::random_device{}()) {}

AuthorityAnswer AuthorityContact::ask(archive::StoredCheckpoint checkpoint) {
  const timestamp::Request request =
      timestamp::make_request(crypto::HashAlgorithm::kSha256,
                              crypto::digest(crypto::HashAlgorithm::kSha256, bytes_of(checkpoint.note)));
  return ask(request, std::move(checkpoint));
}

AuthorityAnswer AuthorityContact::ask_over(crypto::HashAlgorithm algorithm, ByteView imprint) {
  return ask(timestamp::make_request(algorithm, imprint), {});
}

AuthorityAnswer AuthorityContact::ask(const timestamp::Request& request,
                                      archive::StoredCheckpoint checkpoint) {
  {
    const std::lock_guard guard(mutex_);
    back_off_.asked(clock_.now());
    remember_locked();  // before the request goes out: a new start must not ask sooner
  }
  std::optional<nanoseconds> leave_alone_for;
  AuthorityAnswer answer =
      exchange(authority_, trust_or_nothing(trust_), clock_, request, std::move(checkpoint), leave_alone_for);
  const std::lock_guard guard(mutex_);
  if (answer.valid()) {
    back_off_.succeeded();
    record_.last_token = clock_.utc();
    record_.path = answer.path;
  } else {
    const Time now = clock_.now();
    back_off_.failed(now, leave_alone_for);
    answer.pause = back_off_.next() - now;
    shared_since_failure_ = false;
  }
  record_.last_error = answer.cause;
  remember_locked();
  return answer;
}

AuthorityAnswer AuthorityContact::ask_in_place_of_sharing(archive::StoredCheckpoint checkpoint) {
  AuthorityAnswer answer = ask(std::move(checkpoint));
  if (!authority_.shared) return answer;
  const std::lock_guard guard(mutex_);
  answer.not_shared = not_shared_;
  answer.hurried = hurried_ && not_shared_.empty();
  if (!not_shared_.empty() && !answer.valid()) answer.cause += "; nor was it shared: " + not_shared_;
  return answer;
}

bool AuthorityContact::may_share() const {
  const std::lock_guard guard(mutex_);
  return authority_.shared && !hurried_ && shared_back_off_.next() <= clock_.now();
}

std::optional<AuthorityAnswer> AuthorityContact::wait_for_shared(
    const archive::StoredCheckpoint& checkpoint) {
  {
    const std::lock_guard guard(mutex_);
    if (hurried_) return {};
  }
  try {
    AuthorityAnswer answer;
    answer.authority = authority_.name;
    answer.checkpoint = checkpoint;
    answer.asked = clock_.since_boot();
    const crypto::Sha256Digest digest = crypto::sha256(bytes_of(checkpoint.note));
    std::array<std::byte, evidence::SharedStamps::kNonceBytes> nonce{};
    crypto::fill_random(nonce);
    const Time until = clock_.now() + std::chrono::duration_cast<Clock::Duration>(authority_.shared_patience);
    const evidence::SharedStamps::Place place = authority_.shared->enter(digest, nonce);
    // What the other side says of its round is believed within limits.
    Time look = clock_.now() + std::clamp<Clock::Duration>(place.ready_in, kLookAgain, std::chrono::hours(1));
    std::optional<Bytes> record;
    std::string away;
    Clock::Duration pause = kLookAgain;
    const auto give_up = [&] {
      throw Error("its token does not come within " + whole_seconds(authority_.shared_patience) +
                  (away.empty() ? "" : ": " + away));
    };
    if (look > until) give_up();  // by its own word
    while (!record) {
      {
        std::unique_lock lock(mutex_);
        if (clock_.wait_until(hurrying_, lock, look, [this] { return hurried_; })) return {};
      }
      try {
        record = authority_.shared->fetch(place);
        away.clear();
        pause = kLookAgain;
      } catch (const evidence::SharedStampsAway& error) {
        // A network that is away for a moment, or a server that is started anew behind the same address,
        // costs no round.
        away = error.what();
        pause = std::min<Clock::Duration>(2 * pause, kLongestLook);
      }
      const Time now = clock_.now();
      if (!record && now >= until) give_up();
      look = std::min(now + pause, until);
    }
    answer.answered = clock_.since_boot();
    answer.judgement = judge_shared(*record, digest, nonce, trust_or_nothing(trust_));
    answer.response = std::move(*record);
    answer.path = authority_.shared->path();
    const std::lock_guard guard(mutex_);
    shared_back_off_.succeeded();
    not_shared_.clear();
    shared_since_failure_ = true;
    catch_up_locked();  // a round is long: what other processes wrote meanwhile stays
    record_.last_token = clock_.utc();
    record_.path = answer.path;
    remember_locked();
    return answer;
  } catch (const std::exception& error) {
    const std::lock_guard guard(mutex_);
    shared_back_off_.failed(clock_.now(), {});
    not_shared_ = error.what();
    return {};
  }
}

void AuthorityContact::hurry() {
  {
    const std::lock_guard guard(mutex_);
    hurried_ = true;
  }
  hurrying_.notify_all();
}

AuthorityContact::Time AuthorityContact::limit() {
  const std::lock_guard guard(mutex_);
  catch_up_locked();
  return back_off_.limit();
}

AuthorityContact::Time AuthorityContact::next() {
  const std::lock_guard guard(mutex_);
  catch_up_locked();
  return back_off_.next();
}

AuthorityStatus AuthorityContact::status() const {
  const std::lock_guard guard(mutex_);
  AuthorityStatus status;
  status.name = authority_.name;
  status.path = record_.path;
  if (!shared_since_failure_) {
    status.failures = back_off_.failures();
    status.last_error = record_.last_error;
  }
  status.not_shared = not_shared_;
  status.last_token = record_.last_token;
  status.pause = std::max(nanoseconds(0), nanoseconds(back_off_.next() - clock_.now()));
  return status;
}

std::string AuthorityContact::last_failure() const {
  const std::lock_guard guard(mutex_);
  return record_.last_error;
}

void AuthorityContact::catch_up_locked() {
  if (queue_ == nullptr) return;
  try {
    const std::optional<AuthorityRecord> stored = queue_->authority(authority_.name);
    if (!stored || stored->written == record_.written) return;
    record_ = *stored;
    const UtcTime wall = clock_.utc();
    const Time now = clock_.now();
    back_off_.adopt(stored->failures, now + remaining(stored->limit, stored->written, wall),
                    now + remaining(stored->next, stored->written, wall));
  } catch (const Error&) {  // NOLINT(bugprone-empty-catch): what this process knows by itself is enough
  }
}

void AuthorityContact::remember_locked() {
  if (queue_ == nullptr) return;
  const Time now = clock_.now();
  record_.failures = back_off_.failures();
  record_.written = clock_.utc();
  record_.limit = utc_after(record_.written, back_off_.limit() - now);
  record_.next = utc_after(record_.written, back_off_.next() - now);
  try {
    queue_->remember(authority_.name, record_);
  } catch (const Error&) {  // NOLINT(bugprone-empty-catch): the pauses hold as long as this process lives
  }
}

}  // namespace kiroku::recorder

#include "recorder/authority_contact.h"

#include <algorithm>
#include <utility>

namespace kiroku::recorder {
namespace {

using std::chrono::nanoseconds;

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
      back_off_(authority_.pauses, std::random_device{}()) {}

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
  static const timestamp::TrustStore kNothing;
  std::optional<nanoseconds> leave_alone_for;
  AuthorityAnswer answer = exchange(authority_, trust_ == nullptr ? kNothing : *trust_, clock_, request,
                                    std::move(checkpoint), leave_alone_for);
  const std::lock_guard guard(mutex_);
  if (answer.valid()) {
    back_off_.succeeded();
    record_.last_token = clock_.utc();
    record_.path = answer.path;
  } else {
    const Time now = clock_.now();
    back_off_.failed(now, leave_alone_for);
    answer.pause = back_off_.next() - now;
  }
  record_.last_error = answer.cause;
  remember_locked();
  return answer;
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
  status.failures = back_off_.failures();
  status.last_error = record_.last_error;
  status.last_token = record_.last_token;
  status.pause = std::max(nanoseconds(0), nanoseconds(back_off_.next() - clock_.now()));
  return status;
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

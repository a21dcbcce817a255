#include "recorder/record_stamper.h"

#include <condition_variable>
#include <memory>
#include <mutex>
#include <string>

#include "base/error.h"
#include "recorder/clock/whole_seconds.h"
#include "timestamp/token.h"

namespace kiroku::recorder {
namespace {

/// A pause this short is waited for: authorities allow a request a minute or so.
constexpr std::chrono::minutes kPatience{2};

class RecordAuthorities {
 public:
  RecordAuthorities(const std::vector<NamedAuthority>& authorities, const timestamp::TrustStore* trust,
                    StampingQueue* queue, const Clock& clock)
      : clock_(clock) {
    for (const NamedAuthority& each : authorities) {
      contacts_.push_back(std::make_unique<AuthorityContact>(each, trust, queue, clock));
    }
  }

  Bytes stamp(crypto::HashAlgorithm algorithm, ByteView imprint) {
    Bytes own;
    std::string failures;
    for (const auto& contact : contacts_) {
      const AuthorityAnswer answer = ask(*contact, algorithm, imprint);
      if (!answer.valid()) {
        failures += (failures.empty() ? "" : "; ") + contact->name() + ": " + answer.cause;
        continue;
      }
      std::string ignored;
      const auto response = timestamp::parse_response(answer.response, ignored);
      if (answer.judgement.authority == timestamp::TimeAuthority::kOutside) return response->token;
      if (own.empty()) own = response->token;
    }
    if (own.empty() || !failures.empty()) {
      throw Error((own.empty() ? "" : "no outside authority answered, and the recorder's own is none; ") +
                  failures);
    }
    return own;
  }

 private:
  AuthorityAnswer ask(AuthorityContact& contact, crypto::HashAlgorithm algorithm, ByteView imprint) const {
    const AuthorityContact::Time allowed = contact.limit();
    const Clock::Time now = clock_.now();
    if (allowed <= now + kPatience) {
      std::mutex mutex;
      std::unique_lock lock(mutex);
      std::condition_variable nothing;
      clock_.wait_until(nothing, lock, allowed, [] { return false; });
      return contact.ask_over(algorithm, imprint);
    }
    AuthorityAnswer answer;
    answer.cause = "is to be left alone for another " + whole_seconds(allowed - now);
    return answer;
  }

  std::vector<std::unique_ptr<AuthorityContact>> contacts_;
  const Clock& clock_;
};

}  // namespace

evidence::Stamp record_stamper(const std::vector<NamedAuthority>& authorities,
                               const timestamp::TrustStore* trust, StampingQueue* queue, const Clock& clock) {
  const auto all = std::make_shared<RecordAuthorities>(authorities, trust, queue, clock);
  return [all](crypto::HashAlgorithm algorithm, ByteView imprint) { return all->stamp(algorithm, imprint); };
}

}  // namespace kiroku::recorder

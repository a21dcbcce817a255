#include "recorder/checkpoint_stamper.h"

#include <condition_variable>
#include <future>
#include <memory>
#include <mutex>
#include <string>
#include <utility>

#include "base/error.h"

namespace kiroku::recorder {
namespace {

/// A pause this short is waited for.
constexpr std::chrono::seconds kPatience{2};

class Authorities {
 public:
  Authorities(const std::vector<NamedAuthority>& authorities, const timestamp::TrustStore* trust,
              StampingQueue* queue, const Clock& clock)
      : queue_(queue), clock_(clock) {
    for (const NamedAuthority& each : authorities) {
      contacts_.push_back(std::make_unique<AuthorityContact>(each, trust, queue, clock));
    }
  }

  std::vector<archive::CheckpointStamp> ask(const archive::StoredCheckpoint& over) {
    std::vector<std::future<AuthorityAnswer>> asked;
    asked.reserve(contacts_.size());
    for (const auto& contact : contacts_) {
      asked.push_back(std::async(std::launch::async, [&] { return answer_of(*contact, over); }));
    }
    std::vector<archive::CheckpointStamp> stamps;
    for (auto& each : asked) stamps.push_back(stamp_of(each.get()));
    return stamps;
  }

 private:
  [[nodiscard]] AuthorityAnswer answer_of(AuthorityContact& contact,
                                          const archive::StoredCheckpoint& over) const {
    const AuthorityContact::Time allowed = contact.next();
    if (allowed <= clock_.now() + kPatience) {
      std::mutex mutex;
      std::unique_lock lock(mutex);
      std::condition_variable nothing;
      clock_.wait_until(nothing, lock, allowed, [] { return false; });
      return contact.ask(over);
    }
    AuthorityAnswer answer;
    answer.authority = contact.name();
    answer.checkpoint = over;
    const std::string reason = contact.status().last_error;
    answer.cause = "not asked, since it is to be left alone" + (reason.empty() ? "" : ": " + reason);
    return answer;
  }

  archive::CheckpointStamp stamp_of(AuthorityAnswer answer) {
    remember(answer);
    archive::CheckpointStamp stamp;
    stamp.authority = answer.authority;
    stamp.cause = answer.cause;
    if (answer.valid()) {
      stamp.facts = token_facts(answer);
      stamp.response = std::move(answer.response);
      stamp.chain = std::move(answer.judgement.chain);
    }
    return stamp;
  }

  void remember(const AuthorityAnswer& answer) {
    if (queue_ == nullptr) return;
    const std::filesystem::path folder = answer.checkpoint.file.parent_path().parent_path();
    const std::string case_id = folder.filename().string();
    try {
      if (answer.valid()) {
        queue_->done(case_id, answer.authority, answer.checkpoint.size);
      } else {
        queue_->want(case_id, answer.authority, answer.checkpoint.size, clock_.utc());
        queue_->failed(case_id, answer.authority, answer.cause);
      }
    } catch (const Error&) {  // NOLINT(bugprone-empty-catch): a reminder is lost, the ledger says what is
                              // missing
    }
  }

  std::vector<std::unique_ptr<AuthorityContact>> contacts_;
  StampingQueue* queue_;
  const Clock& clock_;
};

}  // namespace

archive::CheckpointStamper checkpoint_stamper(const std::vector<NamedAuthority>& authorities,
                                              const timestamp::TrustStore* trust, StampingQueue* queue,
                                              const Clock& clock) {
  const auto all = std::make_shared<Authorities>(authorities, trust, queue, clock);
  return [all](const archive::StoredCheckpoint& over) { return all->ask(over); };
}

archive::CheckpointStamper later_stamper(const std::vector<NamedAuthority>& authorities,
                                         StampingQueue& queue) {
  std::vector<std::string> names;
  for (const NamedAuthority& each : authorities) names.push_back(each.name);
  return [names, &queue](const archive::StoredCheckpoint& over) {
    const std::string case_id = over.file.parent_path().parent_path().filename().string();
    std::vector<archive::CheckpointStamp> stamps;
    for (const std::string& name : names) {
      archive::CheckpointStamp stamp;
      stamp.authority = name;
      stamp.cause = "not asked yet, since the operation is recorded on first; asked from then on";
      try {
        queue.want(case_id, name, over.size, utc_now());
      } catch (const Error& error) {
        stamp.cause = std::string("not asked, and not to be asked by itself: ") + error.what();
      }
      stamps.push_back(std::move(stamp));
    }
    return stamps;
  };
}

}  // namespace kiroku::recorder

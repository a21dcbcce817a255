#include "recorder/checkpoint_stamper.h"

#include <chrono>
#include <map>
#include <memory>
#include <string>
#include <utility>

#include "recorder/fact_queue.h"

namespace kiroku::recorder {
namespace {

constexpr std::chrono::milliseconds kPatience{100};

class AskEach {
 public:
  AskEach(std::vector<NamedAuthority> authorities, const timestamp::TrustStore* trust)
      : authorities_(std::move(authorities)), trust_(trust) {}

  std::vector<archive::CheckpointStamp> ask(const archive::StoredCheckpoint& over) {
    std::vector<archive::CheckpointStamp> stamps;
    for (const auto& [name, cause] : silent_) {
      stamps.push_back({name, {}, {}, {}, "not asked again: " + cause});
    }
    FactQueue answers;
    Stamper stamper(authorities_, trust_, answers);
    stamper.stamp(over);
    for (std::size_t left = authorities_.size(); left > 0;) {
      for (Fact& fact : answers.take(kPatience)) {
        stamps.push_back(stamp_of(std::get<AuthorityAnswer>(std::move(fact))));
        --left;
      }
    }
    return stamps;
  }

 private:
  archive::CheckpointStamp stamp_of(AuthorityAnswer answer) {
    archive::CheckpointStamp stamp;
    stamp.authority = answer.authority;
    stamp.cause = answer.cause;
    if (!stamp.cause.empty()) {
      silent_[answer.authority] = answer.cause;
      std::erase_if(authorities_, [&](const NamedAuthority& each) { return each.name == answer.authority; });
      return stamp;
    }
    stamp.response = std::move(answer.response);
    stamp.facts.gen_time = answer.judgement.info->gen_time;
    stamp.facts.accuracy_ns = answer.judgement.info->accuracy_ns;
    stamp.facts.serial = answer.judgement.info->serial;
    stamp.chain = std::move(answer.judgement.chain);
    return stamp;
  }

  std::vector<NamedAuthority> authorities_;
  const timestamp::TrustStore* trust_;
  std::map<std::string, std::string> silent_;  // and why
};

}  // namespace

archive::CheckpointStamper checkpoint_stamper(std::vector<NamedAuthority> authorities,
                                              const timestamp::TrustStore* trust) {
  const auto each = std::make_shared<AskEach>(std::move(authorities), trust);
  return [each](const archive::StoredCheckpoint& over) { return each->ask(over); };
}

}  // namespace kiroku::recorder

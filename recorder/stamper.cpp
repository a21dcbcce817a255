#include "recorder/stamper.h"

#include <condition_variable>
#include <mutex>
#include <optional>
#include <thread>

#include "timestamp/request.h"

namespace kiroku::recorder {
namespace {

AuthorityAnswer ask(const NamedAuthority& authority, const timestamp::TrustStore& trust,
                    archive::StoredCheckpoint checkpoint) {
  AuthorityAnswer answer;
  answer.authority = authority.name;
  const timestamp::Request request =
      timestamp::make_request(crypto::HashAlgorithm::kSha256,
                              crypto::digest(crypto::HashAlgorithm::kSha256, bytes_of(checkpoint.note)));
  answer.checkpoint = std::move(checkpoint);
  try {
    answer.response = authority.source->ask(timestamp::encode_request(request));
    timestamp::Expectation expectation;
    expectation.algorithm = request.algorithm;
    expectation.imprint = request.imprint;
    expectation.nonce = request.nonce;
    answer.judgement = timestamp::judge_token(answer.response, expectation, trust);
    if (answer.judgement.code != timestamp::TokenCode::kValid) answer.cause = answer.judgement.explanation;
  } catch (const std::exception& error) {
    answer.cause = error.what();
  }
  return answer;
}

}  // namespace

struct Stamper::Worker {
  Worker(NamedAuthority named, const timestamp::TrustStore* trusted, FactQueue& queue)
      : authority(std::move(named)), trust(trusted), facts(queue), thread([this] { run(); }) {}
  ~Worker() {
    {
      const std::lock_guard guard(mutex);
      stopping = true;
    }
    changed.notify_all();
    thread.join();
  }

  void run() {
    const timestamp::TrustStore nothing;
    std::unique_lock lock(mutex);
    for (;;) {
      changed.wait(lock, [&] { return stopping || next.has_value(); });
      if (!next) return;
      archive::StoredCheckpoint checkpoint = std::move(*next);
      next.reset();
      lock.unlock();
      AuthorityAnswer answer = ask(authority, trust == nullptr ? nothing : *trust, std::move(checkpoint));
      lock.lock();
      facts.push(std::move(answer));
      busy = next.has_value();
    }
  }

  NamedAuthority authority;
  const timestamp::TrustStore* trust;
  FactQueue& facts;
  mutable std::mutex mutex;
  std::condition_variable changed;
  std::optional<archive::StoredCheckpoint> next;
  bool busy = false;
  bool stopping = false;
  std::thread thread;
};

Stamper::Stamper(std::vector<NamedAuthority> authorities, const timestamp::TrustStore* trust,
                 FactQueue& facts) {
  for (NamedAuthority& authority : authorities)
    workers_.push_back(std::make_unique<Worker>(std::move(authority), trust, facts));
}

Stamper::~Stamper() = default;

void Stamper::stamp(const archive::StoredCheckpoint& checkpoint) {
  for (const auto& worker : workers_) {
    {
      const std::lock_guard guard(worker->mutex);
      worker->next = checkpoint;
      worker->busy = true;
    }
    worker->changed.notify_all();
  }
}

std::size_t Stamper::outstanding() const {
  std::size_t count = 0;
  for (const auto& worker : workers_) {
    const std::lock_guard guard(worker->mutex);
    count += worker->busy ? 1U : 0U;
  }
  return count;
}

}  // namespace kiroku::recorder

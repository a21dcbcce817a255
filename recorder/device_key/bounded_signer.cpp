#include "recorder/device_key/bounded_signer.h"

#include <condition_variable>
#include <exception>
#include <optional>
#include <string>
#include <system_error>
#include <utility>

namespace kiroku::recorder {

struct BoundedSigner::Shared {
  explicit Shared(Ask how) : ask(std::move(how)) {}
  const Ask ask;
  std::mutex mutex;
  std::condition_variable changed;
  std::optional<Bytes> request;  // taken out when it is answered
  std::optional<Answer> answer;
  bool given_up = false;  // nobody waits for the answer to the request any more
  bool ended = false;
};

BoundedSigner::BoundedSigner(crypto::P256PublicKey public_key, Ask ask,
                             std::chrono::milliseconds longest_wait)
    : public_key_(std::move(public_key)),
      longest_wait_(longest_wait),
      shared_(std::make_shared<Shared>(std::move(ask))) {}

BoundedSigner::~BoundedSigner() {
  if (!worker_.joinable()) return;
  bool hangs = false;
  {
    const std::lock_guard guard(shared_->mutex);
    shared_->ended = true;
    hangs = shared_->request.has_value();
  }
  shared_->changed.notify_all();
  if (hangs)
    worker_.detach();
  else
    worker_.join();
}

void BoundedSigner::work(const std::shared_ptr<Shared>& shared) {
  std::unique_lock lock(shared->mutex);
  while (true) {
    shared->changed.wait(lock, [&] { return shared->ended || shared->request; });
    if (shared->ended) return;
    const Bytes message = *shared->request;
    lock.unlock();
    Answer answer;
    try {
      answer.signature = shared->ask(message);
    } catch (const std::exception& error) {
      answer.why = error.what();
    }
    lock.lock();
    shared->request.reset();
    if (!std::exchange(shared->given_up, false)) shared->answer = std::move(answer);
    shared->changed.notify_all();
  }
}

crypto::HardwareSigner::Answer BoundedSigner::sign(ByteView message) const {
  const auto deadline = std::chrono::steady_clock::now() + longest_wait_;
  const std::string within = " within " + std::to_string(longest_wait_.count()) + " ms";
  const std::unique_lock turn(turn_, deadline);
  if (!turn.owns_lock()) return {{}, "it did not answer earlier requests" + within};
  std::unique_lock lock(shared_->mutex);
  if (shared_->request) return {{}, "it has not answered an earlier request yet"};
  try {
    if (!worker_.joinable()) worker_ = std::thread(work, shared_);
  } catch (const std::system_error& error) {
    return {{}, std::string("no thread could be started that asks it: ") + error.what()};
  }
  shared_->request = to_bytes(message);
  shared_->answer.reset();
  shared_->changed.notify_all();
  if (shared_->changed.wait_until(lock, deadline, [&] { return shared_->answer.has_value(); }))
    return *std::exchange(shared_->answer, std::nullopt);
  shared_->given_up = true;
  return {{}, "it did not answer" + within};
}

}  // namespace kiroku::recorder

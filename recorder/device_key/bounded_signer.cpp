#include "recorder/device_key/bounded_signer.h"

#include <exception>
#include <string>
#include <utility>

namespace kiroku::recorder {

BoundedAttester::BoundedAttester(Bytes public_area, Ask ask, std::shared_ptr<BoundedThread> thread)
    : public_area_(std::move(public_area)), ask_(std::move(ask)), thread_(std::move(thread)) {}

crypto::BootAttester::Answer BoundedAttester::quote(const crypto::Sha256Digest& qualifying_data) const {
  const auto answer = std::make_shared<Answer>();
  const std::string late = thread_->run([answer, ask = ask_, qualifying_data] {
    try {
      answer->quote = ask(qualifying_data);
    } catch (const std::exception& error) {
      answer->why = error.what();
    }
  });
  if (!late.empty()) return {std::nullopt, late};
  if (answer->quote) {
    std::string why = crypto::why_no_quote(*answer->quote, public_area_, qualifying_data);
    if (!why.empty()) return {std::nullopt, std::move(why)};
  }
  return std::move(*answer);
}

BoundedSigner::BoundedSigner(crypto::P256PublicKey public_key, Ask ask,
                             std::chrono::milliseconds longest_wait)
    : BoundedSigner(std::move(public_key), std::move(ask), std::make_shared<BoundedThread>(longest_wait),
                    nullptr) {}

BoundedSigner::BoundedSigner(crypto::P256PublicKey public_key, Ask ask, std::shared_ptr<BoundedThread> thread,
                             std::unique_ptr<BoundedAttester> attester)
    : public_key_(std::move(public_key)),
      ask_(std::move(ask)),
      thread_(std::move(thread)),
      attester_(std::move(attester)) {}

crypto::HardwareSigner::Answer BoundedSigner::sign(ByteView message) const {
  const auto answer = std::make_shared<Answer>();
  std::string late = thread_->run([answer, ask = ask_, message = to_bytes(message)] {
    try {
      answer->signature = ask(message);
    } catch (const std::exception& error) {
      answer->why = error.what();
    }
  });
  if (!late.empty()) return {{}, std::move(late)};
  return std::move(*answer);
}

}  // namespace kiroku::recorder

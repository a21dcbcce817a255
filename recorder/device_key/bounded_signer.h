// Hardware that signs, asked by a thread of its own: whoever signs a checkpoint waits a bounded time, also
// where the hardware hangs. Thread-safe.
#pragma once

#include <chrono>
#include <functional>
#include <memory>
#include <mutex>
#include <thread>

#include "crypto/hardware_key.h"

namespace kiroku::recorder {

class BoundedSigner : public crypto::HardwareSigner {
 public:
  /// Asks the hardware, for as long as it takes; DER. Throws kiroku::Error. Called by one thread at a time,
  /// and may outlive the signer: that thread is left behind where it hangs.
  using Ask = std::function<Bytes(ByteView message)>;
  /// A TPM takes up to some hundreds of milliseconds.
  static constexpr std::chrono::milliseconds kLongestWait{3000};

  BoundedSigner(crypto::P256PublicKey public_key, Ask ask,
                std::chrono::milliseconds longest_wait = kLongestWait);
  ~BoundedSigner() override;
  [[nodiscard]] const crypto::P256PublicKey& public_key() const override { return public_key_; }
  /// While an earlier request is still unanswered it says so at once. It waits for its turn and for the
  /// hardware no longer than the longest wait together.
  [[nodiscard]] Answer sign(ByteView message) const override;

 private:
  struct Shared;
  static void work(const std::shared_ptr<Shared>& shared);

  crypto::P256PublicKey public_key_;
  std::chrono::milliseconds longest_wait_;
  std::shared_ptr<Shared> shared_;
  mutable std::timed_mutex turn_;
  mutable std::thread worker_;  // from the first signature on
};

}  // namespace kiroku::recorder

// Hardware that signs, and a TPM that quotes the measured boot, asked by a thread of their own: whoever signs
// a checkpoint or enters a boot waits a bounded time, also where the hardware hangs. Thread-safe.
#pragma once

#include <chrono>
#include <functional>
#include <memory>

#include "crypto/hardware_key.h"
#include "crypto/tpm_quote.h"
#include "recorder/device_key/bounded_thread.h"

namespace kiroku::recorder {

class BoundedAttester : public crypto::BootAttester {
 public:
  /// As BoundedSigner::Ask.
  using Ask = std::function<Quote(const crypto::Sha256Digest& qualifying_data)>;

  BoundedAttester(Bytes public_area, Ask ask, std::shared_ptr<BoundedThread> thread);
  [[nodiscard]] const Bytes& public_area() const override { return public_area_; }
  /// Checked: a quote that does not hold would read as a forgery.
  [[nodiscard]] Answer quote(const crypto::Sha256Digest& qualifying_data) const override;

 private:
  Bytes public_area_;
  Ask ask_;
  std::shared_ptr<BoundedThread> thread_;
};

class BoundedSigner : public crypto::HardwareSigner {
 public:
  /// Asks the hardware, for as long as it takes; DER. Throws kiroku::Error. Called by one thread at a time,
  /// and may outlive the signer: that thread is left behind where it hangs.
  using Ask = std::function<Bytes(ByteView message)>;

  BoundedSigner(crypto::P256PublicKey public_key, Ask ask,
                std::chrono::milliseconds longest_wait = BoundedThread::kLongestWait);
  /// `thread` is shared with whatever else asks the same hardware. `attester` may be null.
  BoundedSigner(crypto::P256PublicKey public_key, Ask ask, std::shared_ptr<BoundedThread> thread,
                std::unique_ptr<BoundedAttester> attester);
  [[nodiscard]] const crypto::P256PublicKey& public_key() const override { return public_key_; }
  [[nodiscard]] Answer sign(ByteView message) const override;
  [[nodiscard]] const crypto::BootAttester* attester() const override { return attester_.get(); }

 private:
  crypto::P256PublicKey public_key_;
  Ask ask_;
  std::shared_ptr<BoundedThread> thread_;
  std::unique_ptr<BoundedAttester> attester_;
};

}  // namespace kiroku::recorder

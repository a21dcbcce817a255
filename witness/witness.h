// A witness of logs (C2SP tlog-witness.md): cosigns a checkpoint only where it goes on from the newest one
// that it cosigned of that log. It trusts nothing of whoever asks: the log's key and the proof decide.
// Thread-safe.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>

#include "base/clock.h"
#include "crypto/cosignature.h"
#include "crypto/cosigning_key.h"
#include "witness/store.h"

namespace kiroku::witness {

/// What a request came to, as HTTP says it.
struct Answer {
  int status = 200;
  std::string content_type = "text/plain; charset=utf-8";
  std::string body;
};

class Witness {
 public:
  /// `store`, `key` and `time` must outlive it.
  Witness(Store& store, const std::string& name, const crypto::CosigningKey& key,
          const Clock& time = Clock::system());

  /// 200 with a signature line; 400 for what is no submission, an old size above the checkpoint's, or a log's
  /// name that is too long for ML-DSA-44; 404 for
  /// a log that is not known; 403 where none of the log's keys signed, or one did wrongly; 409, with the size
  /// that is known as text/x.tlog.size, for another old size; 422 where the proof does not hold. What was
  /// cosigned is durable before the answer. What was cosigned less than a minute ago is answered with the
  /// same line. Throws kiroku::Error where it cannot be stored.
  [[nodiscard]] Answer add_checkpoint(std::string_view body);
  /// The newest checkpoint of the log, with the log's signature and the witness's; 404 where there is none.
  /// `origin_hash` is the SHA-256 of the log's origin, in hex.
  [[nodiscard]] Answer checkpoint(const std::string& origin_hash) const;
  [[nodiscard]] const crypto::CosignerKey& key() const { return public_key_; }

 private:
  Store& store_;
  const crypto::CosigningKey& key_;
  const crypto::CosignerKey public_key_;
  const Clock& time_;
};

}  // namespace kiroku::witness

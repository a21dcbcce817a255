// A forger at work while a sealed file is read. Functions; thread-safe.
#pragma once

#include <filesystem>
#include <fstream>
#include <functional>
#include <iterator>
#include <memory>
#include <string>
#include <utility>

#include "crypto/age_file.h"
#include "crypto/age_file_key.h"

namespace kiroku::test {

/// Opens what `real` opens, and lets somebody act at that moment: whoever checks a file has hashed it by
/// then, and has read its header, and nothing of its payload is decrypted yet.
class ObservedIdentity final : public crypto::AgeIdentity {
 public:
  ObservedIdentity(std::shared_ptr<const crypto::AgeIdentity> real, std::function<void()> act)
      : real_(std::move(real)), act_(std::move(act)) {}
  [[nodiscard]] std::optional<crypto::Secret> unwrap(
      const std::vector<crypto::AgeStanza>& stanzas) const override {
    act_();
    return real_->unwrap(stanzas);
  }
  [[nodiscard]] std::string recipient() const override { return real_->recipient(); }

 private:
  std::shared_ptr<const crypto::AgeIdentity> real_;
  std::function<void()> act_;
};

inline crypto::AgeIdentities observed(const crypto::AgeIdentities& real, const std::function<void()>& act) {
  return {std::make_shared<const ObservedIdentity>(real.at(0), act)};
}

inline std::string bytes_in(const std::filesystem::path& file) {
  std::ifstream input(file, std::ios::binary);
  return {std::istreambuf_iterator<char>(input), {}};
}

/// Other bytes in the same file: no name changes, and whoever holds it open reads them.
inline void write_into(const std::filesystem::path& file, const std::string& bytes) {
  std::ofstream(file, std::ios::binary | std::ios::trunc) << bytes;
}

/// Another film sealed to the same recipients.
inline std::string sealed_anew(ByteView plaintext, const crypto::AgeRecipients& recipients) {
  return std::string(text_of(crypto::seal_bytes(plaintext, recipients)));
}

/// Another film under the header and nonce that are there: what a holder of the file key makes, and what no
/// decryption tells from the film that was sealed.
inline std::string resealed(const std::string& sealed, const crypto::AgeIdentities& identities,
                            ByteView plaintext) {
  const auto source = crypto::memory_source(bytes_of(sealed));
  const crypto::AgeHeader header = crypto::read_age_header(*source);
  std::string result = sealed.substr(0, header.size + crypto::kAgePayloadNonceSize);
  const auto key = crypto::age_payload_key(crypto::unwrap_file_key(header, identities),
                                           bytes_of(result).subspan(header.size));
  crypto::AgeStreamWriter payload(key.bytes(), [&](ByteView piece) { result += text_of(piece); });
  payload.write(plaintext);
  payload.finish();
  return result;
}

}  // namespace kiroku::test

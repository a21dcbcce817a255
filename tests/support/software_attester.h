// A key that quotes a boot as a TPM does, in this process: for tests of whoever asks it. It can fall silent,
// start anew and lie.
#pragma once

#include <array>
#include <atomic>

#include "crypto/hash.h"
#include "crypto/tpm_quote.h"
#include "tests/support/software_hardware_key.h"

namespace kiroku::test {

class SoftwareAttester : public crypto::BootAttester {
 public:
  SoftwareAttester() {
    // TPMT_PUBLIC: its head, and the point at the end of the DER.
    area_ = to_bytes(std::as_bytes(std::span(kHead)));
    const ByteView point = ByteView(key_.public_key()).last(64);
    for (const ByteView coordinate : {point.first(32), point.last(32)}) {
      append_number<std::uint16_t>(area_, 32);
      append(area_, coordinate);
    }
  }
  [[nodiscard]] const Bytes& public_area() const override { return area_; }
  [[nodiscard]] Answer quote(const crypto::Sha256Digest& qualifying_data) const override {
    ++asked_;
    if (silent_) return {std::nullopt, "the test keeps it silent"};
    std::string problem;
    const Bytes signer = crypto::parse_attestation_key(area_, problem).value().qualified_name;
    Bytes attest;
    append_number<std::uint32_t>(attest, 0xff544347);
    append_number<std::uint16_t>(attest, 0x8018);
    append_number(attest, static_cast<std::uint16_t>(signer.size()));
    append(attest, signer);
    append_number(attest, static_cast<std::uint16_t>(qualifying_data.size()));
    append(attest, qualifying_data);
    append_number<std::uint64_t>(attest, 1000U * boots_);
    append_number<std::uint32_t>(attest, boots_);
    append_number<std::uint32_t>(attest, 0);
    append_number<std::uint8_t>(attest, 1);
    append_number<std::uint64_t>(attest, 7);
    append_number<std::uint32_t>(attest, 1);
    append_number<std::uint16_t>(attest, 0x000b);
    constexpr std::array<std::uint8_t, 4> kPcrs0To7{3, 0xff, 0, 0};
    for (const std::uint8_t each : kPcrs0To7) append_number(attest, each);
    std::vector<crypto::PcrValue> pcrs;
    for (unsigned index = 0; index < 8; ++index)
      pcrs.push_back({index, index == 4 ? loader_ : crypto::sha256(bytes_of("firmware"))});
    append_number<std::uint16_t>(attest, 32);
    append(attest, crypto::digest_of_pcrs(pcrs));
    Bytes signature = key_.sign(attest).signature;
    return {Quote{std::move(attest), std::move(signature), pcrs}, {}};
  }
  void fall_silent(bool silent = true) { silent_ = silent; }
  /// The machine starts anew, with this boot loader.
  void start(std::string_view loader) {
    ++boots_;
    loader_ = crypto::sha256(bytes_of(loader));
  }
  [[nodiscard]] int asked() const { return asked_; }

 private:
  template <typename Number>
  static void append_number(Bytes& bytes, Number number) {
    for (std::size_t i = sizeof(Number); i-- > 0;)
      bytes.push_back(static_cast<std::byte>(static_cast<std::uint64_t>(number) >> (8 * i)));
  }
  static constexpr std::array<unsigned char, 20> kHead{
      0, 0x23, 0,    0x0b,   // a key on a curve, named by SHA-256
      0, 0x05, 0x04, 0x72,   // restricted, signs, no dictionary attacks, made and kept by the TPM
      0, 0,                  // without a policy
      0, 0x10,               // without a cipher
      0, 0x18, 0,    0x0b,   // ECDSA with SHA-256
      0, 0x03, 0,    0x10};  // P-256, derives no key
  SoftwareHardwareKey key_;
  Bytes area_;
  std::uint32_t boots_ = 1;
  crypto::Sha256Digest loader_ = crypto::sha256(bytes_of("loader"));
  std::atomic<bool> silent_ = false;
  mutable std::atomic<int> asked_ = 0;
};

/// A key in hardware with an attester beside.
class SoftwareTpmKey : public SoftwareHardwareKey {
 public:
  [[nodiscard]] const crypto::BootAttester* attester() const override { return &attester_; }
  SoftwareAttester& its_attester() { return attester_; }

 private:
  SoftwareAttester attester_;
};

}  // namespace kiroku::test

#include "recorder/device_key/hardware_description.h"

#include <nlohmann/json.hpp>

#include "base/error.h"
#include "crypto/encoding.h"
#include "crypto/secret.h"
#include "recorder/device_key/bounded_signer.h"
#include "recorder/device_key/pkcs11_key.h"
#include "recorder/device_key/tpm_key.h"

namespace kiroku::recorder {
namespace {

using nlohmann::ordered_json;

constexpr std::size_t kKeyNameSize = 32;
constexpr const char* kTpm = "tpm";
constexpr const char* kPkcs11 = "pkcs11";

}  // namespace

std::string HardwareDescription::to_json() const {
  ordered_json written{{"kind", kind == Kind::kTpm ? kTpm : kPkcs11},
                       {"address", address},
                       {"key", crypto::to_hex(key)},
                       {"public_key", crypto::to_base64(public_key, crypto::Base64Padding::kPadded)}};
  if (!attestation_key.empty())
    written["attestation_key"] = crypto::to_base64(attestation_key, crypto::Base64Padding::kPadded);
  return written.dump(2) + "\n";
}

HardwareDescription HardwareDescription::parse(std::string_view json) {
  const auto refuse = [](const std::string& why) {
    return Error("it is no description of hardware: " + why);
  };
  const ordered_json read = ordered_json::parse(json, nullptr, false);
  if (!read.is_object()) throw refuse("it is no JSON object");
  const auto text = [&](const char* field) {
    if (!read.contains(field) || !read.at(field).is_string())
      throw refuse(std::string("it has no text \"") + field + "\"");
    return read.at(field).get<std::string>();
  };
  HardwareDescription description;
  const std::string kind = text("kind");
  if (kind != kTpm && kind != kPkcs11) throw refuse("its \"kind\" is neither tpm nor pkcs11");
  description.kind = kind == kTpm ? Kind::kTpm : Kind::kPkcs11;
  description.address = text("address");
  const auto key = crypto::from_hex(text("key"));
  const auto public_key = crypto::from_base64(text("public_key"), crypto::Base64Padding::kPadded);
  if (!key || key->size() != kKeyNameSize) throw refuse("its \"key\" is not 32 bytes in hex digits");
  if (!public_key || !crypto::is_p256_public_key(*public_key))
    throw refuse("its \"public_key\" is no key on P-256");
  description.key = *key;
  description.public_key = *public_key;
  if (read.contains("attestation_key")) {
    std::string problem = "it is no base64";
    const auto area = crypto::from_base64(text("attestation_key"), crypto::Base64Padding::kPadded);
    if (description.kind != Kind::kTpm || !area || !crypto::parse_attestation_key(*area, problem))
      throw refuse("its \"attestation_key\" is none of a TPM: " + problem);
    description.attestation_key = *area;
  }
  return description;
}

HardwareDescription make_hardware_key(HardwareDescription::Kind kind, const std::string& address) {
  HardwareDescription made{kind, address, to_bytes(crypto::Secret::random(kKeyNameSize).bytes()), {}};
  made.public_key = kind == HardwareDescription::Kind::kTpm ? TpmKey(address, made.key).public_key()
                                                            : Pkcs11Key(address, made.key).generate();
  return made;
}

Bytes find_attestation_key(const HardwareDescription& description) {
  if (description.kind != HardwareDescription::Kind::kTpm) throw Error("a token quotes no boot");
  TpmKey key(description.address, description.key);
  if (key.public_key() != description.public_key)
    throw Error("the TPM does not hold the device's key: it was cleared, or is another machine's");
  Bytes area = key.attestation_key();
  const crypto::Sha256Digest question = crypto::sha256(bytes_of("kiroku\n"));
  const std::string why = crypto::why_no_quote(key.quote(question), area, question);
  if (!why.empty()) throw Error(why);
  return area;
}

std::shared_ptr<const crypto::HardwareSigner> hardware_signer(const HardwareDescription& description) {
  BoundedSigner::Ask ask;
  const auto thread = std::make_shared<BoundedThread>();
  std::unique_ptr<BoundedAttester> attester;
  if (description.kind == HardwareDescription::Kind::kTpm) {
    const auto key = std::make_shared<TpmKey>(description.address, description.key);
    ask = [key](ByteView message) { return key->sign(message); };
    if (!description.attestation_key.empty()) {
      attester = std::make_unique<BoundedAttester>(
          description.attestation_key,
          [key](const crypto::Sha256Digest& qualifying_data) { return key->quote(qualifying_data); }, thread);
    }
  } else {
    const auto key = std::make_shared<Pkcs11Key>(description.address, description.key);
    ask = [key](ByteView message) { return key->sign(message); };
  }
  return std::make_shared<BoundedSigner>(description.public_key, std::move(ask), thread, std::move(attester));
}

}  // namespace kiroku::recorder

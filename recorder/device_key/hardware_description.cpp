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
  return ordered_json{{"kind", kind == Kind::kTpm ? kTpm : kPkcs11},
                      {"address", address},
                      {"key", crypto::to_hex(key)},
                      {"public_key", crypto::to_base64(public_key, crypto::Base64Padding::kPadded)}}
             .dump(2) +
         "\n";
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
  return description;
}

HardwareDescription make_hardware_key(HardwareDescription::Kind kind, const std::string& address) {
  HardwareDescription made{kind, address, to_bytes(crypto::Secret::random(kKeyNameSize).bytes()), {}};
  made.public_key = kind == HardwareDescription::Kind::kTpm ? TpmKey(address, made.key).public_key()
                                                            : Pkcs11Key(address, made.key).generate();
  return made;
}

std::shared_ptr<const crypto::HardwareSigner> hardware_signer(const HardwareDescription& description) {
  BoundedSigner::Ask ask;
  if (description.kind == HardwareDescription::Kind::kTpm) {
    const auto key = std::make_shared<TpmKey>(description.address, description.key);
    ask = [key](ByteView message) { return key->sign(message); };
  } else {
    const auto key = std::make_shared<Pkcs11Key>(description.address, description.key);
    ask = [key](ByteView message) { return key->sign(message); };
  }
  return std::make_shared<BoundedSigner>(description.public_key, std::move(ask));
}

}  // namespace kiroku::recorder

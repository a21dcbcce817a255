#include "recorder/device_key/hardware_description.h"

#include <algorithm>

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

std::optional<SealedTo> sealed_to(const HardwareDescription& description,
                                  const std::filesystem::path& approvals) {
  if (!description.seal) return std::nullopt;
  return SealedTo{*description.seal, approvals};
}

}  // namespace

std::string HardwareDescription::to_json() const {
  ordered_json written{{"kind", kind == Kind::kTpm ? kTpm : kPkcs11},
                       {"address", address},
                       {"key", crypto::to_hex(key)},
                       {"public_key", crypto::to_base64(public_key, crypto::Base64Padding::kPadded)}};
  if (!attestation_key.empty())
    written["attestation_key"] = crypto::to_base64(attestation_key, crypto::Base64Padding::kPadded);
  if (seal) {
    written["sealed_to_boot"] = {
        {"approval_key", crypto::to_base64(seal->approver, crypto::Base64Padding::kPadded)},
        {"pcrs", seal->pcrs}};
  }
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
  if (read.contains("sealed_to_boot")) {
    const ordered_json& stated = read.at("sealed_to_boot");
    const bool has_form = description.kind == Kind::kTpm && stated.is_object() &&
                          stated.contains("approval_key") && stated.at("approval_key").is_string() &&
                          stated.contains("pcrs") && stated.at("pcrs").is_array();
    if (!has_form) throw refuse("its \"sealed_to_boot\" is no approval key and registers of a TPM");
    const auto approver =
        crypto::from_base64(stated.at("approval_key").get<std::string>(), crypto::Base64Padding::kPadded);
    if (!approver || !crypto::is_p256_public_key(*approver))
      throw refuse("its \"approval_key\" is no key on P-256");
    crypto::BootSeal seal{*approver, {}, crypto::boot_seal_tag(description.key)};
    for (const ordered_json& each : stated.at("pcrs")) {
      const auto index = each.is_number_unsigned() ? each.get<std::uint64_t>() : crypto::kPcrs;
      if (index >= crypto::kPcrs || (!seal.pcrs.empty() && seal.pcrs.back() >= index))
        throw refuse("its \"pcrs\" are not registers of 0 to 23 in ascending order");
      seal.pcrs.push_back(static_cast<unsigned>(index));
    }
    if (seal.pcrs.empty()) throw refuse("its \"pcrs\" name no register");
    description.seal = std::move(seal);
  }
  return description;
}

HardwareDescription make_hardware_key(HardwareDescription::Kind kind, const std::string& address) {
  HardwareDescription made{kind, address, to_bytes(crypto::Secret::random(kKeyNameSize).bytes()), {}};
  made.public_key = kind == HardwareDescription::Kind::kTpm ? TpmKey(address, made.key).public_key()
                                                            : Pkcs11Key(address, made.key).generate();
  return made;
}

void require_sealable(const std::vector<unsigned>& pcrs) {
  for (const unsigned each : pcrs) {
    if (std::find(kQuotedPcrs.begin(), kQuotedPcrs.end(), each) != kQuotedPcrs.end()) continue;
    throw UsageError(
        "no key can be sealed to register " + std::to_string(each) +
        ", which changes while the machine runs, or can be set back by a program: choose among 0 "
        "to 9 and 14");
  }
  constexpr unsigned kWhatFirmwareStarted = 4;
  if (std::find(pcrs.begin(), pcrs.end(), kWhatFirmwareStarted) != pcrs.end()) return;
  throw UsageError(
      "a seal without register 4, which holds what the firmware started, holds no other boot loader off: "
      "registers 8, 9 and 14 are extended by that loader itself, with what it likes, and the others say "
      "nothing of it; name 4, too");
}

HardwareDescription make_sealed_key(const std::string& tcti, const crypto::P256PublicKey& approver,
                                    const std::vector<unsigned>& pcrs) {
  require_sealable(pcrs);
  HardwareDescription made{
      HardwareDescription::Kind::kTpm, tcti, to_bytes(crypto::Secret::random(kKeyNameSize).bytes()), {}};
  made.seal = crypto::BootSeal{approver, pcrs, crypto::boot_seal_tag(made.key)};
  made.public_key = TpmKey(tcti, made.key, sealed_to(made, {})).public_key();
  return made;
}

std::vector<crypto::PcrValue> read_registers(const std::string& tcti, const std::vector<unsigned>& pcrs) {
  struct Answer {
    std::vector<crypto::PcrValue> values;
    std::string why;
  };
  const auto answer = std::make_shared<Answer>();
  const std::string late = BoundedThread().run([answer, tcti, pcrs] {
    try {
      answer->values = TpmKey(tcti, {}).registers(pcrs);
    } catch (const std::exception& error) {
      answer->why = error.what();
    }
  });
  if (!late.empty()) throw Error("the TPM at " + tcti + ": " + late);
  if (!answer->why.empty()) throw Error(answer->why);
  return std::move(answer->values);
}

Bytes find_attestation_key(const HardwareDescription& description) {
  if (description.kind != HardwareDescription::Kind::kTpm) throw Error("a token quotes no boot");
  TpmKey key(description.address, description.key, sealed_to(description, {}));
  if (key.public_key() != description.public_key)
    throw Error("the TPM does not hold the device's key: it was cleared, or is another machine's");
  Bytes area = key.attestation_key();
  const crypto::Sha256Digest question = crypto::sha256(bytes_of("kiroku\n"));
  const std::string why = crypto::why_no_quote(key.quote(question), area, question);
  if (!why.empty()) throw Error(why);
  return area;
}

std::shared_ptr<const crypto::HardwareSigner> hardware_signer(const HardwareDescription& description,
                                                              const std::filesystem::path& approvals) {
  BoundedSigner::Ask ask;
  const auto thread = std::make_shared<BoundedThread>();
  std::unique_ptr<BoundedAttester> attester;
  if (description.kind == HardwareDescription::Kind::kTpm) {
    const auto key =
        std::make_shared<TpmKey>(description.address, description.key, sealed_to(description, approvals));
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

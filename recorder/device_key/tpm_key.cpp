#include "recorder/device_key/tpm_key.h"

#include <algorithm>
#include <array>
#include <cstdlib>
#include <cstring>
#include <optional>
#include <span>
#include <tss2/tss2_esys.h>
#include <tss2/tss2_mu.h>
#include <tss2/tss2_rc.h>
#include <tss2/tss2_tctildr.h>
#include <vector>

#include "base/error.h"
#include "crypto/hash.h"
#include "recorder/device_key/boot_approval.h"

namespace kiroku::recorder {
namespace {

// The library writes lines to standard error for what is answered here in a sentence. It reads this once, and
// no thread runs yet.
[[maybe_unused]] const int kQuiet = ::setenv("TSS2_LOG", "all+none", 0);

struct EsysFree {
  void operator()(void* memory) const { Esys_Free(memory); }
};
template <typename T>
using EsysOwned = std::unique_ptr<T, EsysFree>;

void check(TSS2_RC code, const char* what) {
  if (code != TSS2_RC_SUCCESS)
    throw Error(std::string("the TPM cannot ") + what + ": " + Tss2_RC_Decode(code));
}

ByteView bytes_in(const TPM2B_ECC_PARAMETER& value) {
  return std::as_bytes(std::span(value.buffer, value.size));
}

constexpr UINT8 kSelectBytes = crypto::kPcrs / 8;

enum class Purpose { kSignsAnything, kAttests };

/// `seal` may be null, and counts for the key that signs.
TPM2B_PUBLIC template_with(ByteView unique, Purpose purpose, const crypto::BootSeal* seal) {
  TPM2B_PUBLIC wanted{};
  TPMT_PUBLIC& area = wanted.publicArea;
  area.type = TPM2_ALG_ECC;
  area.nameAlg = TPM2_ALG_SHA256;
  area.objectAttributes = TPMA_OBJECT_FIXEDTPM | TPMA_OBJECT_FIXEDPARENT | TPMA_OBJECT_SENSITIVEDATAORIGIN |
                          TPMA_OBJECT_USERWITHAUTH | TPMA_OBJECT_NODA | TPMA_OBJECT_SIGN_ENCRYPT;
  if (purpose == Purpose::kAttests) {
    area.objectAttributes |= TPMA_OBJECT_RESTRICTED;
  } else if (seal != nullptr) {
    // Its empty password opens nothing of it any more.
    area.objectAttributes &= ~TPMA_OBJECT_USERWITHAUTH;
    area.objectAttributes |= TPMA_OBJECT_ADMINWITHPOLICY;
    const crypto::Sha256Digest policy = crypto::seal_policy(*seal);
    area.authPolicy.size = static_cast<UINT16>(policy.size());
    std::memcpy(area.authPolicy.buffer, policy.data(), policy.size());
  }
  area.parameters.eccDetail.symmetric.algorithm = TPM2_ALG_NULL;
  area.parameters.eccDetail.scheme.scheme = TPM2_ALG_ECDSA;
  area.parameters.eccDetail.scheme.details.ecdsa.hashAlg = TPM2_ALG_SHA256;
  area.parameters.eccDetail.curveID = TPM2_ECC_NIST_P256;
  area.parameters.eccDetail.kdf.scheme = TPM2_ALG_NULL;
  if (unique.size() > sizeof area.unique.ecc.x.buffer) throw Error("a TPM key's template is too long");
  area.unique.ecc.x.size = static_cast<UINT16>(unique.size());
  std::memcpy(area.unique.ecc.x.buffer, unique.data(), unique.size());
  return wanted;
}

/// A key in the TPM, as long as this object lives: a TPM has room for three.
class LoadedKey {
 public:
  LoadedKey(ESYS_CONTEXT* tpm, ByteView unique, Purpose purpose, const crypto::BootSeal* seal = nullptr)
      : tpm_(tpm) {
    const TPM2B_SENSITIVE_CREATE no_secret{};
    const TPM2B_DATA nothing{};
    const TPML_PCR_SELECTION no_registers{};
    const TPM2B_PUBLIC wanted = template_with(unique, purpose, seal);
    TPM2B_PUBLIC* made = nullptr;
    check(Esys_CreatePrimary(tpm, ESYS_TR_RH_OWNER, ESYS_TR_PASSWORD, ESYS_TR_NONE, ESYS_TR_NONE, &no_secret,
                             &wanted, &nothing, &no_registers, &handle_, &made, nullptr, nullptr, nullptr),
          "make its key");
    public_area_.reset(made);
  }
  LoadedKey(const LoadedKey&) = delete;
  LoadedKey& operator=(const LoadedKey&) = delete;
  ~LoadedKey() { Esys_FlushContext(tpm_, handle_); }
  [[nodiscard]] ESYS_TR handle() const { return handle_; }
  [[nodiscard]] const TPMT_PUBLIC& public_area() const { return public_area_->publicArea; }

 private:
  ESYS_CONTEXT* tpm_;
  ESYS_TR handle_ = ESYS_TR_NONE;
  EsysOwned<TPM2B_PUBLIC> public_area_;
};

Bytes der_of(const TPMT_SIGNATURE& signature) {
  const TPMS_SIGNATURE_ECC& numbers = signature.signature.ecdsa;
  return crypto::ecdsa_signature(bytes_in(numbers.signatureR), bytes_in(numbers.signatureS));
}

/// Of the SHA-256 bank.
TPML_PCR_SELECTION selection_of(std::span<const unsigned> pcrs) {
  TPML_PCR_SELECTION selection{};
  selection.count = 1;
  TPMS_PCR_SELECTION& bank = selection.pcrSelections[0];
  bank.hash = TPM2_ALG_SHA256;
  bank.sizeofSelect = kSelectBytes;
  for (const unsigned each : pcrs) bank.pcrSelect[each / 8] |= static_cast<BYTE>(1U << each % 8);
  return selection;
}

std::vector<crypto::PcrValue> read_pcrs(ESYS_CONTEXT* tpm, std::span<const unsigned> pcrs) {
  std::vector<crypto::PcrValue> values;
  // A TPM gives as many at once as it likes (part 3, TPM2_PCR_Read), eight at most.
  constexpr std::size_t kAtOnce = 8;
  for (std::size_t from = 0; from < pcrs.size(); from += kAtOnce) {
    const auto asked = pcrs.subspan(from, std::min(kAtOnce, pcrs.size() - from));
    const TPML_PCR_SELECTION selection = selection_of(asked);
    UINT32 counter = 0;
    TPML_PCR_SELECTION* given = nullptr;
    TPML_DIGEST* digests = nullptr;
    check(
        Esys_PCR_Read(tpm, ESYS_TR_NONE, ESYS_TR_NONE, ESYS_TR_NONE, &selection, &counter, &given, &digests),
        "read the registers of the boot");
    const EsysOwned<TPML_PCR_SELECTION> owned(given);
    const EsysOwned<TPML_DIGEST> owned_digests(digests);
    if (digests->count != asked.size())
      throw Error("the TPM keeps no SHA-256 registers of the boot: its SHA-256 bank is switched off");
    for (std::size_t i = 0; i < asked.size(); ++i) {
      const TPM2B_DIGEST& digest = digests->digests[i];
      crypto::PcrValue value{asked[i], {}};
      if (digest.size != value.value.size()) throw Error("the TPM gives a register of another size");
      std::memcpy(value.value.data(), digest.buffer, digest.size);
      values.push_back(value);
    }
  }
  return values;
}

template <typename Sized>
Sized sized_of(ByteView bytes) {
  Sized sized{};
  if (bytes.size() > sizeof sized.buffer) throw Error("what a TPM shall be given is too long");
  sized.size = static_cast<UINT16>(bytes.size());
  std::memcpy(sized.buffer, bytes.data(), bytes.size());
  return sized;
}

/// Has the TPM verify an approval, and say that it did: what TPM2_PolicyAuthorize asks for. The ticket holds
/// until the TPM is cleared.
TPMT_TK_VERIFIED ticket_of(ESYS_CONTEXT* tpm, const crypto::BootSeal& seal, const BootApproval& approval) {
  const Bytes area = crypto::approver_area(seal.approver);
  TPM2B_PUBLIC approver{};
  std::size_t offset = 0;
  check(Tss2_MU_TPMT_PUBLIC_Unmarshal(reinterpret_cast<const uint8_t*>(area.data()), area.size(), &offset,
                                      &approver.publicArea),
        "be given the approval key");
  const auto numbers = crypto::ecdsa_numbers(approval.signature);
  if (!numbers) throw Error("an approval's signature is none on P-256");
  TPMT_SIGNATURE signature{};
  signature.sigAlg = TPM2_ALG_ECDSA;
  signature.signature.ecdsa.hash = TPM2_ALG_SHA256;
  signature.signature.ecdsa.signatureR = sized_of<TPM2B_ECC_PARAMETER>(numbers->first);
  signature.signature.ecdsa.signatureS = sized_of<TPM2B_ECC_PARAMETER>(numbers->second);
  const auto digest = sized_of<TPM2B_DIGEST>(crypto::sha256(crypto::approval_message(seal, approval.pcrs)));
  ESYS_TR key = ESYS_TR_NONE;
  // Below the null hierarchy a TPM gives no ticket.
  check(Esys_LoadExternal(tpm, ESYS_TR_NONE, ESYS_TR_NONE, ESYS_TR_NONE, nullptr, &approver, ESYS_TR_RH_OWNER,
                          &key),
        "load the approval key");
  TPMT_TK_VERIFIED* given = nullptr;
  const TSS2_RC code =
      Esys_VerifySignature(tpm, key, ESYS_TR_NONE, ESYS_TR_NONE, ESYS_TR_NONE, &digest, &signature, &given);
  Esys_FlushContext(tpm, key);
  check(code, "verify the approval of its boot");
  return *EsysOwned<TPMT_TK_VERIFIED>(given);
}

/// A policy session, as long as this object lives: a TPM has room for three.
class PolicySession {
 public:
  explicit PolicySession(ESYS_CONTEXT* tpm) : tpm_(tpm) {
    TPMT_SYM_DEF no_encryption{};
    no_encryption.algorithm = TPM2_ALG_NULL;
    check(Esys_StartAuthSession(tpm, ESYS_TR_NONE, ESYS_TR_NONE, ESYS_TR_NONE, ESYS_TR_NONE, ESYS_TR_NONE,
                                nullptr, TPM2_SE_POLICY, &no_encryption, TPM2_ALG_SHA256, &handle_),
          "begin a policy session");
  }
  PolicySession(const PolicySession&) = delete;
  PolicySession& operator=(const PolicySession&) = delete;
  ~PolicySession() { Esys_FlushContext(tpm_, handle_); }
  [[nodiscard]] ESYS_TR handle() const { return handle_; }

 private:
  ESYS_CONTEXT* tpm_;
  ESYS_TR handle_ = ESYS_TR_NONE;
};

/// Fulfils the policy of a sealed key; the TPM's own answer.
TSS2_RC fulfil(ESYS_CONTEXT* tpm, const PolicySession& session, const crypto::BootSeal& seal,
               const BootApproval& approval, const TPMT_TK_VERIFIED& ticket) {
  const TPML_PCR_SELECTION selection = selection_of(seal.pcrs);
  const auto registers = sized_of<TPM2B_DIGEST>(crypto::digest_of_pcrs(approval.pcrs));
  if (const TSS2_RC code = Esys_PolicyPCR(tpm, session.handle(), ESYS_TR_NONE, ESYS_TR_NONE, ESYS_TR_NONE,
                                          &registers, &selection);
      code != TSS2_RC_SUCCESS)
    return code;
  const auto approved = sized_of<TPM2B_DIGEST>(crypto::state_policy(approval.pcrs));
  const auto tag = sized_of<TPM2B_NONCE>(seal.tag);
  const Bytes name_bytes = crypto::approver_name(seal.approver);
  TPM2B_NAME name{};
  name.size = static_cast<UINT16>(name_bytes.size());
  std::memcpy(name.name, name_bytes.data(), name_bytes.size());
  return Esys_PolicyAuthorize(tpm, session.handle(), ESYS_TR_NONE, ESYS_TR_NONE, ESYS_TR_NONE, &approved,
                              &tag, &name, &ticket);
}

/// Any register was extended since the session looked (part 3, TPM2_PolicyPCR): the kernel does that to
/// registers that are not asked about here, at any time.
bool registers_moved(TSS2_RC code) { return (code & ~TSS2_RC_LAYER_MASK) == TPM2_RC_PCR_CHANGED; }

/// The approval of the state that the TPM is in; kiroku::Error, saying what differs, where there is none.
BootApproval approval_of_now(ESYS_CONTEXT* tpm, const SealedTo& sealed_to) {
  const std::vector<crypto::PcrValue> state = read_pcrs(tpm, sealed_to.seal.pcrs);
  const BootApprovals read = read_approvals(sealed_to.approvals, sealed_to.seal);
  const auto differing = differing_registers(state, read.counting);
  if (differing && differing->empty()) {
    return *std::find_if(read.counting.begin(), read.counting.end(),
                         [&](const BootApproval& each) { return each.pcrs == state; });
  }
  std::string why = "the TPM's key is sealed to approved states of the boot, and this one is not approved: ";
  why += differing ? "register " + crypto::pcr_list(*differing) + " differs from what was" : "none is";
  why += "; 'kiroku boot state' says what to do";
  if (!read.problems.empty()) why += "; " + read.problems.front();
  throw Error(why);
}

}  // namespace

struct TpmKey::Connection {
  explicit Connection(const std::string& address) {
    if (const TSS2_RC code = Tss2_TctiLdr_Initialize(address.c_str(), &way); code != TSS2_RC_SUCCESS)
      throw Error("there is no way to a TPM by \"" + address + "\": " + Tss2_RC_Decode(code));
    if (const TSS2_RC code = Esys_Initialize(&tpm, way, nullptr); code != TSS2_RC_SUCCESS) {
      Tss2_TctiLdr_Finalize(&way);
      check(code, "be spoken to");
    }
  }
  ~Connection() {
    key.reset();
    Esys_Finalize(&tpm);
    Tss2_TctiLdr_Finalize(&way);
  }
  Connection(const Connection&) = delete;
  Connection& operator=(const Connection&) = delete;

  /// Stays in the TPM: it signs each minute.
  const LoadedKey& signing_key(ByteView unique, const std::optional<SealedTo>& sealed_to) {
    if (!key) key.emplace(tpm, unique, Purpose::kSignsAnything, sealed_to ? &sealed_to->seal : nullptr);
    return *key;
  }
  /// That of an approval, which is verified once: it takes a TPM as long as a signature.
  const TPMT_TK_VERIFIED& ticket(const crypto::BootSeal& seal, const BootApproval& approval) {
    if (!verified || verified->signature != approval.signature) {
      verified.reset();
      verified = Verified{approval.signature, ticket_of(tpm, seal, approval)};
    }
    return verified->ticket;
  }

  TSS2_TCTI_CONTEXT* way = nullptr;
  ESYS_CONTEXT* tpm = nullptr;
  std::optional<LoadedKey> key;
  struct Verified {
    Bytes signature;
    TPMT_TK_VERIFIED ticket{};
  };
  std::optional<Verified> verified;
};

TpmKey::TpmKey(std::string tcti, Bytes unique, std::optional<SealedTo> sealed_to)
    : tcti_(std::move(tcti)), unique_(std::move(unique)), sealed_to_(std::move(sealed_to)) {}
TpmKey::~TpmKey() = default;
TpmKey::TpmKey(TpmKey&&) noexcept = default;

template <typename Ask>
auto TpmKey::with_connection(Ask ask) {
  try {
    if (!connection_) connection_ = std::make_unique<Connection>(tcti_);
    return ask(*connection_);
  } catch (const Error&) {
    connection_.reset();  // a TPM that was reset knows the key by no handle
    throw;
  }
}

crypto::P256PublicKey TpmKey::public_key() {
  return with_connection([this](Connection& open) {
    const TPMS_ECC_POINT& point = open.signing_key(unique_, sealed_to_).public_area().unique.ecc;
    return crypto::p256_public_key(bytes_in(point.x), bytes_in(point.y));
  });
}

Bytes TpmKey::sign(ByteView message) {
  const crypto::Sha256Digest hash = crypto::sha256(message);
  TPM2B_DIGEST digest{};
  digest.size = static_cast<UINT16>(hash.size());
  std::memcpy(digest.buffer, hash.data(), hash.size());
  TPMT_SIG_SCHEME scheme{};
  scheme.scheme = TPM2_ALG_ECDSA;
  scheme.details.ecdsa.hashAlg = TPM2_ALG_SHA256;
  // The key is not restricted, so that the TPM needs no proof that it made the digest itself.
  TPMT_TK_HASHCHECK no_ticket{};
  no_ticket.tag = TPM2_ST_HASHCHECK;
  no_ticket.hierarchy = TPM2_RH_NULL;
  return with_connection([&](Connection& open) {
    TPMT_SIGNATURE* made = nullptr;
    const auto ask = [&](ESYS_TR authorization) {
      return Esys_Sign(open.tpm, open.signing_key(unique_, sealed_to_).handle(), authorization, ESYS_TR_NONE,
                       ESYS_TR_NONE, &digest, &scheme, &no_ticket, &made);
    };
    if (!sealed_to_) {
      check(ask(ESYS_TR_PASSWORD), "sign");
      return der_of(*EsysOwned<TPMT_SIGNATURE>(made));
    }
    constexpr int kAttempts = 5;
    for (int attempts_left = kAttempts;; --attempts_left) {
      const BootApproval approval = approval_of_now(open.tpm, *sealed_to_);
      const TPMT_TK_VERIFIED& ticket = open.ticket(sealed_to_->seal, approval);
      const PolicySession session(open.tpm);
      TSS2_RC code = fulfil(open.tpm, session, sealed_to_->seal, approval, ticket);
      if (code == TSS2_RC_SUCCESS) code = ask(session.handle());
      if (registers_moved(code) && attempts_left > 1) continue;
      check(code, "sign in the approved state of its boot");
      return der_of(*EsysOwned<TPMT_SIGNATURE>(made));
    }
  });
}

std::vector<crypto::PcrValue> TpmKey::registers(const std::vector<unsigned>& pcrs) {
  return with_connection([&](Connection& open) { return read_pcrs(open.tpm, pcrs); });
}

Bytes TpmKey::attestation_key() {
  return with_connection([this](Connection& open) {
    const LoadedKey key(open.tpm, unique_, Purpose::kAttests);
    Bytes area(sizeof(TPMT_PUBLIC));
    std::size_t size = 0;
    check(Tss2_MU_TPMT_PUBLIC_Marshal(&key.public_area(), reinterpret_cast<uint8_t*>(area.data()),
                                      area.size(), &size),
          "have its attestation key written");
    area.resize(size);
    return area;
  });
}

crypto::BootAttester::Quote TpmKey::quote(const crypto::Sha256Digest& qualifying_data) {
  TPM2B_DATA asked{};
  asked.size = static_cast<UINT16>(qualifying_data.size());
  std::memcpy(asked.buffer, qualifying_data.data(), qualifying_data.size());
  TPMT_SIG_SCHEME its_own{};
  its_own.scheme = TPM2_ALG_NULL;
  const TPML_PCR_SELECTION selection = selection_of(kQuotedPcrs);
  return with_connection([&](Connection& open) {
    const LoadedKey key(open.tpm, unique_, Purpose::kAttests);
    // A register that is extended in between has the values and the quote differ.
    for (int attempts_left = 3;; --attempts_left) {
      crypto::BootAttester::Quote quote{{}, {}, read_pcrs(open.tpm, kQuotedPcrs)};
      TPM2B_ATTEST* said = nullptr;
      TPMT_SIGNATURE* made = nullptr;
      check(Esys_Quote(open.tpm, key.handle(), ESYS_TR_PASSWORD, ESYS_TR_NONE, ESYS_TR_NONE, &asked, &its_own,
                       &selection, &said, &made),
            "quote the boot");
      const EsysOwned<TPM2B_ATTEST> owned(said);
      quote.signature = der_of(*EsysOwned<TPMT_SIGNATURE>(made));
      quote.attest = to_bytes(std::as_bytes(std::span(said->attestationData, said->size)));
      std::string problem;
      const auto read = crypto::parse_tpm_quote(quote.attest, problem);
      if (!read) throw Error("what the TPM quotes cannot be read: " + problem);
      if (read->pcr_digest == crypto::digest_of_pcrs(quote.pcrs)) return quote;
      if (attempts_left == 1) throw Error("the registers of the boot change while the TPM is asked for them");
    }
  });
}

}  // namespace kiroku::recorder

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

// As the PC Client profile has them: 0 to 7 firmware, its settings, what it starts and Secure Boot's state;
// 8 and 9 what the boot loader reads, the kernel among it; 14 the keys of shim's owner.
constexpr std::array<unsigned, 11> kQuotedPcrs{0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 14};
constexpr UINT8 kSelectBytes = crypto::kPcrs / 8;

enum class Purpose { kSignsAnything, kAttests };

TPM2B_PUBLIC template_with(ByteView unique, Purpose purpose) {
  TPM2B_PUBLIC wanted{};
  TPMT_PUBLIC& area = wanted.publicArea;
  area.type = TPM2_ALG_ECC;
  area.nameAlg = TPM2_ALG_SHA256;
  area.objectAttributes = TPMA_OBJECT_FIXEDTPM | TPMA_OBJECT_FIXEDPARENT | TPMA_OBJECT_SENSITIVEDATAORIGIN |
                          TPMA_OBJECT_USERWITHAUTH | TPMA_OBJECT_NODA | TPMA_OBJECT_SIGN_ENCRYPT;
  if (purpose == Purpose::kAttests) area.objectAttributes |= TPMA_OBJECT_RESTRICTED;
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
  LoadedKey(ESYS_CONTEXT* tpm, ByteView unique, Purpose purpose) : tpm_(tpm) {
    const TPM2B_SENSITIVE_CREATE no_secret{};
    const TPM2B_DATA nothing{};
    const TPML_PCR_SELECTION no_registers{};
    const TPM2B_PUBLIC wanted = template_with(unique, purpose);
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

std::vector<crypto::PcrValue> read_pcrs(ESYS_CONTEXT* tpm) {
  std::vector<crypto::PcrValue> values;
  // A TPM gives as many at once as it likes (part 3, TPM2_PCR_Read), eight at most.
  constexpr std::size_t kAtOnce = 8;
  for (std::size_t from = 0; from < kQuotedPcrs.size(); from += kAtOnce) {
    const auto asked = std::span(kQuotedPcrs).subspan(from, std::min(kAtOnce, kQuotedPcrs.size() - from));
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
  const LoadedKey& signing_key(ByteView unique) {
    if (!key) key.emplace(tpm, unique, Purpose::kSignsAnything);
    return *key;
  }

  TSS2_TCTI_CONTEXT* way = nullptr;
  ESYS_CONTEXT* tpm = nullptr;
  std::optional<LoadedKey> key;
};

TpmKey::TpmKey(std::string tcti, Bytes unique) : tcti_(std::move(tcti)), unique_(std::move(unique)) {}
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
    const TPMS_ECC_POINT& point = open.signing_key(unique_).public_area().unique.ecc;
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
    check(Esys_Sign(open.tpm, open.signing_key(unique_).handle(), ESYS_TR_PASSWORD, ESYS_TR_NONE,
                    ESYS_TR_NONE, &digest, &scheme, &no_ticket, &made),
          "sign");
    return der_of(*EsysOwned<TPMT_SIGNATURE>(made));
  });
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
      crypto::BootAttester::Quote quote{{}, {}, read_pcrs(open.tpm)};
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

#include "recorder/device_key/tpm_key.h"

#include <cstdlib>
#include <cstring>
#include <tss2/tss2_esys.h>
#include <tss2/tss2_rc.h>
#include <tss2/tss2_tctildr.h>

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

TPM2B_PUBLIC template_with(ByteView unique) {
  TPM2B_PUBLIC wanted{};
  TPMT_PUBLIC& area = wanted.publicArea;
  area.type = TPM2_ALG_ECC;
  area.nameAlg = TPM2_ALG_SHA256;
  area.objectAttributes = TPMA_OBJECT_FIXEDTPM | TPMA_OBJECT_FIXEDPARENT | TPMA_OBJECT_SENSITIVEDATAORIGIN |
                          TPMA_OBJECT_USERWITHAUTH | TPMA_OBJECT_NODA | TPMA_OBJECT_SIGN_ENCRYPT;
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

}  // namespace

struct TpmKey::Connection {
  Connection(const std::string& address, ByteView unique) {
    try {
      open(address, unique);
    } catch (...) {
      close();
      throw;
    }
  }
  ~Connection() { close(); }
  Connection(const Connection&) = delete;
  Connection& operator=(const Connection&) = delete;

  void open(const std::string& address, ByteView unique) {
    if (const TSS2_RC code = Tss2_TctiLdr_Initialize(address.c_str(), &way); code != TSS2_RC_SUCCESS)
      throw Error("there is no way to a TPM by \"" + address + "\": " + Tss2_RC_Decode(code));
    check(Esys_Initialize(&tpm, way, nullptr), "be spoken to");
    const TPM2B_SENSITIVE_CREATE no_secret{};
    const TPM2B_DATA nothing{};
    const TPML_PCR_SELECTION no_registers{};
    const TPM2B_PUBLIC wanted = template_with(unique);
    TPM2B_PUBLIC* made = nullptr;
    check(Esys_CreatePrimary(tpm, ESYS_TR_RH_OWNER, ESYS_TR_PASSWORD, ESYS_TR_NONE, ESYS_TR_NONE, &no_secret,
                             &wanted, &nothing, &no_registers, &key, &made, nullptr, nullptr, nullptr),
          "make its key");
    const EsysOwned<TPM2B_PUBLIC> owned(made);
    const TPMS_ECC_POINT& point = made->publicArea.unique.ecc;
    public_key = crypto::p256_public_key(bytes_in(point.x), bytes_in(point.y));
  }

  void close() {
    if (tpm != nullptr && key != ESYS_TR_NONE) Esys_FlushContext(tpm, key);
    if (tpm != nullptr) Esys_Finalize(&tpm);
    if (way != nullptr) Tss2_TctiLdr_Finalize(&way);
  }

  TSS2_TCTI_CONTEXT* way = nullptr;
  ESYS_CONTEXT* tpm = nullptr;
  ESYS_TR key = ESYS_TR_NONE;
  crypto::P256PublicKey public_key;
};

TpmKey::TpmKey(std::string tcti, Bytes unique) : tcti_(std::move(tcti)), unique_(std::move(unique)) {}
TpmKey::~TpmKey() = default;
TpmKey::TpmKey(TpmKey&&) noexcept = default;

TpmKey::Connection& TpmKey::connection() {
  if (!connection_) connection_ = std::make_unique<Connection>(tcti_, unique_);
  return *connection_;
}

crypto::P256PublicKey TpmKey::public_key() { return connection().public_key; }

Bytes TpmKey::sign(ByteView message) {
  Connection& open = connection();
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
  TPMT_SIGNATURE* made = nullptr;
  try {
    check(Esys_Sign(open.tpm, open.key, ESYS_TR_PASSWORD, ESYS_TR_NONE, ESYS_TR_NONE, &digest, &scheme,
                    &no_ticket, &made),
          "sign");
  } catch (const Error&) {
    connection_.reset();  // a TPM that was reset knows the key by no handle
    throw;
  }
  const EsysOwned<TPMT_SIGNATURE> owned(made);
  const TPMS_SIGNATURE_ECC& numbers = made->signature.ecdsa;
  return crypto::ecdsa_signature(bytes_in(numbers.signatureR), bytes_in(numbers.signatureS));
}

}  // namespace kiroku::recorder

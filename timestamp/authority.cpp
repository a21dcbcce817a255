#include "timestamp/authority.h"

#include <algorithm>
#include <array>
#include <optional>
#include <utility>

#include <openssl/pem.h>

#include "base/error.h"
#include "crypto/secret.h"
#include "timestamp/certificate_maker.h"
#include "timestamp/der.h"
#include "timestamp/request.h"
#include "timestamp/serial_counter.h"
#include "timestamp/small_files.h"

namespace kiroku::timestamp {
namespace {

/// PKIFailureInfo bits of RFC 3161 section 2.4.2.
enum class FailureBit {
  kBadAlg = 0,
  kBadRequest = 2,
  kBadDataFormat = 5,
  kTimeNotAvailable = 14,
  kUnacceptedPolicy = 15,
  kUnacceptedExtension = 16,
  kSystemFailure = 25,
};

constexpr int kRejection = 2;        // PKIStatus
constexpr int kAccuracySeconds = 1;  // a machine that keeps its clock by NTP is well within
constexpr mode_t kSecretMode = 0600;
constexpr mode_t kPublicMode = 0644;

FailureBit bit_of(RequestFailure failure) {
  switch (failure) {
    case RequestFailure::kBadDataFormat:
      return FailureBit::kBadDataFormat;
    case RequestFailure::kBadAlgorithm:
      return FailureBit::kBadAlg;
    case RequestFailure::kBadRequest:
      return FailureBit::kBadRequest;
    case RequestFailure::kUnacceptedExtension:
      return FailureBit::kUnacceptedExtension;
  }
  return FailureBit::kBadRequest;
}

/// TimeStampResp without a token.
Bytes rejection(FailureBit failure, std::string_view explanation) {
  const std::array status{std::byte{kRejection}};
  const Bytes text = der_value(der::kUtf8String, {bytes_of(explanation)});
  // BIT STRING of named bits, so without trailing zero bits: unused bits first, then up to the one that is
  // set.
  const auto bit = static_cast<std::size_t>(failure);
  Bytes bits(bit / 8 + 2);
  bits.front() = std::byte(7 - bit % 8);
  bits.back() = std::byte(0x80U >> (bit % 8));
  const Bytes status_info =
      der_value(der::kSequence, {der_value(der::kInteger, {status}), der_value(der::kSequence, {text}),
                                 der_value(der::kBitString, {bits})});
  return der_value(der::kSequence, {status_info});
}

std::string take_text(BIO* memory) {
  char* data = nullptr;
  const long size = BIO_get_mem_data(memory, &data);
  return size > 0 ? std::string(data, static_cast<std::size_t>(size)) : std::string();
}

std::string certificate_pem(X509* certificate) {
  const BioHandle out(BIO_new(BIO_s_mem()));
  if (!out || PEM_write_bio_X509(out.get(), certificate) != 1) {
    throw Error("cannot write a certificate: " + crypto::last_openssl_error());
  }
  return take_text(out.get());
}

void write_key(const std::filesystem::path& file, EVP_PKEY* key) {
  const BioHandle out(BIO_new(BIO_s_secmem()));  // zeroised when freed
  char* data = nullptr;
  if (!out || PEM_write_bio_PKCS8PrivateKey(out.get(), key, nullptr, nullptr, 0, nullptr, nullptr) != 1) {
    throw Error("cannot write a private key: " + crypto::last_openssl_error());
  }
  const long size = BIO_get_mem_data(out.get(), &data);
  write_new_file(file, bytes_of({data, static_cast<std::size_t>(size)}), kSecretMode);
}

int no_passphrase(char* /*buffer*/, int /*size*/, int /*for_writing*/, void* /*data*/) { return -1; }

crypto::PrivateKey read_key(const std::filesystem::path& file) {
  Bytes pem = read_small_file(file);
  const BioHandle in(BIO_new_mem_buf(pem.data(), static_cast<int>(pem.size())));
  crypto::PrivateKey key(PEM_read_bio_PrivateKey(in.get(), nullptr, no_passphrase, nullptr));
  forget_openssl_errors();
  crypto::zeroise(pem);
  if (!key) throw Error(file.string() + " is no private key (PKCS#8 PEM without passphrase)");
  return key;
}

Certificate read_certificate(const std::filesystem::path& file) {
  const Bytes pem = read_small_file(file);
  const BioHandle in(BIO_new_mem_buf(pem.data(), static_cast<int>(pem.size())));
  Certificate certificate(PEM_read_bio_X509(in.get(), nullptr, no_passphrase, nullptr));
  forget_openssl_errors();
  if (!certificate) throw Error(file.string() + " is no certificate (PEM)");
  return certificate;
}

struct Layout {
  explicit Layout(const std::filesystem::path& folder)
      : ca_certificate(folder / "ca.pem"),
        ca_key(folder / "ca.key"),
        tsa_certificate(folder / "tsa.pem"),
        tsa_key(folder / "tsa.key"),
        serial(folder / "serial") {}
  std::filesystem::path ca_certificate, ca_key, tsa_certificate, tsa_key, serial;
};

/// What OpenSSL's callbacks hand to a response under way.
struct Stamp {
  std::uint64_t serial = 0;
  UtcTime time;
};

ASN1_INTEGER* give_serial(TS_resp_ctx* /*context*/, void* data) {
  Asn1Integer number(ASN1_INTEGER_new());
  if (!number || ASN1_INTEGER_set_uint64(number.get(), static_cast<const Stamp*>(data)->serial) != 1) {
    return nullptr;
  }
  return number.release();
}

int give_time(TS_resp_ctx* /*context*/, void* data, long* seconds, long* microseconds) {
  const UtcTime time = static_cast<const Stamp*>(data)->time;
  const auto whole = std::chrono::floor<std::chrono::seconds>(time);
  *seconds = whole.time_since_epoch().count();
  *microseconds = (time - whole).count();
  return 1;
}

}  // namespace

struct Authority::State {
  Certificate ca;
  Credential tsa;
  SerialCounter serials;
  std::mutex clock_mutex;
  std::function<UtcTime()> clock = utc_now;
  UtcTime latest;  // of the tokens given

  explicit State(const Layout& files)
      : ca(read_certificate(files.ca_certificate)),
        tsa{read_key(files.tsa_key), read_certificate(files.tsa_certificate)},
        serials(files.serial) {
    if (X509_check_private_key(tsa.certificate.get(), tsa.key.get()) != 1) {
      forget_openssl_errors();
      throw Error(files.tsa_key.string() + " is not the key of " + files.tsa_certificate.string());
    }
  }

  /// The time of the next token; nothing if the clock was set back behind the last one by more than tokens
  /// state as their accuracy.
  std::optional<UtcTime> next_time() {
    const std::lock_guard guard(clock_mutex);
    const UtcTime time = clock();
    if (time + std::chrono::seconds(kAccuracySeconds) < latest) return {};
    latest = std::max(latest, time);
    return time;
  }

  Bytes grant(ByteView query, UtcTime time);
};

Authority::Authority(std::unique_ptr<State> state) : state_(std::move(state)) {}
Authority::Authority(Authority&&) noexcept = default;
Authority& Authority::operator=(Authority&&) noexcept = default;
Authority::~Authority() = default;

Authority Authority::create(const std::filesystem::path& folder, const std::string& organisation) {
  const Layout files(folder);
  for (const auto& file :
       {files.ca_certificate, files.ca_key, files.tsa_certificate, files.tsa_key, files.serial}) {
    if (std::filesystem::exists(file)) {
      throw UsageError("there is an authority in " + folder.string() + " already (" +
                       file.filename().string() + "): open it, or choose another folder");
    }
  }
  // A day of slack, so that a clock set right after the installation does not make tokens invalid.
  const UtcTime start = utc_now() - std::chrono::days(1);
  const Credential ca = issue_certificate({.organisation = organisation,
                                           .common_name = std::string(kEmbeddedRootName),
                                           .role = CertificateRole::kAuthority,
                                           .not_before = start,
                                           .not_after = start + std::chrono::years(20),
                                           .extended_key_usage = ""},
                                          nullptr);
  const Credential tsa = issue_certificate({.organisation = organisation,
                                            .common_name = "Kiroku embedded time-stamping authority",
                                            .role = CertificateRole::kSigner,
                                            .not_before = start,
                                            .not_after = start + std::chrono::years(10),
                                            .extended_key_usage = "critical,timeStamping"},
                                           &ca);
  std::filesystem::create_directories(folder);
  write_key(files.ca_key, ca.key.get());
  write_key(files.tsa_key, tsa.key.get());
  write_new_file(files.ca_certificate, bytes_of(certificate_pem(ca.certificate.get())), kPublicMode);
  write_new_file(files.tsa_certificate, bytes_of(certificate_pem(tsa.certificate.get())), kPublicMode);
  SerialCounter::create(files.serial);
  return open(folder);
}

Authority Authority::open(const std::filesystem::path& folder) {
  return Authority(std::make_unique<State>(Layout(folder)));
}

Bytes Authority::respond(ByteView query) {
  const RequestParse parsed = parse_request(query);
  if (!parsed.request) {
    return rejection(bit_of(parsed.failure.value_or(RequestFailure::kBadRequest)), parsed.explanation);
  }
  if (parsed.request->policy && *parsed.request->policy != kEmbeddedPolicy) {
    return rejection(
        FailureBit::kUnacceptedPolicy,
        "policy " + *parsed.request->policy + " is not served here, only " + std::string(kEmbeddedPolicy));
  }
  const std::optional<UtcTime> time = state_->next_time();
  if (!time) {
    return rejection(FailureBit::kTimeNotAvailable,
                     "the clock was set back: this authority waits until it is where it was");
  }
  try {
    return state_->grant(query, *time);
  } catch (const Error& error) {
    return rejection(FailureBit::kSystemFailure, error.what());
  }
}

Bytes Authority::State::grant(ByteView query, UtcTime time) {
  Stamp stamp{serials.next(), time};
  const Asn1Object policy(OBJ_txt2obj(std::string(kEmbeddedPolicy).c_str(), 1));
  const TsResponseContext context(TS_RESP_CTX_new());
  const BorrowedCertificates chain(sk_X509_new_null());
  const BioHandle in(BIO_new_mem_buf(query.data(), static_cast<int>(query.size())));
  const bool ready =
      policy && context && chain && in && sk_X509_push(chain.get(), ca.get()) > 0 &&
      TS_RESP_CTX_set_signer_cert(context.get(), tsa.certificate.get()) == 1 &&
      TS_RESP_CTX_set_signer_key(context.get(), tsa.key.get()) == 1 &&
      TS_RESP_CTX_set_signer_digest(context.get(), EVP_sha256()) == 1 &&
      TS_RESP_CTX_set_ess_cert_id_digest(context.get(), EVP_sha256()) == 1 &&
      TS_RESP_CTX_set_certs(context.get(), chain.get()) == 1 &&
      TS_RESP_CTX_set_def_policy(context.get(), policy.get()) == 1 &&
      TS_RESP_CTX_add_md(context.get(), EVP_sha256()) == 1 &&
      TS_RESP_CTX_add_md(context.get(), EVP_sha384()) == 1 &&
      TS_RESP_CTX_add_md(context.get(), EVP_sha512()) == 1 &&
      TS_RESP_CTX_add_md(context.get(), EVP_sha3_256()) == 1 &&
      TS_RESP_CTX_add_md(context.get(), EVP_sha3_384()) == 1 &&
      TS_RESP_CTX_add_md(context.get(), EVP_sha3_512()) == 1 &&
      TS_RESP_CTX_set_accuracy(context.get(), kAccuracySeconds, 0, 0) == 1 &&
      TS_RESP_CTX_set_clock_precision_digits(context.get(), TS_MAX_CLOCK_PRECISION_DIGITS) == 1;
  if (!ready) throw Error("the authority cannot prepare a token: " + crypto::last_openssl_error());
  TS_RESP_CTX_set_serial_cb(context.get(), give_serial, &stamp);
  TS_RESP_CTX_set_time_cb(context.get(), give_time, &stamp);
  const TsResponse response(TS_RESP_create_response(context.get(), in.get()));
  if (!response) throw Error("the authority cannot make a token: " + crypto::last_openssl_error());
  forget_openssl_errors();
  return encode_with<i2d_TS_RESP>(response.get());
}

std::string Authority::root_pem() const { return certificate_pem(state_->ca.get()); }

std::string Authority::chain_pem() const {
  return certificate_pem(state_->tsa.certificate.get()) + certificate_pem(state_->ca.get());
}

void Authority::set_clock(std::function<UtcTime()> now) {
  const std::lock_guard guard(state_->clock_mutex);
  state_->clock = std::move(now);
  state_->latest = {};
}

}  // namespace kiroku::timestamp

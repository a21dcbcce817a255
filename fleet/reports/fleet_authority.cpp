#include "fleet/reports/fleet_authority.h"

#include <array>
#include <optional>
#include <sys/stat.h>

#include <openssl/pem.h>
#include <openssl/x509v3.h>

#include "archive/format/case_layout.h"
#include "base/error.h"
#include "base/printable.h"
#include "crypto/encoding.h"
#include "crypto/hash.h"
#include "crypto/key_derivation.h"
#include "timestamp/certificate_maker.h"
#include "timestamp/small_files.h"

namespace kiroku::fleet {
namespace {

namespace fs = std::filesystem;
using timestamp::Certificate;
using timestamp::Credential;
using Request = std::unique_ptr<X509_REQ, crypto::OpenSslDeleter<X509_REQ_free>>;

constexpr const char* kOrganisation = "Kiroku fleet";
constexpr std::size_t kLargestRequest = 4096;
constexpr std::chrono::days kAuthorityLasts{3650};
/// Clocks that are behind see a certificate, too.
constexpr std::chrono::days kBackdated{1};
constexpr mode_t kKeyMode = 0600, kCertificateMode = 0644, kOthers = 0077;
constexpr std::string_view kCodeDigits = "0123456789ABCDEFGHJKMNPQRSTVWXYZ";  // Crockford's base 32
constexpr std::size_t kCodeDigitCount = 16, kCodeGroup = 4;
constexpr std::size_t kIdBytes = 16, kDigitsOfId = 4 * kIdBytes;  // random ones, and as many of an HMAC

[[noreturn]] void fail(const std::string& what) {
  throw Error("cannot " + what + ": " + crypto::last_openssl_error());
}

crypto::BufferIo reading(std::string_view text) {
  crypto::BufferIo memory(BIO_new_mem_buf(text.data(), static_cast<int>(text.size())));
  if (!memory) fail("read PEM");
  return memory;
}

std::string_view text_in(const crypto::BufferIo& memory) {
  char* data = nullptr;
  const long size = BIO_get_mem_data(memory.get(), &data);
  return {data, static_cast<std::size_t>(size)};
}

crypto::Secret pem_of_key(EVP_PKEY* key) {
  const crypto::BufferIo memory(BIO_new(BIO_s_secmem()));
  if (!memory || PEM_write_bio_PKCS8PrivateKey(memory.get(), key, nullptr, nullptr, 0, nullptr, nullptr) != 1)
    fail("write a key");
  return crypto::Secret::copy_of(text_in(memory));
}

std::string pem_of(X509_REQ* request) {
  const crypto::BufferIo memory(BIO_new(BIO_s_mem()));
  if (!memory || PEM_write_bio_X509_REQ(memory.get(), request) != 1) fail("write a request");
  return std::string(text_in(memory));
}

std::string pem_of(X509* certificate) {
  const crypto::BufferIo memory(BIO_new(BIO_s_mem()));
  if (!memory || PEM_write_bio_X509(memory.get(), certificate) != 1) fail("write a certificate");
  return std::string(text_in(memory));
}

Certificate certificate_of(std::string_view pem) {
  Certificate certificate(PEM_read_bio_X509(reading(pem).get(), nullptr, nullptr, nullptr));
  timestamp::forget_openssl_errors();
  if (!certificate) throw UsageError("there is no PEM certificate in what was given as one");
  return certificate;
}

/// Null for anything else.
Request parse_request(std::string_view pem) {
  if (pem.size() > kLargestRequest) return nullptr;
  Request request(PEM_read_bio_X509_REQ(reading(pem).get(), nullptr, nullptr, nullptr));
  timestamp::forget_openssl_errors();
  return request;
}

Bytes der_of_request(std::string_view pem) {
  const Request request = parse_request(pem);
  if (!request) throw UsageError("this is no request for a certificate");
  return timestamp::encode_with<i2d_X509_REQ>(request.get());
}

/// The only common name, if it is a short name; "" otherwise.
std::string short_name_of(X509_NAME* name) {
  const int at = X509_NAME_get_index_by_NID(name, NID_commonName, -1);
  if (at < 0 || X509_NAME_get_index_by_NID(name, NID_commonName, at) >= 0) return {};
  const std::string text(
      text_of(timestamp::view_of(X509_NAME_ENTRY_get_data(X509_NAME_get_entry(name, at)))));
  return archive::is_short_name(text) ? text : "";
}

bool is_p256(EVP_PKEY* key) {
  std::array<char, 32> group{};
  std::size_t length = 0;
  const bool is_named = key != nullptr && EVP_PKEY_is_a(key, "EC") == 1 &&
                        EVP_PKEY_get_group_name(key, group.data(), group.size(), &length) == 1;
  timestamp::forget_openssl_errors();
  return is_named && std::string_view(group.data(), length) == "prime256v1";
}

UtcTime utc_of(const ASN1_TIME* time) {
  std::tm parts{};
  if (ASN1_TIME_to_tm(time, &parts) != 1) throw UsageError("a certificate's validity cannot be read");
  return UtcTime(std::chrono::seconds(timegm(&parts)));
}

CertificateFacts facts_of(X509* certificate) {
  const Bytes der = timestamp::encode_with<i2d_X509>(certificate);
  return {short_name_of(X509_get_subject_name(certificate)), crypto::to_hex(crypto::sha256(der)),
          utc_of(X509_get0_notBefore(certificate)), utc_of(X509_get0_notAfter(certificate))};
}

}  // namespace

CertificateRequest make_certificate_request(const std::string& appliance) {
  if (!archive::is_short_name(appliance)) {
    throw UsageError("'" + printable(appliance) +
                     "' cannot name an appliance of a fleet: a name has 1 to 32 small letters, digits and "
                     "hyphens, such as or-1");
  }
  const crypto::PrivateKey key(EVP_EC_gen("P-256"));
  const Request request(X509_REQ_new());
  if (!key || !request) fail("make a key");
  X509_NAME* const name = X509_REQ_get_subject_name(request.get());
  const bool is_made =
      X509_REQ_set_version(request.get(), X509_REQ_VERSION_1) == 1 &&
      X509_NAME_add_entry_by_txt(name, "CN", MBSTRING_UTF8, timestamp::octets_of(bytes_of(appliance)),
                                 static_cast<int>(appliance.size()), -1, 0) == 1 &&
      X509_REQ_set_pubkey(request.get(), key.get()) == 1 &&
      X509_REQ_sign(request.get(), key.get(), EVP_sha256()) > 0;
  if (!is_made) fail("make a request for a certificate");
  return {pem_of_key(key.get()), pem_of(request.get())};
}

std::string appliance_of_request(std::string_view request_pem) {
  const Request request = parse_request(request_pem);
  if (!request)
    throw UsageError("this is no request for a certificate (PKCS #10, PEM, at most " +
                     std::to_string(kLargestRequest) + " bytes)");
  EVP_PKEY* const key = X509_REQ_get0_pubkey(request.get());
  const bool is_signed = is_p256(key) && X509_REQ_verify(request.get(), key) == 1;
  timestamp::forget_openssl_errors();
  if (!is_signed)
    throw UsageError("this request for a certificate is not of a P-256 key, or not signed by its own key");
  std::string name = short_name_of(X509_REQ_get_subject_name(request.get()));
  if (name.empty())
    throw UsageError(
        "this request for a certificate names no appliance: its one common name must have 1 to 32 small "
        "letters, digits and hyphens");
  return name;
}

std::string request_alone(std::string_view request_pem) {
  static_cast<void>(appliance_of_request(request_pem));
  return pem_of(parse_request(request_pem).get());
}

std::string request_fingerprint(std::string_view request_pem) {
  const std::string digits = crypto::to_hex(crypto::sha256(der_of_request(request_pem)));
  std::string out;
  for (std::size_t i = 0; i < digits.size(); ++i) {
    if (i > 0 && i % 2 == 0) out += ':';
    out += static_cast<char>(digits[i] >= 'a' ? digits[i] - 'a' + 'A' : digits[i]);
  }
  return out;
}

std::string enrolment_code(std::string_view request_pem, std::string_view authority_pem,
                           std::string_view nonce) {
  const Certificate authority = certificate_of(authority_pem);
  crypto::Sha256 hash;
  hash.update(bytes_of("kiroku enrolment 1\n"));
  hash.update(crypto::sha256(der_of_request(request_pem)));
  hash.update(crypto::sha256(timestamp::encode_with<i2d_X509>(authority.get())));
  hash.update(crypto::sha256(bytes_of(nonce)));
  const crypto::Sha256Digest digest = hash.finish();
  constexpr unsigned kBitsOfDigit = 5, kBitsOfByte = 8;
  std::string code;
  for (std::size_t i = 0; i < kCodeDigitCount; ++i) {
    if (i > 0 && i % kCodeGroup == 0) code += '-';
    const std::size_t bit = i * kBitsOfDigit;
    const unsigned pair = (std::to_integer<unsigned>(digest[bit / kBitsOfByte]) << kBitsOfByte) |
                          std::to_integer<unsigned>(digest[bit / kBitsOfByte + 1]);
    code += kCodeDigits[(pair >> (2 * kBitsOfByte - kBitsOfDigit - bit % kBitsOfByte)) & 31U];
  }
  return code;
}

std::string parse_enrolment_code(std::string_view typed) {
  std::string digits;
  for (char c : typed) {
    if (c == '-' || c == ' ') continue;
    if (c >= 'a' && c <= 'z') c = static_cast<char>(c - 'a' + 'A');
    if (c == 'O') c = '0';
    if (c == 'I' || c == 'L') c = '1';
    if (kCodeDigits.find(c) == std::string_view::npos || digits.size() == kCodeDigitCount) return {};
    digits += c;
  }
  if (digits.size() != kCodeDigitCount) return {};
  std::string code;
  for (std::size_t i = 0; i < digits.size(); ++i) {
    if (i > 0 && i % kCodeGroup == 0) code += '-';
    code += digits[i];
  }
  return code;
}

CertificateFacts facts_of_certificate(ByteView der) {
  const auto certificate = timestamp::decode_with<Certificate, d2i_X509>(der);
  if (!certificate) throw UsageError("this is no certificate");
  return facts_of(certificate.get());
}

CertificateFacts facts_of_certificate_pem(std::string_view pem) {
  return facts_of(certificate_of(pem).get());
}

bool is_issued_for(std::string_view certificate_pem, std::string_view authority_pem,
                   std::string_view key_pem) {
  const auto certificate = certificate_of(certificate_pem), authority = certificate_of(authority_pem);
  const crypto::PrivateKey key(
      PEM_read_bio_PrivateKey(reading(key_pem).get(), nullptr, nullptr, const_cast<char*>("")));
  const bool is_issued = certificate && authority && key &&
                         X509_check_private_key(certificate.get(), key.get()) == 1 &&
                         X509_verify(certificate.get(), X509_get0_pubkey(authority.get())) == 1;
  timestamp::forget_openssl_errors();
  return is_issued;
}

struct FleetAuthority::State {
  Credential credential;
  std::string certificate_pem;
  crypto::Secret id_key;

  /// What follows these random bytes.
  [[nodiscard]] Bytes proof_of(ByteView random) const {
    const crypto::Sha256Digest proof = crypto::hmac_sha256(id_key.bytes(), random);
    return to_bytes(ByteView(proof).first(kIdBytes));
  }
};

FleetAuthority::FleetAuthority(std::unique_ptr<State> state) : state_(std::move(state)) {}
FleetAuthority::~FleetAuthority() = default;
FleetAuthority::FleetAuthority(FleetAuthority&&) noexcept = default;
FleetAuthority& FleetAuthority::operator=(FleetAuthority&&) noexcept = default;

FleetAuthority FleetAuthority::open(const fs::path& folder) {
  const fs::path key_file = folder / "authority.key", certificate_file = folder / "authority.pem";
  struct stat about {};
  if (::stat(key_file.c_str(), &about) != 0 || !fs::exists(certificate_file)) {
    throw UsageError("there is no authority of the fleet in " + folder.string() +
                     ": 'kiroku-fleet serve' makes one where reports are taken ([reports] of fleet.toml), or "
                     "copy authority.key and authority.pem from the server that has it");
  }
  if ((about.st_mode & kOthers) != 0)
    throw UsageError(key_file.string() +
                     " is open to others than its owner: chmod 600, and think of who may have "
                     "read it");
  auto state = std::make_unique<State>();
  state->certificate_pem = text_of(timestamp::read_small_file(certificate_file));
  state->credential.certificate = certificate_of(state->certificate_pem);
  const crypto::Secret key = [&] {
    Bytes bytes = timestamp::read_small_file(key_file);
    crypto::Secret copy = crypto::Secret::copy_of(bytes);
    crypto::zeroise(bytes);
    return copy;
  }();
  state->credential.key.reset(
      PEM_read_bio_PrivateKey(reading(key.text()).get(), nullptr, nullptr, const_cast<char*>("")));
  const bool fits = state->credential.key && X509_check_private_key(state->credential.certificate.get(),
                                                                    state->credential.key.get()) == 1;
  timestamp::forget_openssl_errors();
  if (!fits)
    throw UsageError(key_file.string() + " is not the key of " + certificate_file.string() +
                     ": copy both from one server");
  // Not of the file's bytes: it may have been copied with other ends of its lines.
  state->id_key =
      crypto::hkdf_sha256(pem_of_key(state->credential.key.get()).bytes(), {}, "kiroku enrolment ids 1");
  return FleetAuthority(std::move(state));
}

FleetAuthority FleetAuthority::open_or_make(const fs::path& folder, UtcTime now) {
  const bool has_key = fs::exists(folder / "authority.key"),
             has_certificate = fs::exists(folder / "authority.pem");
  if (has_key != has_certificate) {
    throw UsageError("the authority of the fleet in " + folder.string() +
                     " is half there, as where it was cut " +
                     "off while it was made: copy authority.key and authority.pem from the server that has " +
                     "them, or remove what is there, and it is made anew");
  }
  if (has_key) return open(folder);
  std::error_code failed;
  fs::create_directories(folder, failed);
  if (failed) throw IoError("create", folder, failed.value());
  timestamp::CertificateProfile profile;
  profile.organisation = kOrganisation;
  profile.common_name = "Kiroku fleet authority";
  profile.role = timestamp::CertificateRole::kAuthority;
  profile.not_before = now - kBackdated;
  profile.not_after = now + kAuthorityLasts;
  const Credential made = timestamp::issue_certificate(profile, nullptr);
  // Of two that begin at once the second finds the key there, and says so.
  timestamp::write_new_file(folder / "authority.key", pem_of_key(made.key.get()).bytes(), kKeyMode);
  timestamp::write_new_file(folder / "authority.pem", bytes_of(pem_of(made.certificate.get())),
                            kCertificateMode);
  return open(folder);
}

const std::string& FleetAuthority::certificate_pem() const { return state_->certificate_pem; }

std::string FleetAuthority::issue(std::string_view request_pem, UtcTime now, std::chrono::hours lasts) const {
  timestamp::CertificateProfile profile;
  profile.organisation = kOrganisation;
  profile.common_name = appliance_of_request(request_pem);
  profile.not_before = now - kBackdated;
  profile.not_after = now + lasts;
  profile.extended_key_usage = "clientAuth";
  const Request request = parse_request(request_pem);
  return pem_of(
      timestamp::issue_certificate_for(X509_REQ_get0_pubkey(request.get()), profile, state_->credential)
          .get());
}

std::string FleetAuthority::new_enrolment_id() const {
  std::array<std::byte, kIdBytes> random{};
  crypto::fill_random(random);
  return crypto::to_hex(random) + crypto::to_hex(state_->proof_of(random));
}

bool FleetAuthority::is_enrolment_id(std::string_view id) const {
  if (id.size() != kDigitsOfId) return false;
  const std::optional<Bytes> bytes = crypto::from_hex(id);
  if (!bytes) return false;
  const ByteView all(*bytes);
  return crypto::equal_constant_time(all.subspan(kIdBytes), state_->proof_of(all.first(kIdBytes)));
}

FleetAuthority::ServerIdentity FleetAuthority::issue_server_identity() const {
  const CertificateFacts own = facts_of(state_->credential.certificate.get());
  timestamp::CertificateProfile profile;
  profile.organisation = kOrganisation;
  profile.common_name = kReportServerName;
  profile.not_before = own.not_before;
  profile.not_after = own.not_after;
  profile.extended_key_usage = "serverAuth";
  profile.alternative_names = std::string("DNS:") + kReportServerName;
  const Credential made = timestamp::issue_certificate(profile, &state_->credential);
  return {pem_of(made.certificate.get()), pem_of_key(made.key.get())};
}

}  // namespace kiroku::fleet

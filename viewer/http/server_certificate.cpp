#include "viewer/http/server_certificate.h"

#include <array>
#include <cerrno>
#include <chrono>
#include <cstring>
#include <fcntl.h>
#include <optional>
#include <sys/file.h>
#include <unistd.h>

#include <openssl/pem.h>
#include <openssl/x509v3.h>

#include "base/descriptor.h"
#include "base/error.h"
#include "base/utc_time.h"
#include "crypto/hash.h"
#include "timestamp/certificate_maker.h"
#include "timestamp/small_files.h"

namespace kiroku::viewer {
namespace {

namespace fs = std::filesystem;
using timestamp::Certificate;

constexpr mode_t kCertificateMode = 0644;
constexpr mode_t kKeyMode = 0600;
/// As long as browsers accept of a certificate that people installed.
constexpr std::chrono::days kValidity{825};
constexpr std::chrono::days kRenewedBefore{30};
/// Clocks that are behind see it too.
constexpr std::chrono::days kBackdated{1};
constexpr std::size_t kLongestCommonName = 64;

Certificate parse_certificate(const std::string& pem) {
  const crypto::BufferIo memory(BIO_new_mem_buf(pem.data(), static_cast<int>(pem.size())));
  Certificate certificate(PEM_read_bio_X509(memory.get(), nullptr, nullptr, nullptr));
  timestamp::forget_openssl_errors();
  if (!certificate) throw UsageError("there is no PEM certificate in what was given as one");
  return certificate;
}

bool is_address(const std::string& name) {
  return name.find(':') != std::string::npos || name.find_first_not_of("0123456789.") == std::string::npos;
}

bool names_all(X509* certificate, const std::vector<std::string>& names) {
  for (const std::string& name : names) {
    const int named = is_address(name) ? X509_check_ip_asc(certificate, name.c_str(), 0)
                                       : X509_check_host(certificate, name.c_str(), name.size(), 0, nullptr);
    if (named != 1) return false;
  }
  return true;
}

bool lasts(X509* certificate) {
  const auto until = std::chrono::system_clock::to_time_t(std::chrono::system_clock::now() + kRenewedBefore);
  time_t at = until;
  return X509_cmp_time(X509_get0_notAfter(certificate), &at) > 0;
}

/// Half of an older pair may be left where a disk was full between the two.
bool belong_together(X509* certificate, const crypto::Secret& key_pem) {
  const ByteView bytes = key_pem.bytes();
  const crypto::BufferIo memory(BIO_new_mem_buf(bytes.data(), static_cast<int>(bytes.size())));
  const crypto::PrivateKey key(PEM_read_bio_PrivateKey(memory.get(), nullptr, nullptr, nullptr));
  const bool yes = key && X509_check_private_key(certificate, key.get()) == 1;
  timestamp::forget_openssl_errors();
  return yes;
}

/// What lies there and can be used; nothing where it must be made.
std::optional<ServerCertificate> usable(const fs::path& certificate_file, const fs::path& key_file,
                                        const std::vector<std::string>& names) {
  std::error_code ignored;
  if (!fs::exists(certificate_file, ignored) || !fs::exists(key_file, ignored)) return {};
  try {
    ServerCertificate found = load_certificate(certificate_file, key_file);
    const Certificate certificate = parse_certificate(found.certificate_pem);
    if (names_all(certificate.get(), names) && lasts(certificate.get()) &&
        belong_together(certificate.get(), found.key_pem))
      return found;
  } catch (const UsageError&) {
    return {};  // an empty file, for instance, where a disk was full
  }
  return {};
}

/// Of several servers that start on one home, one makes the pair.
Descriptor lock_of(const fs::path& file) {
  Descriptor lock(::open(file.c_str(), O_RDWR | O_CREAT | O_CLOEXEC | O_NOFOLLOW, kKeyMode));
  int status = lock ? 0 : -1;
  do {
    if (lock) status = ::flock(lock.number(), LOCK_EX);
  } while (lock && status != 0 && errno == EINTR);
  if (status != 0)
    throw Error("cannot make the server's certificate: " + file.string() + ": " + std::strerror(errno));
  return lock;
}

std::string text_of_memory(const crypto::BufferIo& memory) {
  char* data = nullptr;
  const long size = BIO_get_mem_data(memory.get(), &data);
  return {data, static_cast<std::size_t>(size)};
}

ServerCertificate make_certificate(const std::vector<std::string>& names) {
  const auto now = std::chrono::time_point_cast<UtcTime::duration>(std::chrono::system_clock::now());
  timestamp::CertificateProfile profile;
  profile.organisation = "Kiroku";
  profile.common_name = names.front().substr(0, kLongestCommonName);
  profile.not_before = now - kBackdated;
  profile.not_after = now - kBackdated + kValidity;
  profile.extended_key_usage = "serverAuth";
  for (const std::string& name : names) {
    profile.alternative_names += (profile.alternative_names.empty() ? "" : ",") +
                                 std::string(is_address(name) ? "IP:" : "DNS:") + name;
  }
  const timestamp::Credential made = timestamp::issue_certificate(profile, nullptr);
  const crypto::BufferIo certificate(BIO_new(BIO_s_mem()));
  const crypto::BufferIo key(BIO_new(BIO_s_secmem()));
  if (!certificate || !key || PEM_write_bio_X509(certificate.get(), made.certificate.get()) != 1 ||
      PEM_write_bio_PKCS8PrivateKey(key.get(), made.key.get(), nullptr, nullptr, 0, nullptr, nullptr) != 1) {
    throw Error("cannot write the server's certificate: " + crypto::last_openssl_error());
  }
  char* data = nullptr;
  const long size = BIO_get_mem_data(key.get(), &data);
  return {text_of_memory(certificate),
          crypto::Secret::copy_of(std::string_view(data, static_cast<std::size_t>(size)))};
}

}  // namespace

std::string fingerprint(const std::string& certificate_pem) {
  const Certificate certificate = parse_certificate(certificate_pem);
  const Bytes der = timestamp::encode_with<i2d_X509>(certificate.get());
  constexpr std::string_view kDigits = "0123456789ABCDEF";
  std::string out;
  for (const std::byte each : crypto::sha256(der)) {
    if (!out.empty()) out += ':';
    out += kDigits[std::to_integer<std::size_t>(each >> 4)];
    out += kDigits[std::to_integer<std::size_t>(each & std::byte{0x0f})];
  }
  return out;
}

ServerCertificate load_certificate(const fs::path& certificate, const fs::path& key) {
  Bytes key_bytes = timestamp::read_small_file(key);
  ServerCertificate out{std::string(text_of(timestamp::read_small_file(certificate))),
                        crypto::Secret::copy_of(key_bytes)};
  crypto::zeroise(key_bytes);
  if (out.key_pem.text().find("ENCRYPTED") != std::string_view::npos) {
    throw UsageError(key.string() +
                     " has a passphrase: a server that starts by itself needs a key without one");
  }
  parse_certificate(out.certificate_pem);
  return out;
}

ServerCertificate own_certificate(const fs::path& folder, const std::vector<std::string>& names, bool& made) {
  const fs::path certificate_file = folder / "viewer.pem";
  const fs::path key_file = folder / "viewer.key";
  made = false;
  if (auto found = usable(certificate_file, key_file, names)) return std::move(*found);
  const Descriptor lock = lock_of(folder / "viewer.lock");
  // Another server may have made it meanwhile.
  if (auto found = usable(certificate_file, key_file, names)) return std::move(*found);
  ServerCertificate fresh = make_certificate(names);
  timestamp::replace_file(key_file, fresh.key_pem.bytes(), kKeyMode);
  timestamp::replace_file(certificate_file, bytes_of(fresh.certificate_pem), kCertificateMode);
  made = true;
  return fresh;
}

std::vector<std::string> machine_names() {
  std::vector<std::string> names;
  std::array<char, 256> host{};
  if (::gethostname(host.data(), host.size() - 1) == 0 && host[0] != '\0') {
    const std::string name = host.data();
    names.push_back(name);
    if (const std::size_t dot = name.find('.'); dot != std::string::npos)
      names.push_back(name.substr(0, dot));
  }
  if (names.empty() || names.front() != "localhost") names.emplace_back("localhost");
  names.emplace_back("127.0.0.1");
  names.emplace_back("::1");
  return names;
}

}  // namespace kiroku::viewer

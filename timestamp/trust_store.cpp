#include <cerrno>
#include <fstream>
#include <iterator>

#include <openssl/err.h>
#include <openssl/pem.h>
#include <openssl/x509v3.h>

#include "base/error.h"
#include "timestamp/own_authority.h"
#include "timestamp/trust_store_state.h"

namespace kiroku::timestamp {
namespace {

/// Never asks a person for a passphrase, as OpenSSL's default would.
int no_passphrase(char* /*buffer*/, int /*size*/, int /*for_writing*/, void* /*data*/) { return -1; }

/// All certificates of a PEM text (other PEM blocks are passed over), or the one of a DER file.
std::vector<Certificate> read_certificates(ByteView bytes, const std::string& name) {
  std::vector<Certificate> out;
  if (auto single = decode_with<Certificate, d2i_X509>(bytes)) {
    out.push_back(std::move(single));
    return out;
  }
  const BioHandle input(BIO_new_mem_buf(bytes.data(), static_cast<int>(bytes.size())));
  while (input) {
    Certificate next(PEM_read_bio_X509(input.get(), nullptr, no_passphrase, nullptr));
    if (!next) break;
    out.push_back(std::move(next));
  }
  const unsigned long reason = ERR_peek_last_error();
  const bool at_end = ERR_GET_LIB(reason) == ERR_LIB_PEM && ERR_GET_REASON(reason) == PEM_R_NO_START_LINE;
  forget_openssl_errors();
  if (out.empty()) throw Error("there is no certificate (PEM or DER) in " + name);
  if (!at_end) {
    throw Error("certificate number " + std::to_string(out.size() + 1) + " in " + name +
                " is malformed: export it anew");
  }
  return out;
}

/// read_certificates, with what OpenSSL otherwise finds out at the first use (names, key identifiers,
/// purposes) found out now: a store is read by several threads at once, and then none of them writes.
std::vector<Certificate> read_shared_certificates(ByteView bytes, const std::string& name) {
  auto out = read_certificates(bytes, name);
  for (const auto& certificate : out) X509_check_purpose(certificate.get(), -1, 0);
  forget_openssl_errors();
  return out;
}

Bytes read_file(const std::filesystem::path& file) {
  errno = 0;
  std::ifstream in(file, std::ios::binary);
  const std::string text((std::istreambuf_iterator<char>(in)), std::istreambuf_iterator<char>());
  if (!in.good() && !in.eof()) throw IoError("read certificates from", file, errno == 0 ? EIO : errno);
  if (!in.is_open()) throw IoError("read certificates from", file, errno == 0 ? ENOENT : errno);
  return to_bytes(text);
}

void make_store(Anchors& anchors) {
  anchors.store.reset(X509_STORE_new());
  if (!anchors.store) throw Error("cannot make a certificate store: " + crypto::last_openssl_error());
}

std::size_t add_to(Anchors& anchors, ByteView pem_or_der, const std::string& name) {
  auto certificates = read_shared_certificates(pem_or_der, name);
  for (auto& certificate : certificates) {
    if (X509_STORE_add_cert(anchors.store.get(), certificate.get()) != 1) {
      throw Error("cannot trust a certificate of " + name + ": " + crypto::last_openssl_error());
    }
    anchors.certificates.push_back(std::move(certificate));
  }
  return certificates.size();
}

}  // namespace

TrustStore::TrustStore() : state_(std::make_unique<State>()) {
  make_store(state_->outside);
  make_store(state_->own);
}
TrustStore::TrustStore(TrustStore&&) noexcept = default;
TrustStore& TrustStore::operator=(TrustStore&&) noexcept = default;
TrustStore::~TrustStore() = default;

std::size_t TrustStore::add_trusted(ByteView pem_or_der, const std::string& name_for_errors) {
  return add_to(state_->outside, pem_or_der, name_for_errors);
}

std::size_t TrustStore::add_own_authority(ByteView pem_or_der, const std::string& name_for_errors) {
  return add_to(state_->own, pem_or_der, name_for_errors);
}

std::size_t TrustStore::add_untrusted(ByteView pem_or_der, const std::string& name_for_errors) {
  auto certificates = read_shared_certificates(pem_or_der, name_for_errors);
  for (auto& certificate : certificates) state_->untrusted.push_back(std::move(certificate));
  return certificates.size();
}

std::size_t TrustStore::add_trusted_file(const std::filesystem::path& file) {
  return add_trusted(read_file(file), file.string());
}

std::size_t TrustStore::add_own_authority_file(const std::filesystem::path& file) {
  return add_own_authority(read_file(file), file.string());
}

std::size_t TrustStore::add_untrusted_file(const std::filesystem::path& file) {
  return add_untrusted(read_file(file), file.string());
}

bool TrustStore::has_trusted() const {
  return !state_->outside.certificates.empty() || !state_->own.certificates.empty();
}

std::vector<std::string> TrustStore::own_among_outside() const {
  std::vector<std::string> subjects;
  for (const Certificate& certificate : state_->outside.certificates) {
    if (is_own_authority(certificate.get(), state_->own.certificates)) {
      subjects.push_back(subject_of(certificate.get()));
    }
  }
  return subjects;
}

}  // namespace kiroku::timestamp

// An authority whose certificates servers may ask their clients for. For tests.
#pragma once

#include <filesystem>
#include <memory>
#include <stdexcept>
#include <string>

#include <openssl/evp.h>
#include <openssl/pem.h>
#include <openssl/x509v3.h>

namespace kiroku::test {

class ClientAuthority {
 public:
  /// Writes its own certificate to NAME.pem in `folder`.
  ClientAuthority(const std::filesystem::path& folder, const std::string& name)
      : folder_(folder), name_(name), key_(make_key()), certificate_(make(key_.get(), name, true)) {
    write(file(), certificate_.get(), nullptr);
  }
  [[nodiscard]] std::string file() const { return (folder_ / (name_ + ".pem")).string(); }
  /// A PEM file with a certificate for `subject` and its key.
  [[nodiscard]] std::string issue(const std::string& subject) const {
    const Key key = make_key();
    const Certificate certificate = make(key.get(), subject, false);
    std::string path = (folder_ / (subject + "-of-" + name_ + ".pem")).string();
    write(path, certificate.get(), key.get());
    return path;
  }

 private:
  struct Free {
    void operator()(EVP_PKEY* key) const { EVP_PKEY_free(key); }
    void operator()(X509* certificate) const { X509_free(certificate); }
    void operator()(X509_EXTENSION* extension) const { X509_EXTENSION_free(extension); }
    void operator()(std::FILE* file) const { std::fclose(file); }
  };
  using Key = std::unique_ptr<EVP_PKEY, Free>;
  using Certificate = std::unique_ptr<X509, Free>;

  static void require(bool holds) {
    if (!holds) throw std::runtime_error("OpenSSL cannot make a certificate");
  }
  static Key make_key() { return Key(EVP_PKEY_Q_keygen(nullptr, nullptr, "EC", "P-256")); }
  [[nodiscard]] Certificate make(EVP_PKEY* key, const std::string& subject, bool is_own) const {
    Certificate made(X509_new());
    X509* const x509 = made.get();
    require(key != nullptr && X509_set_version(x509, X509_VERSION_3) == 1);
    ASN1_INTEGER_set(X509_get_serialNumber(x509), is_own ? 1 : 2);
    X509_gmtime_adj(X509_getm_notBefore(x509), -3600);
    X509_gmtime_adj(X509_getm_notAfter(x509), 3600);
    X509_set_pubkey(x509, key);
    X509_NAME_add_entry_by_txt(X509_get_subject_name(x509), "CN", MBSTRING_UTF8,
                               reinterpret_cast<const unsigned char*>(subject.c_str()), -1, -1, 0);
    X509_set_issuer_name(x509,
                         is_own ? X509_get_subject_name(x509) : X509_get_subject_name(certificate_.get()));
    const std::unique_ptr<X509_EXTENSION, Free> basic(X509V3_EXT_conf_nid(
        nullptr, nullptr, NID_basic_constraints, is_own ? "critical,CA:TRUE" : "critical,CA:FALSE"));
    require(basic && X509_add_ext(x509, basic.get(), -1) == 1);
    require(X509_sign(x509, is_own ? key : key_.get(), EVP_sha256()) > 0);
    return made;
  }
  static void write(const std::string& path, X509* certificate, EVP_PKEY* key) {
    const std::unique_ptr<std::FILE, Free> file(std::fopen(path.c_str(), "w"));
    require(file && PEM_write_X509(file.get(), certificate) == 1);
    require(key == nullptr ||
            PEM_write_PrivateKey(file.get(), key, nullptr, nullptr, 0, nullptr, nullptr) == 1);
  }

  std::filesystem::path folder_;
  std::string name_;
  Key key_;
  Certificate certificate_;
};

}  // namespace kiroku::test

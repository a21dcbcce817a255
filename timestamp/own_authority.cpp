#include "timestamp/own_authority.h"

#include <algorithm>
#include <string_view>

#include "timestamp/authority.h"

namespace kiroku::timestamp {
namespace {

bool has_common_name(const X509_NAME* name, std::string_view wanted) {
  for (int at = X509_NAME_get_index_by_NID(name, NID_commonName, -1); at >= 0;
       at = X509_NAME_get_index_by_NID(name, NID_commonName, at)) {
    const ByteView text = view_of(X509_NAME_ENTRY_get_data(X509_NAME_get_entry(name, at)));
    if (text_of(text) == wanted) return true;
  }
  return false;
}

bool has_same_key(const X509* a, const X509* b) {
  const bool same = EVP_PKEY_eq(X509_get0_pubkey(a), X509_get0_pubkey(b)) == 1;
  forget_openssl_errors();
  return same;
}

}  // namespace

bool is_own_authority(const X509* certificate, const std::vector<Certificate>& own) {
  return has_common_name(X509_get_subject_name(certificate), kEmbeddedRootName) ||
         has_common_name(X509_get_issuer_name(certificate), kEmbeddedRootName) ||
         std::any_of(own.begin(), own.end(),
                     [&](const Certificate& each) { return has_same_key(certificate, each.get()); });
}

}  // namespace kiroku::timestamp

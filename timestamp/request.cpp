#include "timestamp/request.h"

#include <array>

#include "base/error.h"
#include "crypto/secret.h"
#include "timestamp/asn1_objects.h"

namespace kiroku::timestamp {
namespace {

void require(bool done, const char* step) {
  if (!done) {
    throw Error(std::string("cannot write a time-stamp request: ") + step + " failed (" +
                crypto::last_openssl_error() + ")");
  }
}

RequestParse failed(RequestFailure failure, std::string explanation) {
  return {{}, failure, std::move(explanation)};
}

}  // namespace

Request make_request(crypto::HashAlgorithm algorithm, ByteView imprint) {
  Request request;
  request.algorithm = algorithm;
  request.imprint = to_bytes(imprint);
  std::array<std::byte, 8> random{};
  crypto::fill_random(random);
  // The top bit set makes it 64 bits always: no leading zeros whose treatment authorities disagree about.
  random[0] |= std::byte{0x80};
  request.nonce = to_bytes(ByteView(random));
  return request;
}

Bytes encode_request(const Request& request) {
  if (request.imprint.size() != crypto::hash_size(request.algorithm)) {
    throw UsageError("cannot write a time-stamp request: an imprint of " +
                     std::to_string(request.imprint.size()) + " bytes is no " +
                     std::string(crypto::hash_name(request.algorithm)) + " hash, which has " +
                     std::to_string(crypto::hash_size(request.algorithm)));
  }
  const TsRequest out(TS_REQ_new());
  const TsImprint imprint(TS_MSG_IMPRINT_new());
  const AlgorithmIdentifier algorithm(X509_ALGOR_new());
  require(out && imprint && algorithm, "allocation");
  require(X509_ALGOR_set0(algorithm.get(), OBJ_nid2obj(EVP_MD_get_type(message_digest_of(request.algorithm))),
                          V_ASN1_NULL, nullptr) == 1,
          "the hash algorithm");
  // OpenSSL takes the imprint without const, and copies it.
  Bytes hash = request.imprint;
  require(TS_MSG_IMPRINT_set_algo(imprint.get(), algorithm.get()) == 1 &&
              TS_MSG_IMPRINT_set_msg(imprint.get(), reinterpret_cast<unsigned char*>(hash.data()),
                                     int(hash.size())) == 1 &&
              TS_REQ_set_version(out.get(), 1) == 1 && TS_REQ_set_msg_imprint(out.get(), imprint.get()) == 1,
          "the imprint");
  if (request.policy) {
    const Asn1Object policy(OBJ_txt2obj(request.policy->c_str(), 1));
    forget_openssl_errors();
    if (!policy) {
      throw UsageError("cannot write a time-stamp request: policy '" + *request.policy +
                       "' is no object identifier such as 1.2.3.4");
    }
    require(TS_REQ_set_policy_id(out.get(), policy.get()) == 1, "the policy");
  }
  if (request.nonce) {
    const BigNumber number(BN_bin2bn(octets_of(*request.nonce), int(request.nonce->size()), nullptr));
    require(number != nullptr, "the nonce");
    const Asn1Integer nonce(BN_to_ASN1_INTEGER(number.get(), nullptr));
    require(nonce && TS_REQ_set_nonce(out.get(), nonce.get()) == 1, "the nonce");
  }
  require(TS_REQ_set_cert_req(out.get(), request.want_certificates ? 1 : 0) == 1, "certReq");
  Bytes der = encode_with<i2d_TS_REQ>(out.get());
  require(!der.empty(), "DER encoding");
  return der;
}

RequestParse parse_request(ByteView der) {
  const auto request = decode_with<TsRequest, d2i_TS_REQ>(der);
  if (!request) {
    return failed(RequestFailure::kBadDataFormat, "the query is not a DER TimeStampReq (RFC 3161)");
  }
  if (TS_REQ_get_version(request.get()) != 1) {
    return failed(RequestFailure::kBadRequest, "the query has version " +
                                                   std::to_string(TS_REQ_get_version(request.get())) +
                                                   ", where RFC 3161 knows only version 1");
  }
  TS_MSG_IMPRINT* imprint = TS_REQ_get_msg_imprint(request.get());
  const X509_ALGOR* identifier = TS_MSG_IMPRINT_get_algo(imprint);
  Request out;
  const auto algorithm = hash_algorithm_of(identifier);
  if (!algorithm) {
    const ASN1_OBJECT* object = nullptr;
    X509_ALGOR_get0(&object, nullptr, nullptr, identifier);
    return failed(RequestFailure::kBadAlgorithm, "the query's hash algorithm " + name_of(object) +
                                                     " is not stamped here: use SHA-2 or SHA-3 of at "
                                                     "least 256 bits");
  }
  out.algorithm = *algorithm;
  out.imprint = to_bytes(view_of(TS_MSG_IMPRINT_get_msg(imprint)));
  if (out.imprint.size() != crypto::hash_size(*algorithm)) {
    return failed(RequestFailure::kBadDataFormat,
                  "the query's imprint has " + std::to_string(out.imprint.size()) + " bytes, a " +
                      std::string(crypto::hash_name(*algorithm)) + " hash has " +
                      std::to_string(crypto::hash_size(*algorithm)));
  }
  if (const ASN1_OBJECT* policy = TS_REQ_get_policy_id(request.get())) out.policy = dotted(policy);
  if (const ASN1_INTEGER* nonce = TS_REQ_get_nonce(request.get())) out.nonce = integer_octets(nonce);
  out.want_certificates = TS_REQ_get_cert_req(request.get()) != 0;
  if (TS_REQ_get_ext_count(request.get()) > 0) {
    return failed(RequestFailure::kUnacceptedExtension,
                  "the query carries extensions, none of which is known here");
  }
  return {std::move(out), {}, {}};
}

}  // namespace kiroku::timestamp

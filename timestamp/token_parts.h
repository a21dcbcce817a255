// Inside a token, for token.cpp and token_verifier.cpp: the CMS envelope and the TSTInfo in it.
#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "timestamp/asn1_objects.h"
#include "timestamp/token.h"

namespace kiroku::timestamp {

inline constexpr std::string_view kNoSignedData = "the token is not one CMS SignedData (RFC 5652)";

/// The CMS SignedData of a token; nothing (and why) for anything else. BER is accepted where CMS permits it
/// (RFC 5652 section 4), trailing bytes never.
CmsContent parse_envelope(ByteView token, std::string& explanation);
/// A token in two parts: the envelope without its X.509 certificates, for parse_envelope, and these.
struct SplitToken {
  Bytes envelope;
  std::vector<ByteView> certificates;  // in `token`, each a SEQUENCE
};
/// Nothing where the token has not the form of a SignedData whose certificates can be told from the rest, as
/// where it has two sets of them. The signature is not over them (RFC 5652 section 5.4), nor over any of the
/// lengths that change.
std::optional<SplitToken> split_certificates(ByteView token);
/// The attached TSTInfo of parse_envelope's result, which must outlive it; nothing (and why) if other content
/// was signed or the content is detached.
std::optional<ByteView> attached_info(CMS_ContentInfo* envelope, std::string& explanation);
/// TSTInfo from its bytes. DER is demanded, as RFC 3161 section 2.4.2 does: one meaning, one form. Refuses
/// versions other than 1, critical extensions (none is known here), and values out of RFC 3161's ranges.
std::optional<TokenInfo> parse_tst_info(ByteView der, std::string& explanation);

/// SignedData and its first SignerInfo state their versions where OpenSSL does not show them.
struct EnvelopeVersions {
  int signed_data = -1;
  int signer_info = -1;
};
/// Of a token that parse_envelope accepted; -1 where a version is not a small number.
EnvelopeVersions versions_of(ByteView token);

}  // namespace kiroku::timestamp

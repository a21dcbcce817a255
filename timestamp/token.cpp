#include "timestamp/token.h"

#include "timestamp/der.h"
#include "timestamp/token_parts.h"

namespace kiroku::timestamp {
namespace {

/// A PKIStatus or version: one octet, not negative.
std::optional<int> small_number(const std::optional<DerElement>& element) {
  if (!element || element->content.size() != 1) return {};
  const int value = std::to_integer<int>(element->content[0]);
  if (value > 0x7f) return {};
  return value;
}

/// PKIFailureInfo is a BIT STRING of which one bit is set: its number.
std::optional<int> first_bit(ByteView bit_string) {
  if (bit_string.empty()) return {};
  for (std::size_t i = 1; i < bit_string.size(); ++i) {
    for (int bit = 0; bit < 8; ++bit) {
      if ((std::to_integer<unsigned>(bit_string[i]) & (0x80U >> bit)) != 0) return int(i - 1) * 8 + bit;
    }
  }
  return {};
}

/// PKIStatusInfo ::= SEQUENCE { status INTEGER, statusString PKIFreeText OPTIONAL, failInfo BIT STRING
/// OPTIONAL }
bool read_status_info(ByteView content, Response& response) {
  DerReader reader(content);
  const auto status = small_number(reader.next(der::kInteger));
  if (!status) return false;
  response.status = *status;
  if (const auto free_text = reader.next(der::kSequence)) {
    DerReader texts(free_text->content);
    while (!texts.at_end()) {
      const auto text = texts.next(der::kUtf8String);
      if (!text) return false;
      response.status_text.push_back(printable(text->content));
    }
  }
  if (const auto failure = reader.next(der::kBitString)) response.failure_info = first_bit(failure->content);
  return reader.at_end();
}

}  // namespace

std::optional<Response> parse_response(ByteView der, std::string& explanation) {
  const auto starts_with = [](ByteView bytes, std::uint8_t identifier) {
    return !bytes.empty() && bytes[0] == std::byte{identifier};
  };
  Response response;
  // A bare token starts with its content type, a TimeStampResp with a PKIStatusInfo.
  DerReader bare(der, Encoding::kBer);
  if (const auto outer = bare.next(der::kSequence);
      outer && starts_with(outer->content, der::kObjectIdentifier)) {
    if (!bare.at_end()) {
      explanation = "bytes follow after the end of the token";
      return {};
    }
    response.token = to_bytes(der);
    return response;
  }
  DerReader whole(der);
  const auto outer = whole.next(der::kSequence);
  if (!outer) {
    explanation = starts_with(der, '<') ? "the bytes are a text page, not a time-stamp response"
                                        : "the bytes are neither a DER TimeStampResp nor a token (RFC 3161)";
    return {};
  }
  if (!whole.at_end()) {
    explanation = "bytes follow after the end of the time-stamp response";
    return {};
  }
  DerReader parts(outer->content);
  const auto status_info = parts.next(der::kSequence);
  if (!status_info || !read_status_info(status_info->content, response)) {
    explanation = "the response does not start with a PKIStatusInfo (RFC 3161 section 2.4.2)";
    return {};
  }
  response.token = to_bytes(parts.rest());
  const bool granted = response.status == 0 || response.status == 1;
  if (granted == response.token.empty()) {
    explanation = granted ? "the response says granted, but holds no token"
                          : "the response says rejected, but holds a token";
    return {};
  }
  return response;
}

std::optional<TokenInfo> parse_token_info(ByteView token, std::string& explanation) {
  const CmsContent envelope = parse_envelope(token, explanation);
  if (!envelope) return {};
  const auto content = attached_info(envelope.get(), explanation);
  if (!content) return {};
  return parse_tst_info(*content, explanation);
}

CmsContent parse_envelope(ByteView token, std::string& explanation) {
  auto envelope = decode_with<CmsContent, d2i_CMS_ContentInfo>(token);
  if (!envelope || OBJ_obj2nid(CMS_get0_type(envelope.get())) != NID_pkcs7_signed) {
    explanation = kNoSignedData;
    return {};
  }
  return envelope;
}

std::optional<SplitToken> split_certificates(ByteView token) {
  // ContentInfo { contentType, [0] SignedData { version, digestAlgorithms, encapContentInfo,
  //               certificates [0] OPTIONAL, crls [1] OPTIONAL, signerInfos } }
  const auto all_of = [](ByteView bytes) -> std::optional<std::vector<DerElement>> {
    std::vector<DerElement> found;
    DerReader reader(bytes, Encoding::kBer);
    while (const auto element = reader.next()) found.push_back(*element);
    return reader.at_end() ? std::optional(std::move(found)) : std::nullopt;
  };
  const auto only_of = [&](ByteView bytes, std::uint8_t identifier) -> std::optional<DerElement> {
    const auto found = all_of(bytes);
    return found && found->size() == 1 && found->front().identifier == identifier
               ? std::optional(found->front())
               : std::nullopt;
  };
  const auto content_info = only_of(token, der::kSequence);
  const auto parts = content_info ? all_of(content_info->content) : std::nullopt;
  if (!parts || parts->size() != 2 || (*parts)[1].identifier != der::kContext0) return {};
  const auto signed_data = only_of((*parts)[1].content, der::kSequence);
  const auto members = signed_data ? all_of(signed_data->content) : std::nullopt;
  constexpr std::size_t kCertificates = 3;
  if (!members || members->size() <= kCertificates) return {};
  SplitToken split;
  Bytes kept;
  const auto keep = [](Bytes& to, ByteView bytes) { to.insert(to.end(), bytes.begin(), bytes.end()); };
  for (std::size_t i = 0; i < members->size(); ++i) {
    const bool is_bag = (*members)[i].identifier == der::kContext0;
    if (is_bag && i != kCertificates) return {};  // without the first, the second would be read in its place
    if (!is_bag) {
      keep(kept, (*members)[i].whole);
      continue;
    }
    const auto choices = all_of((*members)[i].content);
    if (!choices) return {};
    Bytes others;  // attribute certificates and other forms, which OpenSSL reads with the rest
    for (const DerElement& choice : *choices) {
      if (choice.identifier == der::kSequence) {
        split.certificates.push_back(choice.whole);
      } else {
        keep(others, choice.whole);
      }
    }
    if (!others.empty()) keep(kept, der_value(der::kContext0, {others}));
  }
  const Bytes inner = der_value(der::kContext0, {der_value(der::kSequence, {kept})});
  split.envelope = der_value(der::kSequence, {(*parts)[0].whole, inner});
  return split;
}

std::optional<ByteView> attached_info(CMS_ContentInfo* envelope, std::string& explanation) {
  if (OBJ_obj2nid(CMS_get0_eContentType(envelope)) != NID_id_smime_ct_TSTInfo) {
    explanation = "what was signed is not a TSTInfo but " + dotted(CMS_get0_eContentType(envelope));
    return {};
  }
  ASN1_OCTET_STRING** content = CMS_get0_content(envelope);
  forget_openssl_errors();
  if (content == nullptr || *content == nullptr) {
    explanation = "the TSTInfo is not inside the token";
    return {};
  }
  return view_of(*content);
}

EnvelopeVersions versions_of(ByteView token) {
  EnvelopeVersions versions;
  // ContentInfo { contentType, [0] SignedData { version, …, signerInfos SET OF { version, … } } }
  const auto first_inside = [](const std::optional<DerElement>& outer, std::uint8_t identifier) {
    return outer ? DerReader(outer->content, Encoding::kBer).next(identifier) : std::nullopt;
  };
  DerReader content_info(token, Encoding::kBer);
  const auto outer = content_info.next(der::kSequence);
  if (!outer) return versions;
  DerReader fields(outer->content, Encoding::kBer);
  fields.next(der::kObjectIdentifier);
  const auto signed_data = first_inside(fields.next(der::kContext0), der::kSequence);
  versions.signed_data = small_number(first_inside(signed_data, der::kInteger)).value_or(-1);
  if (!signed_data) return versions;
  DerReader members(signed_data->content, Encoding::kBer);
  std::optional<DerElement> last;
  while (const auto member = members.next()) last = member;
  if (!last || last->whole[0] != std::byte{der::kSet}) return versions;
  versions.signer_info =
      small_number(first_inside(first_inside(last, der::kSequence), der::kInteger)).value_or(-1);
  return versions;
}

}  // namespace kiroku::timestamp

#include "evidence/record.h"

#include <algorithm>
#include <initializer_list>
#include <memory>
#include <utility>

#include <openssl/asn1t.h>

#include "base/error.h"
#include "timestamp/asn1_objects.h"
#include "timestamp/der.h"

namespace kiroku::evidence {
namespace {

using timestamp::DerElement;
using timestamp::DerReader;

// -- RFC 4998 appendix A (a module with implicit tags) as OpenSSL's templates

using Asn1HashList = STACK_OF(ASN1_OCTET_STRING);

struct Asn1TimeStamp {
  X509_ALGOR* digest_algorithm;
  STACK_OF(X509_ATTRIBUTE) * attributes;
  STACK_OF(Asn1HashList) * reduced_tree;
  ASN1_TYPE* token;  // any SEQUENCE: OpenSSL keeps its bytes as they are
};
using Asn1Chain = STACK_OF(Asn1TimeStamp);

struct Asn1EncryptionInfo {
  ASN1_OBJECT* type;
  ASN1_TYPE* value;
};

struct Asn1Record {
  ASN1_INTEGER* version;
  STACK_OF(X509_ALGOR) * digest_algorithms;
  STACK_OF(X509_ATTRIBUTE) * crypto_infos;
  Asn1EncryptionInfo* encryption_info;
  STACK_OF(Asn1Chain) * chains;
};

DEFINE_STACK_OF(ASN1_OCTET_STRING)
DEFINE_STACK_OF(Asn1HashList)
DEFINE_STACK_OF(Asn1TimeStamp)
DEFINE_STACK_OF(Asn1Chain)

// clang-format off
ASN1_ITEM_TEMPLATE(Asn1HashList) = ASN1_EX_TEMPLATE_TYPE(ASN1_TFLG_SEQUENCE_OF, 0, values, ASN1_OCTET_STRING)
static_ASN1_ITEM_TEMPLATE_END(Asn1HashList)

ASN1_SEQUENCE(Asn1TimeStamp) = {
    ASN1_IMP_OPT(Asn1TimeStamp, digest_algorithm, X509_ALGOR, 0),
    ASN1_IMP_SET_OF_OPT(Asn1TimeStamp, attributes, X509_ATTRIBUTE, 1),
    ASN1_IMP_SEQUENCE_OF_OPT(Asn1TimeStamp, reduced_tree, Asn1HashList, 2),
    ASN1_SIMPLE(Asn1TimeStamp, token, ASN1_ANY),
} static_ASN1_SEQUENCE_END(Asn1TimeStamp)

ASN1_ITEM_TEMPLATE(Asn1Chain) = ASN1_EX_TEMPLATE_TYPE(ASN1_TFLG_SEQUENCE_OF, 0, time_stamps, Asn1TimeStamp)
static_ASN1_ITEM_TEMPLATE_END(Asn1Chain)

ASN1_SEQUENCE(Asn1EncryptionInfo) = {
    ASN1_SIMPLE(Asn1EncryptionInfo, type, ASN1_OBJECT),
    ASN1_SIMPLE(Asn1EncryptionInfo, value, ASN1_ANY),
} static_ASN1_SEQUENCE_END(Asn1EncryptionInfo)

ASN1_SEQUENCE(Asn1Record) = {
    ASN1_SIMPLE(Asn1Record, version, ASN1_INTEGER),
    ASN1_SEQUENCE_OF(Asn1Record, digest_algorithms, X509_ALGOR),
    ASN1_IMP_SEQUENCE_OF_OPT(Asn1Record, crypto_infos, X509_ATTRIBUTE, 0),
    ASN1_IMP_OPT(Asn1Record, encryption_info, Asn1EncryptionInfo, 1),
    ASN1_SEQUENCE_OF(Asn1Record, chains, Asn1Chain),
} static_ASN1_SEQUENCE_END(Asn1Record)

ASN1_ITEM_TEMPLATE(Asn1Infos) = ASN1_EX_TEMPLATE_TYPE(ASN1_TFLG_SEQUENCE_OF, 0, infos, X509_ATTRIBUTE)
static_ASN1_ITEM_TEMPLATE_END(Asn1Infos)

ASN1_ITEM_TEMPLATE(Asn1Attributes) = ASN1_EX_TEMPLATE_TYPE(ASN1_TFLG_SET_OF, 0, attributes, X509_ATTRIBUTE)
static_ASN1_ITEM_TEMPLATE_END(Asn1Attributes)
    // clang-format on

    /// Frees what one of the templates above made.
    template <auto Item>
    struct ItemDeleter {
  void operator()(void* value) const { ASN1_item_free(static_cast<ASN1_VALUE*>(value), Item()); }
};
using RecordHandle = std::unique_ptr<Asn1Record, ItemDeleter<Asn1Record_it>>;
using ChainHandle = std::unique_ptr<Asn1Chain, ItemDeleter<Asn1Chain_it>>;
using TimeStampHandle = std::unique_ptr<Asn1TimeStamp, ItemDeleter<Asn1TimeStamp_it>>;

/// Identifier octets that the record's optional fields have.
constexpr std::uint8_t kField0 = 0xa0;
constexpr std::uint8_t kField1 = 0xa1;
constexpr std::uint8_t kField2 = 0xa2;

Bytes der_of(void* value, const ASN1_ITEM* item) {
  unsigned char* out = nullptr;
  const int size = ASN1_item_i2d(static_cast<ASN1_VALUE*>(value), &out, item);
  const std::unique_ptr<unsigned char, decltype([](unsigned char* p) { OPENSSL_free(p); })> owned(out);
  if (size < 0) throw Error("cannot write an evidence record: " + crypto::last_openssl_error());
  return to_bytes(std::as_bytes(std::span(out, static_cast<std::size_t>(size))));
}

template <typename T>
T* decoded(ByteView der, const ASN1_ITEM* item) {
  const unsigned char* at = timestamp::octets_of(der);
  auto* value = reinterpret_cast<T*>(ASN1_item_d2i(nullptr, &at, static_cast<long>(der.size()), item));
  timestamp::forget_openssl_errors();
  if (value != nullptr && at != timestamp::octets_of(der) + der.size()) {
    ASN1_item_free(reinterpret_cast<ASN1_VALUE*>(value), item);
    return nullptr;
  }
  return value;
}

void require_made(bool made) {
  if (!made) throw Error("cannot write an evidence record: " + crypto::last_openssl_error());
}

// -- the bounds, before OpenSSL takes memory

/// Why something is refused: its place and a sentence.
struct Shape {
  std::string refusal;
  bool refuse(const std::string& place, const std::string& what) {
    refusal = place + " " + what;
    return false;
  }

  bool check_hash_lists(const DerElement& tree, const std::string& place) {
    std::size_t lists = 0;
    for (DerReader reader(tree.content); !reader.at_end(); ++lists) {
      const std::string here = place + ".reducedHashtree[" + std::to_string(lists) + "]";
      const auto list = reader.next(timestamp::der::kSequence);
      if (!list) return refuse(here, "is no list of hash values");
      if (lists >= kMostHashLists) {
        return refuse(here, "is one list more than the " + std::to_string(kMostHashLists) + " that may be");
      }
      if (list->content.empty()) return refuse(here, "is an empty list");
      std::size_t values = 0;
      for (DerReader inner(list->content); !inner.at_end(); ++values) {
        const auto value = inner.next(timestamp::der::kOctetString);
        if (!value || value->content.size() < kShortestHash || value->content.size() > kLongestHash) {
          return refuse(here + "[" + std::to_string(values) + "]", "is no hash value");
        }
      }
    }
    return lists > 0 || refuse(place + ".reducedHashtree", "is empty");
  }

  bool check_time_stamp(const DerElement& time_stamp, const std::string& place) {
    DerReader reader(time_stamp.content);
    const auto algorithm = reader.next(kField0);
    const auto attributes = reader.next(kField1);
    const auto tree = reader.next(kField2);
    const auto token = DerReader(reader.rest(), timestamp::Encoding::kBer).next(timestamp::der::kSequence);
    if (algorithm && algorithm->whole.size() > kLongestIdentifier) {
      return refuse(place + ".digestAlgorithm", "is too long");
    }
    if (attributes && attributes->whole.size() > kMaximumPartBytes) {
      return refuse(place + ".attributes", "have more than 1 MiB");
    }
    if (tree && !check_hash_lists(*tree, place)) return false;
    if (!token) return refuse(place + ".timeStamp", "is no token, or something else stands before it");
    if (token->whole.size() != reader.rest().size()) return refuse(place, "goes on behind its timeStamp");
    if (token->whole.size() > kMaximumPartBytes) return refuse(place + ".timeStamp", "has more than 1 MiB");
    return true;
  }

  bool check_chains(const DerElement& sequence) {
    std::size_t chains = 0;
    std::size_t all = 0;
    std::size_t before = 0;
    std::size_t hashed_again = 0;
    for (DerReader reader(sequence.content); !reader.at_end(); ++chains) {
      const std::string place = "archiveTimeStampSequence[" + std::to_string(chains) + "]";
      const auto chain = reader.next(timestamp::der::kSequence);
      if (!chain) return refuse(place, "is no chain of time-stamps");
      if (chains >= kMostChains) {
        return refuse(place, "is one chain more than the " + std::to_string(kMostChains) + " that may be");
      }
      if (chain->content.empty()) return refuse(place, "is an empty chain");
      hashed_again += before;
      before += chain->whole.size();
      const std::size_t most = kMostTimesHashedAgain * sequence.whole.size() + kAlwaysHashedAgain;
      if (hashed_again > most) {
        return refuse(place, "is one renewal too many: for all of them " + std::to_string(hashed_again) +
                                 " bytes of chains would be hashed again, and " + std::to_string(most) +
                                 " may be");
      }
      std::size_t number = 0;
      for (DerReader inner(chain->content); !inner.at_end(); ++number) {
        const auto time_stamp = inner.next(timestamp::der::kSequence);
        if (!time_stamp) return refuse(place_of(chains, number), "is no archive time-stamp");
        if (++all > kMostTimeStamps) {
          return refuse(place_of(chains, number), "is one time-stamp more than the " +
                                                      std::to_string(kMostTimeStamps) + " that may be");
        }
        if (!check_time_stamp(*time_stamp, place_of(chains, number))) return false;
      }
    }
    return chains > 0 || refuse("archiveTimeStampSequence", "is empty");
  }

  bool check_record(ByteView der) {
    if (der.size() > kMaximumRecordBytes) return refuse("the file", "has more than 32 MiB");
    const auto whole = timestamp::sole_element(der, timestamp::der::kSequence);
    if (!whole) return refuse("the file", "is no DER value, or holds more than one");
    DerReader reader(whole->content);
    const auto version = reader.next(timestamp::der::kInteger);
    if (!version) return refuse("version", "is missing: this is no evidence record");
    if (version->content.size() != 1 || version->content[0] != std::byte{1}) {
      return refuse("version", "is not 1, the only one of RFC 4998");
    }
    const auto algorithms = reader.next(timestamp::der::kSequence);
    if (!algorithms) return refuse("digestAlgorithms", "are missing");
    std::size_t count = 0;
    for (DerReader inner(algorithms->content); !inner.at_end(); ++count) {
      const auto one = inner.next(timestamp::der::kSequence);
      if (!one || one->whole.size() > kLongestIdentifier || count >= kMostAlgorithms) {
        return refuse("digestAlgorithms[" + std::to_string(count) + "]",
                      "is no algorithm identifier, or one too many");
      }
    }
    const auto infos = reader.next(kField0);
    const auto encryption = reader.next(kField1);
    if (infos && infos->whole.size() > kMaximumPartBytes)
      return refuse("cryptoInfos", "have more than 1 MiB");
    if (encryption && encryption->whole.size() > kMaximumPartBytes) {
      return refuse("encryptionInfo", "has more than 1 MiB");
    }
    const auto chains = reader.next(timestamp::der::kSequence);
    if (!chains) return refuse("archiveTimeStampSequence", "is missing, or something else stands before it");
    if (!reader.at_end()) return refuse("the record", "goes on behind its archiveTimeStampSequence");
    return check_chains(*chains);
  }

  static constexpr std::size_t kShortestHash = 20;
  static constexpr std::size_t kLongestHash = 64;
  static constexpr std::size_t kLongestIdentifier = 1024;
};

// -- between templates and values

/// The same value under another identifier octet.
Bytes retagged(ByteView der, std::uint8_t identifier) {
  Bytes out = to_bytes(der);
  out.front() = std::byte{identifier};
  return out;
}

NamedHash named_hash_of(const X509_ALGOR* identifier) {
  NamedHash out;
  out.algorithm = timestamp::hash_algorithm_of(identifier);
  out.identifier = timestamp::encode_with<i2d_X509_ALGOR>(identifier);
  if (out.algorithm) {
    out.name = crypto::hash_name(*out.algorithm);
  } else {
    const ASN1_OBJECT* object = nullptr;
    X509_ALGOR_get0(&object, nullptr, nullptr, identifier);
    out.name = timestamp::name_of(object);
    if (OBJ_obj2nid(object) == NID_sha224) out.algorithm = crypto::HashAlgorithm::kSha224;
  }
  return out;
}

ArchiveTimeStamp time_stamp_of(const Asn1TimeStamp& from) {
  ArchiveTimeStamp out;
  if (from.digest_algorithm != nullptr) out.digest_algorithm = named_hash_of(from.digest_algorithm);
  if (from.attributes != nullptr) {
    out.attributes = retagged(der_of(from.attributes, Asn1Attributes_it()), kField1);
  }
  for (int i = 0; i < sk_Asn1HashList_num(from.reduced_tree); ++i) {
    const Asn1HashList* list = sk_Asn1HashList_value(from.reduced_tree, i);
    HashList values;
    values.reserve(static_cast<std::size_t>(sk_ASN1_OCTET_STRING_num(list)));
    for (int k = 0; k < sk_ASN1_OCTET_STRING_num(list); ++k) {
      values.push_back(to_bytes(timestamp::view_of(sk_ASN1_OCTET_STRING_value(list, k))));
    }
    out.reduced_tree.push_back(std::move(values));
  }
  out.token = to_bytes(timestamp::view_of(from.token->value.sequence));
  return out;
}

/// `from` is of the shape that was checked.
EvidenceRecord record_of(const Asn1Record& from) {
  EvidenceRecord out;
  for (int i = 0; i < sk_X509_ALGOR_num(from.digest_algorithms); ++i) {
    out.digest_algorithms.push_back(named_hash_of(sk_X509_ALGOR_value(from.digest_algorithms, i)));
  }
  if (from.crypto_infos != nullptr) {
    out.crypto_infos = retagged(der_of(from.crypto_infos, Asn1Infos_it()), kField0);
  }
  if (from.encryption_info != nullptr) {
    out.encryption_info = retagged(der_of(from.encryption_info, Asn1EncryptionInfo_it()), kField1);
  }
  for (int i = 0; i < sk_Asn1Chain_num(from.chains); ++i) {
    const Asn1Chain* chain = sk_Asn1Chain_value(from.chains, i);
    ArchiveTimeStampChain time_stamps;
    for (int k = 0; k < sk_Asn1TimeStamp_num(chain); ++k) {
      time_stamps.push_back(time_stamp_of(*sk_Asn1TimeStamp_value(chain, k)));
    }
    out.chains.push_back(std::move(time_stamps));
  }
  return out;
}

X509_ALGOR* algorithm_from(const NamedHash& hash) {
  auto* made = decoded<X509_ALGOR>(hash.identifier, ASN1_ITEM_rptr(X509_ALGOR));
  require_made(made != nullptr);
  return made;
}

Asn1HashList* hash_list_from(const HashList& values) {
  std::unique_ptr<Asn1HashList, ItemDeleter<Asn1HashList_it>> list(sk_ASN1_OCTET_STRING_new_null());
  require_made(bool(list));
  for (const Bytes& value : values) {
    ASN1_OCTET_STRING* made = ASN1_OCTET_STRING_new();
    require_made(made != nullptr && sk_ASN1_OCTET_STRING_push(list.get(), made) > 0);
    require_made(ASN1_OCTET_STRING_set(made, timestamp::octets_of(value), int(value.size())) == 1);
  }
  return list.release();
}

Asn1TimeStamp* time_stamp_from(const ArchiveTimeStamp& from) {
  TimeStampHandle out(reinterpret_cast<Asn1TimeStamp*>(ASN1_item_new(Asn1TimeStamp_it())));
  require_made(bool(out));
  if (from.digest_algorithm) out->digest_algorithm = algorithm_from(*from.digest_algorithm);
  if (!from.attributes.empty()) {
    out->attributes = decoded<STACK_OF(X509_ATTRIBUTE)>(retagged(from.attributes, timestamp::der::kSet),
                                                        Asn1Attributes_it());
    require_made(out->attributes != nullptr);
  }
  if (!from.reduced_tree.empty()) {
    out->reduced_tree = sk_Asn1HashList_new_null();
    require_made(out->reduced_tree != nullptr);
    for (const HashList& values : from.reduced_tree) {
      require_made(sk_Asn1HashList_push(out->reduced_tree, hash_list_from(values)) > 0);
    }
  }
  ASN1_TYPE_free(out->token);
  out->token = decoded<ASN1_TYPE>(from.token, ASN1_ITEM_rptr(ASN1_ANY));
  require_made(out->token != nullptr && out->token->type == V_ASN1_SEQUENCE);
  return out.release();
}

Asn1Chain* chain_from(const ArchiveTimeStampChain& from) {
  ChainHandle chain(sk_Asn1TimeStamp_new_null());
  require_made(bool(chain));
  for (const ArchiveTimeStamp& time_stamp : from) {
    require_made(sk_Asn1TimeStamp_push(chain.get(), time_stamp_from(time_stamp)) > 0);
  }
  return chain.release();
}

Bytes encode(const EvidenceRecord& record) {
  const RecordHandle out(reinterpret_cast<Asn1Record*>(ASN1_item_new(Asn1Record_it())));
  require_made(out && ASN1_INTEGER_set(out->version, 1) == 1);
  for (const NamedHash& hash : record.digest_algorithms) {
    require_made(sk_X509_ALGOR_push(out->digest_algorithms, algorithm_from(hash)) > 0);
  }
  if (!record.crypto_infos.empty()) {
    out->crypto_infos = decoded<STACK_OF(X509_ATTRIBUTE)>(
        retagged(record.crypto_infos, timestamp::der::kSequence), Asn1Infos_it());
    require_made(out->crypto_infos != nullptr);
  }
  if (!record.encryption_info.empty()) {
    out->encryption_info = decoded<Asn1EncryptionInfo>(
        retagged(record.encryption_info, timestamp::der::kSequence), Asn1EncryptionInfo_it());
    require_made(out->encryption_info != nullptr);
  }
  for (const ArchiveTimeStampChain& chain : record.chains) {
    require_made(sk_Asn1Chain_push(out->chains, chain_from(chain)) > 0);
  }
  return der_of(out.get(), Asn1Record_it());
}

}  // namespace

std::string place_of(std::size_t chain, std::size_t time_stamp) {
  return "archiveTimeStampSequence[" + std::to_string(chain) + "][" + std::to_string(time_stamp) + "]";
}

NamedHash named_hash(crypto::HashAlgorithm algorithm) {
  const timestamp::AlgorithmIdentifier identifier(X509_ALGOR_new());
  require_made(bool(identifier));
  // RFC 5754 section 2: no parameters.
  require_made(X509_ALGOR_set0(identifier.get(),
                               OBJ_nid2obj(EVP_MD_get_type(timestamp::message_digest_of(algorithm))),
                               V_ASN1_UNDEF, nullptr) == 1);
  return named_hash_of(identifier.get());
}

RecordParse parse_record(ByteView der) {
  Shape shape;
  if (!shape.check_record(der)) return {{}, shape.refusal};
  const RecordHandle read(decoded<Asn1Record>(der, Asn1Record_it()));
  if (!read) return {{}, "the record is no EvidenceRecord of RFC 4998"};
  // What was signed over is the record's DER. Where these bytes are another form of the same values, a hash
  // over them would not be the one that was time-stamped.
  if (!std::ranges::equal(der_of(read.get(), Asn1Record_it()), der)) return {{}, "the record is not in DER"};
  return {record_of(*read), {}};
}

Bytes encode_record(const EvidenceRecord& record) {
  Bytes der = encode(record);
  if (const RecordParse again = parse_record(der); !again.record) {
    throw Error("cannot write an evidence record: " + again.explanation);
  }
  return der;
}

Bytes encode_chain(const ArchiveTimeStampChain& chain) {
  const ChainHandle made(chain_from(chain));
  return der_of(made.get(), Asn1Chain_it());
}

Bytes sequence_of_chains(ByteView chains) {
  return timestamp::der_value(timestamp::der::kSequence, {chains});
}

}  // namespace kiroku::evidence

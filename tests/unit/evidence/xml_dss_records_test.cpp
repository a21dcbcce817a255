// The evidence records in XML (RFC 6283) of the European Commission's DSS (https://github.com/esig/dss),
// judged as DSS's own tests of them say (dss-evidence-record-xml/src/test).
#include <gtest/gtest.h>

#include "base/error.h"
#include "crypto/encoding.h"
#include "evidence/xml_canonical.h"
#include "evidence/xml_record.h"
#include "tests/support/dss_records.h"
#include "tests/support/evidence_kit.h"

namespace kiroku::evidence {
namespace {

using crypto::HashAlgorithm;

/// `tokens`: for each time-stamp i (imprint intact) or x (not), where it renews also + or - (what was before
/// it is covered), of a hash-tree renewal also d or n (so is data).
using Expected = test::DssExpectation;

std::vector<Expected> expectations() {
  const std::string uuid = "da2e47f2-53f4-4610-8210-f0f05d67d0c9", xades = "file:valid-xades-t.xml",
                    sample = "file:sample-c14n.xml";
  const std::string simple = "sha256:qC9i7yNq1pZCzScV+ya3oBVRR9Y92gnDdYWTCQ8nstU=",
                    one = "sha256:wdJQjRgWwoDzjsTFVz4hWJLb3rAf9MdJsQH474EfMAA=",
                    other = "sha256:hNS7x84dr9TdyUMAOk+yQxbDcghyVH4n3WOYqrgrbYc=",
                    last = "sha256:AuXvCat2Iu4KxJAd/hPwCFSm0+hF+BWlDsvfKvEGpfg=",
                    with_data = "sha256:dCeyHarzzN3cWzVNTMKZyY00rW4gNGGto/2ZLfzpsXM=";
  const std::string renewed =
      "sha512:t/eDuu2Cl/DbkXRiGE/08I5pwtXl95qUJgD5cl9Yzh8pwYE5v4CwbA//K900c4RS7PQMSIwip+PYDN9vnBwNRw==";
  const std::string same =
      "sha512:NhX4DJ0pPtdAJof5SyLVjlKbjMeRb4+sf933+9WvTPd309eVp6AKFr9+fz+5Vh7puq5IDan+ehh2nnGIawPzFQ==";
  const std::string chained =
      "sha256:sq/z8fJz0dy6uDA8Xuc4ycGpY6wdD5YcYF8FRlvixAI= "
      "sha512:F3lElKvRVhSsXfS8P+YPEXkoK+hS9f0CPF9U/9wJ4Q7T4/UHOOmYF/PKS/0AuJkl1QL7Imw5Q983WAtFd7cTrg==";
  const std::string unlike =
      "sha512:rZ+Vr390XICOXivb252JTm1p86XzihaSKYi2YpB48oQweb9PYzuWJiM2ijr0y+qdTfV2PLMQvILXsNWnw+h13w==";
  const std::string perfect =
      "sha512:d6BJBxVejc24ABnmqz38Zoq85Bcf2twnb/kVM8dz51uHLLZEgEkGvtdcy5oDf5MTVSkAR+ryjiPMw3R+/mg2hg==";
  constexpr std::size_t kAny = std::size_t(-1);
  return {
      {"CmsSignature", "er-Signature-C-LT.xml", {"file:Signature-C-LT.p7m"}, 1, 0, "i"},
      {"ChainRenewalCopiedTstNoHashTree",
       "er-chain-renewal-copied-tst-no-hashtree.xml",
       {uuid},
       1,
       0,
       "2 of 3",
       "record-imprint-differs [1][1]"},
      {"ChainRenewalCopiedTst",
       "er-chain-renewal-copied-tst.xml",
       {uuid},
       1,
       0,
       "i x+d",
       "record-imprint-differs [1][0]"},
      {"ChainRenewalFiveAtsChain", "er-chain-renewal-five-atschain.xml", {xades}, 1, 0, "i i+d i+d i+d i+d"},
      {"ChainRenewalInvalid",
       "er-chain-renewal-invalid.xml",
       {chained},
       1,
       0,
       "i i-d",
       "record-link-missing [1][0]"},
      {"ChainRenewalMissingDocRef",
       "er-chain-renewal-missing-doc-ref.xml",
       {uuid},
       1,
       0,
       "i x+n",
       "record-data-not-covered [1][0]"},
      {"ChainRenewalNoHashTree",
       "er-chain-renewal-no-hashtree.xml",
       {uuid},
       1,
       0,
       "i x+n",
       "record-data-not-covered [1][0]"},
      {"ChainRenewalThreeAtsChain", "er-chain-renewal-three-atschain.xml", {xades}, 1, 0, "i i+d i+d"},
      {"ChainRenewalTstRenewalManyTimes",
       "er-chain-renewal-tst-renewal-chain-renewal.xml",
       {xades},
       1,
       kAny,
       "1 3 2"},
      {"ChainRenewalTstRenewal", "er-chain-renewal-tst-renewal.xml", {xades}, 1, 0, "1 1 1"},
      {"ChainRenewalTwoAtsChain", "er-chain-renewal-two-atschain.xml", {xades}, 1, 0, "i i+d"},
      {"ChainRenewal", "er-chain-renewal.xml", {uuid}, 1, 0, "i i+d"},
      {"DataObjectGroupSameDigest", "er-data-group-same-digest.xml", {same}, 3, 0, "i"},
      {"DataObjectGroup", "er-data-group.xml", {"HELLO", "BYE", "CIAO"}, 3, 0, "all"},
      {"DiffPrefix",
       "er-diff-prefix.xml",
       {"sha256:MpVJQIYeSHwy2BZBjp7hlzzRYzJ2ijY05vfW0yS0OsY=",
        "sha256:gTKownnX+TP6TAxAhrcOHbPZ0LjUnPbD11GrTQECVOU="},
       2,
       0,
       "i"},
      {"NoDetachedData", "er-simple.xml", {}, 0, 1, "i"},
      {"NoHashTreeNoData", "er-no-hashtree.xml", {}, 0, 0, "x", "record-data-not-covered [0][0] open"},
      {"NoHashTreeInvalidDigest", "er-no-hashtree.xml", {other}, 1, 0, "x", "record-imprint-differs [0][0]"},
      {"NoHashTree", "er-no-hashtree.xml", {one}, 1, 0, "i"},
      {"NoHashTreeXmlArchiveObject", "er-no-hashtree-xml.xml", {sample}, 1, 0, "i"},
      {"NotPerfectTree", "er-not-perfect-tree.xml", {unlike}, 1, 0, "i"},
      {"OnTimestamp", "er-on-tst.xml", {"file:d-trust.tsr"}, kAny, kAny, "i"},
      {"OnXmlDocument", "er-xml-document.xml", {sample}, 1, 0, "i"},
      {"OneLevel", "er-one-level.xml", {one}, 1, 0, "i"},
      {"OneOfDataObjectGroup", "er-data-group.xml", {"HELLO"}, 1, kAny, "imprints"},
      {"PerfectTree", "er-perfect-tree.xml", {perfect}, 1, 0, "i"},
      {"SameDocDigest", "er-same-digest.xml", {same}, kAny, 0, "i"},
      {"Simple", "er-simple.xml", {simple}, 1, 0, "i"},
      {"SimpleWithByteOrderMark", "er-simple-bom.xml", {simple}, 1, 0, "i"},
      {"TimestampRenewalInvalidNoHashTree",
       "er-tst-renewal-no-hashtree-invalid.xml",
       {renewed},
       1,
       0,
       "i x+",
       "record-imprint-differs [0][1]"},
      {"TimestampRenewalInvalid",
       "er-tst-renewal-invalid.xml",
       {"sha256:Y0sCextp4SQtQNU+MSs7SsdxD1W+gfKJtUlEbvZ3i+4="},
       1,
       0,
       "i i- i-",
       "record-link-missing [0][1], record-link-missing [0][2]"},
      {"TimestampRenewalNoHashTree", "er-tst-renewal-no-hashtree.xml", {renewed}, 1, 0, "i i+"},
      {"TimestampRenewalSameTst",
       "er-tst-renewal-same-tst.xml",
       {renewed},
       1,
       0,
       "i x+",
       "record-imprint-differs [0][1]"},
      {"TimestampRenewal", "er-tst-renewal.xml", {renewed}, 1, 0, "i i+"},
      {"TstRenewalWithValidationData", "er-simple-validation-data-renewal.xml", {with_data}, 1, 0, "i i+"},
      {"TwoLevelsInvalidDigest", "er-two-levels.xml", {last}, 0, 1, "i", "record-data-not-covered [0][0]"},
      {"TwoLevels", "er-two-levels.xml", {one}, 1, 0, "i"},
      {"WithValidationData", "er-simple-validation-data.xml", {with_data}, 1, 0, "i"},
  };
}

class DssXmlRecord : public test::DssTest {
 protected:
  static Bytes file(const std::string& name) { return resource("dss-evidence-record-xml", name); }
  static XmlRecord record_in(const std::string& name) {
    const Bytes bytes = file(name);
    return XmlRecord::parse(text_of(bytes));
  }
};

TEST_P(DssXmlRecord, IsJudgedAsItsOwnTestSays) {
  const Expected& expected = GetParam();
  const XmlRecord record = record_in(expected.file);
  std::vector<Bytes> files;
  files.reserve(expected.data.size());
  std::vector<DataObject> objects;
  for (const std::string& text : expected.data) {
    if (text.starts_with("file:")) {
      files.push_back(file(text.substr(5)));
      objects.push_back(test::object_of(std::string(text_of(files.back()))));
      objects.back().content = files.back();
    } else {
      objects.push_back(text.starts_with("sha") ? test::object_by_hashes(text) : test::object_of(text));
    }
  }
  const RecordJudgement judgement = record.judge(objects, {.now = utc_now()});

  std::string told, problems;
  std::array<int, 3> kinds{};
  std::size_t intact = 0;
  for (const TimeStampJudgement& each : judgement.time_stamps) {
    ++kinds.at(std::size_t(each.kind));
    intact += each.imprint_fits ? 1U : 0U;
    told += std::string(told.empty() ? "" : " ") + (each.imprint_fits ? "i" : "x");
    if (each.kind != StampKind::kFirst) told += each.covers_previous ? "+" : "-";
    if (each.kind == StampKind::kHashTreeRenewal) told += each.objects.empty() ? "n" : "d";
    // No root is trusted: a good signature by a certificate of nobody's trust, or over MD5, which does not
    // count here.
    const bool weak = each.token.explanation.starts_with("the token is signed over a md5 hash");
    EXPECT_EQ(each.token.code, weak ? timestamp::TokenCode::kWeakAlgorithm : timestamp::TokenCode::kNoTrust)
        << each.token.explanation;
  }
  for (const Problem& problem : judgement.problems) problems += problem.text + "\n";
  const std::string tokens = expected.tokens;
  if (tokens == "all" || tokens == "imprints") {
    EXPECT_EQ(intact, judgement.time_stamps.size()) << told << "\n" << problems;
    EXPECT_EQ(told.find('-'), std::string::npos) << told << "\n" << problems;
  } else if (tokens == "2 of 3") {
    EXPECT_EQ(std::to_string(intact) + " of " + std::to_string(judgement.time_stamps.size()), tokens) << told;
  } else if (std::isdigit(tokens[0]) != 0) {
    EXPECT_EQ(std::to_string(kinds[0]) + " " + std::to_string(kinds[1]) + " " + std::to_string(kinds[2]),
              tokens);
    EXPECT_EQ(told.find_first_of("x-n"), std::string::npos) << told << "\n" << problems;
  } else {
    EXPECT_EQ(told, tokens) << problems;
  }

  test::expect_judged(judgement, objects.size(), expected);
  // Data that is XML is covered by its canonical form in each of them.
  for (std::size_t i = 0; i < objects.size(); ++i)
    EXPECT_EQ(judgement.only_as_canonical[i], objects[i].content && begins_as_xml(*objects[i].content)) << i;
}

INSTANTIATE_TEST_SUITE_P(Xml, DssXmlRecord, ::testing::ValuesIn(expectations()),
                         [](const auto& each) { return std::string(each.param.name); });

class DssXmlFile : public DssXmlRecord {};

// DSS's XMLEvidenceRecordValidatorTest: what is a record, and what is none.
TEST_P(DssXmlFile, IsARecordOrNone) {
  const Bytes bytes = file(GetParam().file);
  ASSERT_FALSE(bytes.empty());
  bool is_one = true;
  try {
    XmlRecord::parse(text_of(bytes));
  } catch (const Error&) {
    is_one = false;
  }
  EXPECT_EQ(is_one, GetParam().found == 1);
}

INSTANTIATE_TEST_SUITE_P(Xml, DssXmlFile,
                         ::testing::Values(Expected{"Simple", "er-simple.xml", {}, 1, 0, ""},
                                           Expected{"PerfectTree", "er-perfect-tree.xml", {}, 1, 0, ""},
                                           Expected{"TstRenewal", "er-tst-renewal.xml", {}, 1, 0, ""},
                                           Expected{"ChainRenewal", "er-chain-renewal.xml", {}, 1, 0, ""},
                                           Expected{"ByteOrderMark", "er-simple-bom.xml", {}, 1, 0, ""},
                                           Expected{"Malformed", "er-malformed.xml", {}, 0, 0, ""},
                                           Expected{"Cms", "Signature-C-LT.p7m", {}, 0, 0, ""},
                                           Expected{"Xades", "valid-xades.xml", {}, 0, 0, ""}),
                         [](const auto& each) { return std::string(each.param.name); });

class DssDigests : public DssXmlRecord {};

// DSS's XMLEvidenceRecordDataObjectDigestBuilderTest and XMLEvidenceRecordRenewalDigestBuilderTest.
TEST_P(DssDigests, AreThoseOfItsOwnTests) {
  const Bytes bytes = file(GetParam().file);
  const pugi::xml_document document = parse_xml(text_of(bytes));
  const Canonicalization how = canonicalization_named(GetParam().data.front()).value();
  const std::string expected = GetParam().data.back();
  const pugi::xml_node root = document.document_element();
  const std::string name = GetParam().tokens;
  std::string form;
  if (name.empty()) {
    form = canonical_document(document, how);
  } else {
    const auto named = [&](const pugi::xml_node& node) { return local_name_of(node) == name; };
    form = canonical_element(root.find_node(named), how);
  }
  const HashAlgorithm algorithm = GetParam().found == 256 ? HashAlgorithm::kSha256 : HashAlgorithm::kSha512;
  EXPECT_EQ(crypto::to_base64(crypto::digest(algorithm, bytes_of(form)), crypto::Base64Padding::kPadded),
            crypto::from_hex(expected)
                ? crypto::to_base64(*crypto::from_hex(expected), crypto::Base64Padding::kPadded)
                : expected);
}

constexpr const char* kDssInclusive = "http://www.w3.org/TR/2001/REC-xml-c14n-20010315";
constexpr const char* kDssInclusiveWithComments =
    "http://www.w3.org/TR/2001/REC-xml-c14n-20010315#WithComments";
constexpr const char* kDssExclusiveWithComments = "http://www.w3.org/2001/10/xml-exc-c14n#WithComments";
INSTANTIATE_TEST_SUITE_P(
    Xml, DssDigests,
    ::testing::Values(
        Expected{"Data",
                 "sample-c14n.xml",
                 {kDssInclusive, "/TiBXkCOtm0bSdOukpXHtqSu6G5EPRfwyYH9DJ9YtCE="},
                 256,
                 0,
                 ""},
        Expected{"DataBySha512",
                 "sample-c14n.xml",
                 {kDssInclusive,
                  "m5PJAJpfXjJB2KHyZaVkgX/QCM3CrBGX/AeXZY985k337ZOjHr7rxyE6mY+TFy/vk6AOa1DoYRyg/"
                  "yJCRDcFlQ=="},
                 512,
                 0,
                 ""},
        Expected{"DataWithComments",
                 "sample-c14n.xml",
                 {kDssInclusiveWithComments, "0VrRKOvUCLDg3QSMAzIrdahAmiCo/AFTFAjd5FZDx+0="},
                 256,
                 0,
                 ""},
        Expected{"Sequence",
                 "er-chain-single.xml",
                 {kDssInclusive,
                  "372922594c52cffb7b3a8c1203081ec1e1a38bbf32958627f7f123ab2281ac343b21cacd12fb1856b153c74"
                  "bb7c4c16e641bba375f99a017c11177cab38b93a5"},
                 512,
                 0,
                 "ArchiveTimeStampSequence"},
        Expected{"SequenceExclusivelyWithComments",
                 "er-chain-single.xml",
                 {kDssExclusiveWithComments,
                  "db5d10cc3ac168317dcca5a7a7c351e25b65add0cda1cf48e28d8c443c483891c8804973b596317"
                  "e56791f340ec002282cd2a6d9b32b82ef667a41dc63a79366"},
                 512,
                 0,
                 "ArchiveTimeStampSequence"}),
    [](const auto& each) { return std::string(each.param.name); });

}  // namespace
}  // namespace kiroku::evidence

// The evidence records of the European Commission's DSS (https://github.com/esig/dss), judged as DSS's own
// tests of them say (dss-evidence-record-asn1/src/test).
//
// DSS tells of each record which data was found in it, how many values are of nothing that was given
// ("orphans"), and of each token whether its imprint is the tree's root and its signature is good. No root is
// trusted.
#include "tests/support/dss_records.h"

#include <array>

#include <gtest/gtest.h>

#include "crypto/encoding.h"
#include "evidence/record_verifier.h"
#include "tests/support/evidence_kit.h"

namespace kiroku::evidence {
namespace {

/// `tokens`: for each time-stamp i (imprint intact) or x (not), where it renews a chain also whether the data
/// was found under it: + or -, and of a time-stamp renewal whether the token before it was.
using Expected = test::DssExpectation;

const std::vector<Expected>& expectations() {
  const std::string tab = "\t", one = "\1", two = "\2", three = "\3";
  const std::string d1 = "sha256:nOLX01D5QYQHQ58MoR3MEquffNsV+ezF7Kk1SCYCuHI=";
  const std::string d2 = "sha256:7sxNM1LA6WX9iHle39GmDFrAmzwRAMBS67auC9NDKyY=";
  const std::vector<std::string> group{"sha256:EPRF0uQcTYjnF+PyR1a52z9fXpKZEAUx3d+jQAFfPos=",
                                       "sha256:Oida+g+rN0DmsVgqZOgAex7lYghgYcgQth4CXl5idH0=",
                                       "sha256:ZAiUg2B6CyVNPSiMgeaR4utRLwD3PPvMMBwXt0r3L7E=",
                                       "sha256:go+iO1ByVKxsnCPfTfTkZ9WYK45d52Dc7mrV1lUl6Ho=",
                                       "sha256:kG60U/JtBW9QHmxPX2+FH+I3q6FvtwS0G0kE1j6BT4Q=",
                                       "sha256:zFMwgPw86LH0Py/DPEAqMA3uqMgatCJe0UwKJxifjD8="};
  const std::string bin = "sha256:odTntQ2Wk/mjGy6UhOpq36WFg3cw/iupTROl1MgcMt8=";
  const std::string bin_two = "sha256:2Eg+KWYIINZGWWKP1rUlW4zrtlKk5Ws2VEVJA6fSSgQ=";
  const std::string wrong = "sha256:t+btFtQajsHkMsByflnnYdSUwKbYnlRhV4rVJsoiw2o=";
  const std::string wrong_too = "sha256:nOrPvuvr+9Pj2QlFxQ3o4Oxzn9iVqadG31KDHNRlgKY=";
  constexpr std::size_t kAny = std::size_t(-1);
  static const std::vector<Expected> all{
      {"ChainRenewalDuplicatedDataInvalid",
       "er-asn1-chain-renewal-duplicated-data-invalid.ers",
       {tab},
       2,
       3,
       "i i-",
       "record-data-not-covered [1][0]"},
      {"ChainRenewalInvalid",
       "er-asn1-chain-renewal-invalid.ers",
       {tab},
       1,
       0,
       "i x+",
       "record-imprint-differs [1][0]"},
      {"ChainRenewal",
       "ER-2Chains3ATS.ers",
       {"content of data object DO-01", "content of data object DO-02"},
       kAny,
       0,
       "i i+ i+"},
      {"FullRenewalDuplicatedData", "er-asn1-full-renewal-duplicated-data.ers", {tab}, kAny, kAny, "i i+ i+"},
  };
  static const std::vector<Expected> more = [&] {
    std::vector<Expected> out = all;
    out.push_back({"FullRenewalOneDocumentFiveAtsChain",
                   "er-asn1-full-renewal-five-ats-chain.ers",
                   {three},
                   1,
                   kAny,
                   "1 1 5"});
    out.push_back(
        {"FullRenewalOneDocumentProvided", "er-asn1-full-renewal.ers", {three}, 1, kAny, "i i+ i+"});
    out.push_back({"FullRenewalOneDocumentThreeAtsChain",
                   "er-asn1-full-renewal-three-ats-chain.ers",
                   {three},
                   1,
                   kAny,
                   "1 1 3"});
    out.push_back({"FullRenewalOneDocumentTwoAtsChain",
                   "er-asn1-full-renewal-two-ats-chain.ers",
                   {three},
                   1,
                   kAny,
                   "1 1 2"});
    out.push_back({"FullRenewalTstRenewalManyTimes",
                   "er-asn1-full-renewal-tst-renewal-chain-renewal.ers",
                   {three},
                   1,
                   kAny,
                   "1 4 2"});
    out.push_back(
        {"FullRenewalTstRenewal", "er-asn1-full-renewal-tst-renewal.ers", {three}, 1, kAny, "1 2 1"});
    out.push_back({"FullRenewal", "er-asn1-full-renewal.ers", {three, one}, 2, 0, "i i+ i+"});
    out.push_back({"GroupOneDocument", "evidencerecord.ers", {group[1]}, 1, 5, "i"});
    out.push_back({"Group", "evidencerecord.ers", group, 6, 0, "i"});
    out.push_back({"InvalidRef", "BIN-1_ER.ers", {bin, wrong}, 1, 1, "i", "record-data-not-covered [0][0]"});
    out.push_back({"Invalid",
                   "er-asn1-simple-invalid.ers",
                   {"sha256:nOPX01D5QYQHQ58MoR3MEquffNsV+ezF7Kk1SCYCuHI=",
                    "sha256:7s1NM1LA6WX9iHle39GmDFrAmzwRAMBS67auC9NDKyY="},
                   2,
                   0,
                   "x",
                   "record-imprint-differs [0][0]"});
    out.push_back({"NoDetachedData", "BIN-1_ER.ers", {}, 0, 2, "i"});
    out.push_back(
        {"NoHashTree", "1_0_Initial.er", {"123456"}, 1, 0, "i", "record-algorithm-not-listed [0][0]"});
    out.push_back({"NoHashTree1Renew",
                   "1_1_Renew_Unsorted.er",
                   {"123456"},
                   1,
                   0,
                   "i i+",
                   "record-algorithm-not-listed [0][0]"});
    out.push_back({"NoHashTree2Renew",
                   "1_2_Renew_Unsorted.er",
                   {"123456"},
                   1,
                   0,
                   "i i+ i+",
                   "record-algorithm-not-listed [0][0]"});
    out.push_back({"NoHashTree3Renew",
                   "1_3_Renew_Unsorted.er",
                   {"123456"},
                   1,
                   0,
                   "i i+ i+ i+",
                   "record-algorithm-not-listed [0][0]"});
    out.push_back(
        {"NoneValidRef", "BIN-1_ER.ers", {wrong_too, wrong}, 0, 2, "i", "record-data-not-covered [0][0]"});
    out.push_back({"OnTimestamp", "er-asn1-on-tst.ers", {"file:d-trust.tsr"}, 1, kAny, "i"});
    out.push_back({"OneLevelHashtree", "er-asn1-one-level-hashtree.ers", {two}, 1, kAny, "i i+ i+"});
    out.push_back({"SimpleGroup", "evidencerecord.ers", group, 6, 0, "i"});
    out.push_back({"Simple", "BIN-1_ER.ers", {bin, bin_two}, 2, 0, "i"});
    out.push_back({"TstRenewalInvalid",
                   "er-asn1-tst-renewal-invalid.ers",
                   {d1, d2},
                   2,
                   0,
                   "i x-",
                   "record-link-missing [0][1], record-imprint-differs [0][1]"});
    out.push_back({"TstRenewal", "er-asn1-tst-renewal.ers", {d1, d2}, 2, 0, "i i+"});
    out.push_back({"UncommonChainRenewal",
                   "LKSG_4.ers",
                   {"sha256:SMP/0kaannOThgfDF1Dly2qUG2Zbj5YMyNLSRZHWkO0="
                    " sha384:EfWPNqRRVrdEffJtLzF/l13oPz9qGQ5IR/sbRZxglqIzS95wy128Yi/KBEGKaIIX"},
                   1,
                   kAny,
                   "i i+"});
    out.push_back({"Validation", "er-asn1-simple.ers", {"1"}, 1, kAny, "i"});
    out.push_back({"WrongFile", "er-asn1-simple.ers", {"0"}, 0, 3, "i", "record-data-not-covered [0][0]"});
    return out;
  }();
  return more;
}

class DssRecord : public test::DssTest {
 protected:
  static Bytes file(const std::string& name) { return resource("dss-evidence-record-asn1", name); }
  static DataObject object(const std::string& text) {
    if (text.starts_with("file:")) return test::object_of(std::string(text_of(file(text.substr(5)))));
    return text.starts_with("sha256:") ? test::object_by_hashes(text) : test::object_of(text);
  }
};

TEST_P(DssRecord, IsJudgedAsItsOwnTestSays) {
  const Expected& expected = GetParam();
  const RecordParse parse = parse_record(file(expected.file));
  ASSERT_TRUE(parse.record) << parse.explanation;
  std::vector<DataObject> objects;
  for (const std::string& text : expected.data) objects.push_back(object(text));
  const RecordJudgement judgement = judge_record(*parse.record, objects, {.now = utc_now()});

  std::string told;
  std::array<int, 3> kinds{};
  for (const TimeStampJudgement& each : judgement.time_stamps) {
    // A good signature by a certificate of nobody's trust. DSS judges signatures over any hash; here those
    // over MD5, and imprints of SHA-224, do not count, and the judgement of the token ends there.
    const bool weak = each.token.explanation.starts_with("the token is signed over a md5 hash") ||
                      each.algorithm == "sha224";
    EXPECT_EQ(each.token.code, weak ? timestamp::TokenCode::kWeakAlgorithm : timestamp::TokenCode::kNoTrust)
        << each.token.explanation;
    ++kinds.at(std::size_t(each.kind));
    told += std::string(told.empty() ? "" : " ") + (each.imprint_fits ? "i" : "x");
    if (each.kind == StampKind::kTimeStampRenewal) told += each.covers_previous ? "+" : "-";
    if (each.kind == StampKind::kHashTreeRenewal) told += each.objects.empty() ? "-" : "+";
  }
  std::string problems;
  for (const Problem& problem : judgement.problems) problems += problem.text + "\n";
  if (std::isdigit(expected.tokens[0]) != 0) {
    EXPECT_EQ(std::to_string(kinds[0]) + " " + std::to_string(kinds[1]) + " " + std::to_string(kinds[2]),
              expected.tokens);
    EXPECT_EQ(told.find_first_of("x-"), std::string::npos) << told << "\n" << problems;
  } else {
    EXPECT_EQ(told, expected.tokens) << problems;
  }
  test::expect_judged(judgement, objects.size(), expected);
}

INSTANTIATE_TEST_SUITE_P(Asn1, DssRecord, ::testing::ValuesIn(expectations()),
                         [](const auto& each) { return std::string(each.param.name); });

class DssFile : public DssRecord {};

// DSS's ASN1EvidenceRecordValidatorTest: what is a record, and what is none.
TEST_P(DssFile, IsARecordOrNone) {
  const Bytes bytes = file(GetParam().file);
  ASSERT_FALSE(bytes.empty());
  EXPECT_EQ(parse_record(bytes).record.has_value(), GetParam().found == 1) << parse_record(bytes).explanation;
}

INSTANTIATE_TEST_SUITE_P(Asn1, DssFile,
                         ::testing::Values(Expected{"Bin1", "BIN-1_ER.ers", {}, 1, 0, ""},
                                           Expected{"Bin2", "BIN-2_ER.ers", {}, 1, 0, ""},
                                           Expected{"Bin3", "BIN-3_ER.ers", {}, 1, 0, ""},
                                           Expected{"Bin4", "BIN-4_ER.ers", {}, 1, 0, ""},
                                           Expected{"Bsi", "bsi_gov_vte-lza_002.ers", {}, 1, 0, ""},
                                           Expected{"TwoChains", "ER-2Chains3ATS.ers", {}, 1, 0, ""},
                                           Expected{"Group", "evidencerecord.ers", {}, 1, 0, ""},
                                           Expected{"Malformed", "BIN-1_ER_malformed.ers", {}, 0, 0, ""},
                                           Expected{"Xml", "er-simple.xml", {}, 0, 0, ""},
                                           Expected{"Data", "BIN-1.bin", {}, 0, 0, ""},
                                           Expected{"Signature", "Signature-C-LT.p7m", {}, 0, 0, ""}),
                         [](const auto& each) { return std::string(each.param.name); });

}  // namespace
}  // namespace kiroku::evidence

#include "timestamp/trusted_list.h"

#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <map>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <openssl/x509.h>

#include "base/error.h"
#include "tests/support/token_maker.h"

namespace kiroku::timestamp {
namespace {

using testing::HasSubstr;
using testing::ThrowsMessage;
using Answer = Qualification::Answer;

constexpr const char* kType = "http://uri.etsi.org/TrstSvc/Svctype/TSA/QTST";

std::string base64_of(X509* certificate) {
  std::string pem = test::pem_of(certificate);
  pem.erase(0, pem.find('\n') + 1);
  return pem.substr(0, pem.find("-----END"));
}

std::string status(const std::string& name, const std::string& since, const std::string& type = kType) {
  return "<ServiceTypeIdentifier>" + type +
         "</ServiceTypeIdentifier><ServiceName><Name xml:lang=\"de\">Stempel</Name><Name "
         "xml:lang=\"en\">Stamps "
         "\x1b[2J</Name></ServiceName><ServiceStatus>http://uri.etsi.org/TrstSvc/TrustedList/Svcstatus/" +
         name + "</ServiceStatus><StatusStartingTime>" + since + "</StatusStartingTime>";
}

/// A list with one provider; `service`: what stands in its TSPService.
std::string list_of(const std::string& service, const std::string& next = "2027-01-01T00:00:00Z") {
  return "<?xml version=\"1.0\"?><tsl:TrustServiceStatusList "
         "xmlns:tsl=\"http://uri.etsi.org/02231/v2#\"><SchemeInformation>"
         "<TSLSequenceNumber>7</TSLSequenceNumber><SchemeTerritory>XX</SchemeTerritory><ListIssueDateTime>"
         "2026-06-01T00:00:00Z</ListIssueDateTime><NextUpdate><dateTime>" +
         next +
         "</dateTime></NextUpdate></SchemeInformation><TrustServiceProviderList><TrustServiceProvider>"
         "<TSPInformation><TSPName><Name "
         "xml:lang=\"en\">Provider</Name></TSPName></TSPInformation><TSPServices>"
         "<TSPService>" +
         service +
         "</TSPService></TSPServices></TrustServiceProvider></TrustServiceProviderList></"
         "tsl:TrustServiceStatusList>";
}

std::string identity(X509* certificate) {
  return "<ServiceDigitalIdentity><DigitalId><X509Certificate>" + base64_of(certificate) +
         "</X509Certificate></DigitalId><DigitalId><X509SubjectName>CN=x</X509SubjectName></DigitalId>"
         "</ServiceDigitalIdentity>";
}

class TrustedLists : public testing::Test {
 protected:
  /// Of a token of 2026-08-05, judged under the authority's root.
  [[nodiscard]] Qualification judge(const std::string& list) const {
    test::TokenRecipe recipe;
    recipe.signer = &authority_.signer;
    recipe.enclosed = {authority_.signer.certificate.get(), authority_.ca.certificate.get()};
    TrustStore trust;
    trust.add_trusted(bytes_of(authority_.root_pem()), "root");
    Expectation expectation;
    expectation.imprint = recipe.imprint;
    const TokenJudgement judged = judge_token(test::make_token(recipe), expectation, trust);
    EXPECT_EQ(judged.code, TokenCode::kValid) << judged.explanation;
    return judge_qualification(judged, {parse_trusted_list(list, "list.xml")});
  }
  [[nodiscard]] X509* signer() const { return authority_.signer.certificate.get(); }
  [[nodiscard]] X509* ca() const { return authority_.ca.certificate.get(); }
  static std::string current(const std::string& inside) {
    return "<ServiceInformation>" + inside + "</ServiceInformation>";
  }
  static std::string earlier(const std::string& inside) {
    return "<ServiceHistory><ServiceHistoryInstance>" + inside + "</ServiceHistoryInstance></ServiceHistory>";
  }

  test::TestAuthority authority_ = test::make_test_authority();
};

TEST_F(TrustedLists, AGrantedServiceMakesItsTokensQualified) {
  for (X509* listed : {signer(), ca()}) {  // a list names the signer of tokens, or an authority above it
    const Qualification found =
        judge(list_of(current(status("granted", "2020-01-01T00:00:00Z") + identity(listed))));
    EXPECT_EQ(found.answer, Answer::kQualified);
    EXPECT_THAT(found.sentence, HasSubstr("trusted list of XX, number 7 of 2026-06-01"));
    EXPECT_THAT(found.sentence, HasSubstr("of Provider was granted from 2020-01-01"));
    EXPECT_EQ(found.sentence.find('\x1b'), std::string::npos);
  }
}

TEST_F(TrustedLists, TheStatusAtTheTokensTimeDecides) {
  const std::string id = identity(signer());
  EXPECT_EQ(judge(list_of(current(status("withdrawn", "2026-09-01T00:00:00Z") + id) +
                          earlier(status("granted", "2020-01-01T00:00:00Z"))))
                .answer,
            Answer::kQualified);
  EXPECT_EQ(judge(list_of(current(status("granted", "2026-09-01T00:00:00Z") + id) +
                          earlier(status("withdrawn", "2020-01-01T00:00:00Z"))))
                .answer,
            Answer::kNotQualified);
  EXPECT_EQ(judge(list_of(current(status("granted", "2026-09-01T00:00:00Z") + id))).answer,
            Answer::kNotQualified);
  EXPECT_EQ(judge(list_of(current(status("recognisedatnationallevel", "2020-01-01T00:00:00Z") + id))).answer,
            Answer::kNotQualified);
}

TEST_F(TrustedLists, AServiceOfAnotherKindMakesNothingQualified) {
  const std::string other = "http://uri.etsi.org/TrstSvc/Svctype/CA/QC";
  EXPECT_EQ(judge(list_of(current(status("granted", "2020-01-01T00:00:00Z", other) + identity(ca())))).answer,
            Answer::kUnknown);
  EXPECT_EQ(judge(list_of(current(status("granted", "2020-01-01T00:00:00Z", other) + identity(ca())) +
                          earlier(status("granted", "2019-01-01T00:00:00Z"))))
                .answer,
            Answer::kNotQualified);
}

TEST_F(TrustedLists, WhatAListCannotTellIsNoAnswer) {
  const test::TestAuthority another = test::make_test_authority();
  EXPECT_EQ(judge(list_of(current(status("granted", "2020-01-01T00:00:00Z") +
                                  identity(another.ca.certificate.get()))))
                .answer,
            Answer::kUnknown)
      << "of the same name, and another key";
  const Qualification late = judge(
      list_of(current(status("granted", "2020-01-01T00:00:00Z") + identity(ca())), "2026-07-01T00:00:00Z"));
  EXPECT_EQ(late.answer, Answer::kUnknown);
  EXPECT_THAT(late.sentence, HasSubstr("give a newer one"));
  const TrustedList list = parse_trusted_list(
      list_of(current(status("granted", "2020-01-01T00:00:00Z") + identity(ca()))), "list.xml");
  EXPECT_EQ(judge_qualification(TokenJudgement{}, {list}).answer, Answer::kUnknown);
}

TEST_F(TrustedLists, WhatIsNoListIsRefusedByNameAndReason) {
  const auto refused = [](const std::string& xml, const std::string& why) {
    EXPECT_THAT([&] { (void)parse_trusted_list(xml, "list.xml"); },
                ThrowsMessage<Error>(testing::AllOf(HasSubstr("list.xml"), HasSubstr(why))));
  };
  refused("", "no XML");
  refused("<a/>", "no trusted list");
  refused("<TrustServiceStatusList/>", "no trusted list");
  const std::string good = list_of(current(status("granted", "2020-01-01T00:00:00Z") + identity(ca())));
  const auto with = [&](const std::string& from, const std::string& to) {
    std::string changed = good;
    return changed.replace(changed.find(from), from.size(), to);
  };
  refused(with("<TSLSequenceNumber>7", "<TSLSequenceNumber>seven"), "sequence number");
  refused(with("2020-01-01T00:00:00Z", "last year"), "no time in UTC");
  refused(with("<X509Certificate>", "<X509Certificate>!"), "a certificate of Provider cannot be read");
  refused(good.substr(0, good.size() / 2), "no XML");
}

// The lists that member states published, as the tests of esig/dss (dss-tsl-validation/src/test/resources)
// have them.
TEST(TrustedListsOfMemberStates, AreRead) {
  const char* checkout = std::getenv("KIROKU_DSS");
  if (checkout == nullptr) GTEST_SKIP() << "KIROKU_DSS names no checkout of esig/dss";
  const std::filesystem::path folder =
      std::filesystem::path(checkout) / "dss-tsl-validation/src/test/resources/lotlCache";
  const std::map<std::string, std::size_t> services{{"AT", 3},  {"CZ", 104}, {"ES", 18}, {"HU", 131},
                                                    {"IT", 18}, {"SI", 12},  {"FR", 28}};
  for (const auto& [territory, expected] : services) {
    std::ifstream file(folder / (territory + ".xml"), std::ios::binary);
    const std::string xml{std::istreambuf_iterator<char>(file), {}};
    const TrustedList list = parse_trusted_list(xml, territory);
    EXPECT_EQ(list.territory, territory);
    EXPECT_EQ(
        std::ranges::count_if(list.services,
                              [](const QualifiedService& service) { return !service.certificates.empty(); }),
        static_cast<std::ptrdiff_t>(expected))
        << territory;
    EXPECT_TRUE(list.next_update);
  }
}

}  // namespace
}  // namespace kiroku::timestamp

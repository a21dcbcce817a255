#include "fleet/reports/fleet_authority.h"

#include <cctype>
#include <filesystem>
#include <set>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/error.h"
#include "fleet/reports/report_client.h"
#include "tests/support/temporary_folder.h"

namespace kiroku::fleet {
namespace {

using namespace std::chrono_literals;
using testing::HasSubstr;
using testing::ThrowsMessage;

class FleetAuthorityTest : public testing::Test {
 protected:
  test::TemporaryFolder folder_;
  const UtcTime now_ = *parse_utc("2026-11-27T09:00:00Z");
};

TEST_F(FleetAuthorityTest, IssuesACertificateForTheNameAndKeyOfTheRequest) {
  const FleetAuthority authority = FleetAuthority::open_or_make(folder_.path() / "authority", now_);
  const CertificateRequest request = make_certificate_request("or-1");
  EXPECT_EQ(appliance_of_request(request.request_pem), "or-1");
  const CertificateFacts facts = facts_of_certificate_pem(authority.issue(request.request_pem, now_, 30h));
  EXPECT_EQ(facts.appliance, "or-1");
  EXPECT_EQ(facts.not_after, now_ + 30h);
  EXPECT_FALSE(facts.is_to_be_renewed(now_));
  EXPECT_TRUE(facts.is_to_be_renewed(now_ + 29h));
}

TEST_F(FleetAuthorityTest, KeepsNothingOfARequestButTheRequest) {
  const CertificateRequest request = make_certificate_request("or-1");
  using namespace std::string_literals;
  for (const std::string& before : {"\0\n"s, "\xff\n"s, "\x1b[2J\n"s, "a line\n"s}) {
    const std::string around = before + request.request_pem + "behind it\0"s;
    EXPECT_EQ(request_alone(around), request.request_pem);
    EXPECT_EQ(request_fingerprint(around), request_fingerprint(request.request_pem));
  }
  EXPECT_THROW(request_alone("x"), UsageError);
}

TEST_F(FleetAuthorityTest, IsTheSameWhenItIsOpenedAgain) {
  const FleetAuthority made = FleetAuthority::open_or_make(folder_.path() / "authority", now_);
  EXPECT_EQ(FleetAuthority::open_or_make(folder_.path() / "authority", now_).certificate_pem(),
            made.certificate_pem());
  namespace fs = std::filesystem;
  EXPECT_EQ(fs::status(folder_.path() / "authority/authority.key").permissions(),
            fs::perms::owner_read | fs::perms::owner_write);
}

TEST_F(FleetAuthorityTest, RefusesAKeyThatOthersMayRead) {
  const std::filesystem::path place = folder_.path() / "authority";
  FleetAuthority::open_or_make(place, now_);
  std::filesystem::permissions(place / "authority.key", std::filesystem::perms::group_read,
                               std::filesystem::perm_options::add);
  EXPECT_THAT([&] { FleetAuthority::open(place); }, ThrowsMessage<UsageError>(HasSubstr("open to others")));
}

TEST_F(FleetAuthorityTest, RefusesAKeyOfAnotherAuthority) {
  FleetAuthority::open_or_make(folder_.path() / "a", now_);
  FleetAuthority::open_or_make(folder_.path() / "b", now_);
  std::filesystem::copy_file(folder_.path() / "b/authority.key", folder_.path() / "a/authority.key",
                             std::filesystem::copy_options::overwrite_existing);
  EXPECT_THAT([&] { FleetAuthority::open(folder_.path() / "a"); },
              ThrowsMessage<UsageError>(HasSubstr("is not the key of")));
}

TEST_F(FleetAuthorityTest, SaysWhereItIsHalfThere) {
  const std::filesystem::path place = folder_.path() / "authority";
  FleetAuthority::open_or_make(place, now_);
  std::filesystem::remove(place / "authority.pem");
  EXPECT_THAT([&] { FleetAuthority::open_or_make(place, now_); },
              ThrowsMessage<UsageError>(HasSubstr("is half there")));
}

TEST_F(FleetAuthorityTest, ACertificateIsOfItsAuthorityAndItsKey) {
  const FleetAuthority authority = FleetAuthority::open_or_make(folder_.path() / "a", now_);
  const FleetAuthority other = FleetAuthority::open_or_make(folder_.path() / "b", now_);
  const CertificateRequest request = make_certificate_request("or-1"),
                           same = make_certificate_request("or-1");
  const std::string pem = authority.issue(request.request_pem, now_, 30h);
  EXPECT_TRUE(is_issued_for(pem, authority.certificate_pem(), request.key_pem.text()));
  EXPECT_FALSE(is_issued_for(pem, authority.certificate_pem(), same.key_pem.text()));
  EXPECT_FALSE(is_issued_for(pem, other.certificate_pem(), request.key_pem.text()));
}

TEST_F(FleetAuthorityTest, TakesNoNameThatIsNone) {
  for (const char* name : {"", "OR 1", "or-1\n", "手術室", "../or-1", "or_1"})
    EXPECT_THROW(make_certificate_request(name), UsageError) << name;
}

TEST_F(FleetAuthorityTest, TakesNoRequestThatSomebodyChanged) {
  std::string pem = make_certificate_request("or-1").request_pem;
  const std::size_t middle = pem.size() / 2;
  // One base64 digit is another.
  pem[middle] = pem[middle] == 'A' ? 'B' : 'A';
  EXPECT_THROW(appliance_of_request(pem), UsageError);
  EXPECT_THROW(appliance_of_request(""), UsageError);
  EXPECT_THROW(appliance_of_request(std::string(1 << 20, 'A')), UsageError);
}

TEST_F(FleetAuthorityTest, TheCodeIsOfRequestAuthorityAndNonce) {
  const FleetAuthority one = FleetAuthority::open_or_make(folder_.path() / "a", now_);
  const FleetAuthority other = FleetAuthority::open_or_make(folder_.path() / "b", now_);
  const std::string mine = make_certificate_request("or-1").request_pem,
                    theirs = make_certificate_request("or-1").request_pem;
  const std::string code = enrolment_code(mine, one.certificate_pem(), "n");
  EXPECT_EQ(code, enrolment_code(mine, one.certificate_pem(), "n"));
  EXPECT_THAT(code, testing::MatchesRegex("[0-9A-Z]+-[0-9A-Z]+-[0-9A-Z]+-[0-9A-Z]+"));
  EXPECT_EQ(code.size(), 19U);
  const std::set<std::string> all{code, enrolment_code(theirs, one.certificate_pem(), "n"),
                                  enrolment_code(mine, other.certificate_pem(), "n"),
                                  enrolment_code(mine, one.certificate_pem(), "m")};
  EXPECT_EQ(all.size(), 4U);
}

TEST_F(FleetAuthorityTest, ACodeIsTakenAsPeopleTypeIt) {
  EXPECT_EQ(parse_enrolment_code("K7QM-2XFA-9DTR-PHW4"), "K7QM-2XFA-9DTR-PHW4");
  EXPECT_EQ(parse_enrolment_code(" k7qm2xfa 9dtrphw4 "), "K7QM-2XFA-9DTR-PHW4");
  EXPECT_EQ(parse_enrolment_code("OIL0-2XFA-9DTR-PHW4"), "0110-2XFA-9DTR-PHW4");
  for (const char* wrong : {"", "K7QM-2XFA-9DTR-PHW", "K7QM-2XFA-9DTR-PHW44", "U7QM-2XFA-9DTR-PHW4"})
    EXPECT_EQ(parse_enrolment_code(wrong), "") << wrong;
}

TEST_F(FleetAuthorityTest, KnowsWhichEnrolmentsAServerOfItsFleetGaveAnIdentifier) {
  const FleetAuthority one = FleetAuthority::open_or_make(folder_.path() / "one", now_),
                       same = FleetAuthority::open(folder_.path() / "one"),
                       foreign = FleetAuthority::open_or_make(folder_.path() / "foreign", now_);
  const std::string id = one.new_enrolment_id();
  EXPECT_NE(one.new_enrolment_id(), id);
  EXPECT_TRUE(one.is_enrolment_id(id));
  EXPECT_TRUE(same.is_enrolment_id(id)) << "another server's";
  EXPECT_FALSE(foreign.is_enrolment_id(id));
  for (std::size_t at = 0; at < id.size(); ++at) {
    std::string wrong = id;
    wrong[at] = wrong[at] == '0' ? '1' : '0';
    EXPECT_FALSE(one.is_enrolment_id(wrong)) << wrong;
  }
  std::string shouted = id;
  for (char& each : shouted) each = static_cast<char>(std::toupper(static_cast<unsigned char>(each)));
  for (const std::string& wrong : {std::string(), id.substr(1), id + "0", id + id, shouted,
                                   std::string(64, '0'), std::string(64, '\xff'), std::string(32, '0')})
    EXPECT_FALSE(one.is_enrolment_id(wrong)) << wrong;
}

TEST_F(FleetAuthorityTest, AnIdentityIsReadAsItWasWritten) {
  const CertificateRequest request = make_certificate_request("or-1");
  const std::filesystem::path file = folder_.path() / "reporting.json";
  EXPECT_FALSE(ReportingIdentity::read(file));
  const ReportingIdentity written{"https://fleet.example:8444", "or-1", "CERTIFICATE", "AUTHORITY",
                                  request.key_pem.clone()};
  written.write(file);
  const auto found = ReportingIdentity::read(file);
  ASSERT_TRUE(found);
  EXPECT_EQ(found->url, written.url);
  EXPECT_EQ(found->key_pem.text(), request.key_pem.text());
  std::filesystem::permissions(file, std::filesystem::perms::others_read, std::filesystem::perm_options::add);
  EXPECT_THAT([&] { ReportingIdentity::read(file); }, ThrowsMessage<UsageError>(HasSubstr("open to others")));
}

TEST_F(FleetAuthorityTest, AnAddressIsOfHttpsAndHasNoPath) {
  EXPECT_NO_THROW(ReportClient("https://127.0.0.1:8444"));
  EXPECT_NO_THROW(ReportClient("https://[::1]:8444/"));
  for (const char* wrong : {"http://fleet.example:8444", "fleet.example", "https://fleet.example/x", ""})
    EXPECT_THROW(ReportClient{wrong}, UsageError) << wrong;
}

}  // namespace
}  // namespace kiroku::fleet

// An appliance that asks its aggregator over TLS, and servers that are none, or lie.
#include "fleet/reports/shared_stamp_client.h"

#include <mutex>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "fleet/reports/fleet_authority.h"
#include "fleet/reports/stamp_messages.h"
#include "http/server.h"
#include "tests/support/temporary_folder.h"

namespace kiroku::fleet {
namespace {

using namespace std::chrono_literals;
using testing::HasSubstr;
using testing::ThrowsMessage;

const std::string kTicket(32, '7');
const Bytes kDigest(32, std::byte{1}), kNonce(32, std::byte{2});

/// Answers over TLS, with a certificate of a fleet's authority.
class PlayedServer {
 public:
  explicit PlayedServer(const FleetAuthority& authority) {
    FleetAuthority::ServerIdentity identity = authority.issue_server_identity();
    http::ServerOptions options;
    options.listen = parse_listen_address("127.0.0.1:0", 8444);
    options.answer = [this](const http::Request& request) {
      const std::lock_guard guard(mutex_);
      asked_.push_back(request.method + " " + request.target);
      caller_ = request.certificate.empty() ? "" : facts_of_certificate(request.certificate).appliance;
      return http::Response{status_, {{"Content-Type", "application/json"}}, body_};
    };
    options.refuse = [](const http::Refusal& refusal) {
      return http::Response{refusal.status, {}, refusal.why};
    };
    options.tls = http::ServerTls{std::move(identity.certificate_pem), std::move(identity.key_pem),
                                  authority.certificate_pem()};
    server_.emplace(std::move(options));
  }
  void answer(int status, std::string body) {
    const std::lock_guard guard(mutex_);
    status_ = status;
    body_ = std::move(body);
  }
  [[nodiscard]] std::string url() const { return "https://127.0.0.1:" + std::to_string(server_->port()); }
  std::vector<std::string> asked() {
    const std::lock_guard guard(mutex_);
    return asked_;
  }
  std::string caller() {
    const std::lock_guard guard(mutex_);
    return caller_;
  }

 private:
  std::mutex mutex_;  // of what follows
  int status_ = 404;
  std::string body_, caller_;
  std::vector<std::string> asked_;
  std::optional<http::Server> server_;  // last: uses the rest
};

class SharedStampClientTest : public testing::Test {
 protected:
  void enrol(const std::string& url, const FleetAuthority& authority) const {
    const CertificateRequest request = make_certificate_request("or-1");
    ReportingIdentity{url, "or-1", authority.issue(request.request_pem, utc_now(), 24h),
                      authority.certificate_pem(), request.key_pem.clone()}
        .write(identity_);
  }

  test::TemporaryFolder folder_{test::quick_parent()};
  const std::filesystem::path identity_ = folder_ / "reporting.json";
  const FleetAuthority authority_ = FleetAuthority::open_or_make(folder_ / "authority", utc_now());
  PlayedServer server_{authority_};
  SharedStampClient client_{identity_, "swiss"};
};

TEST_F(SharedStampClientTest, GivesAHashAndFetchesItsToken) {
  enrol(server_.url(), authority_);
  server_.answer(202, place_json({kTicket, 1200ms}));
  const auto place = client_.enter(kDigest, kNonce);
  EXPECT_EQ(place.ticket, kTicket);
  EXPECT_EQ(place.ready_in, 1200ms);
  EXPECT_EQ(server_.caller(), "or-1");
  EXPECT_EQ(client_.path(), "shared, by " + server_.url());
  server_.answer(202, waiting_json(10ms));
  EXPECT_FALSE(client_.fetch(place));
  const Bytes record(3000, std::byte{9});
  server_.answer(200, record_json(record));
  EXPECT_EQ(client_.fetch(place), record);
  EXPECT_THAT(server_.asked(), testing::ElementsAre("POST /stamp", "GET /stamp/swiss/" + kTicket,
                                                    "GET /stamp/swiss/" + kTicket));
}

TEST_F(SharedStampClientTest, SaysWhatTheAggregatorSays) {
  enrol(server_.url(), authority_);
  server_.answer(503, R"({"error":"swiss is left alone for another 20 s\u001b[2J"})");
  EXPECT_THAT([&] { client_.enter(kDigest, kNonce); },
              ThrowsMessage<Error>(HasSubstr("swiss is left alone for another 20 s\\u{001B}[2J")));
}

TEST_F(SharedStampClientTest, TellsWhoIsAwayFromWhoHasNoToken) {
  enrol(server_.url(), authority_);
  server_.answer(503, R"({"error":"the fleet's database does not answer"})");
  EXPECT_THROW(client_.fetch({kTicket, 0ms}), evidence::SharedStampsAway);
  for (const int status : {404, 403, 502}) {
    server_.answer(status, R"({"error":"no"})");
    try {
      client_.fetch({kTicket, 0ms});
      ADD_FAILURE() << status;
    } catch (const evidence::SharedStampsAway&) {
      ADD_FAILURE() << status << " is asked again";
    } catch (const Error&) {
      // It will not be given.
    }
  }
  enrol("https://127.0.0.1:1", authority_);
  SharedStampClient nobody(identity_, "swiss");
  EXPECT_THROW(nobody.fetch({kTicket, 0ms}), evidence::SharedStampsAway);
}

TEST_F(SharedStampClientTest, AnApplianceThatIsNotEnrolledSaysSoAndIsFoundOnceItIs) {
  EXPECT_THAT([&] { client_.enter(kDigest, kNonce); }, ThrowsMessage<Error>(HasSubstr("is not enrolled")));
  enrol(server_.url(), authority_);
  server_.answer(202, place_json({kTicket, 0ms}));
  EXPECT_EQ(client_.enter(kDigest, kNonce).ticket, kTicket);
  // Enrolled anew elsewhere, while this program runs.
  PlayedServer other(authority_);
  other.answer(202, place_json({std::string(32, '8'), 0ms}));
  enrol(other.url(), authority_);
  EXPECT_EQ(client_.enter(kDigest, kNonce).ticket, std::string(32, '8'));
}

TEST_F(SharedStampClientTest, SpeaksToNoServerOfAnotherFleet) {
  const FleetAuthority stranger = FleetAuthority::open_or_make(folder_ / "stranger", utc_now());
  PlayedServer foreign(stranger);
  enrol(foreign.url(), authority_);
  EXPECT_THAT([&] { client_.enter(kDigest, kNonce); }, ThrowsMessage<Error>(HasSubstr("is not the fleet")));
  EXPECT_THAT(foreign.asked(), testing::IsEmpty());
}

TEST_F(SharedStampClientTest, TakesNothingThatNoAggregatorAnswers) {
  enrol(server_.url(), authority_);
  for (const std::string& body : {std::string("<html>"), std::string("{}"), std::string(63'000, '[')}) {
    server_.answer(202, body);
    EXPECT_THAT([&] { client_.enter(kDigest, kNonce); }, ThrowsMessage<Error>(HasSubstr("no aggregator")));
    server_.answer(200, body);
    EXPECT_THAT([&] { client_.fetch({kTicket, 0ms}); }, ThrowsMessage<Error>(HasSubstr("no aggregator")));
  }
  server_.answer(200, std::string(70'000, 'x'));
  EXPECT_THAT([&] { client_.fetch({kTicket, 0ms}); }, ThrowsMessage<Error>(HasSubstr("more than any")));
}

}  // namespace
}  // namespace kiroku::fleet

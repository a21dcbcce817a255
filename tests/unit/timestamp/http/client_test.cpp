#include "timestamp/client.h"

#include <cstdlib>
#include <thread>

#include <boost/asio/io_context.hpp>
#include <boost/asio/ip/tcp.hpp>
#include <boost/asio/ssl/context.hpp>
#include <boost/asio/ssl/stream.hpp>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/support/scripted_server.h"
#include "tests/support/temporary_folder.h"
#include "tests/support/token_maker.h"
#include "timestamp/authority_server.h"
#include "timestamp/token_verifier.h"

namespace kiroku::timestamp {
namespace {

using test::http_answer;
using test::ScriptedServer;
using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::Not;
using ::testing::StartsWith;

constexpr const char* kReply = "application/timestamp-reply";

class HttpStampSourceTest : public ::testing::Test {
 protected:
  static Bytes query() {
    return encode_request(make_request(crypto::HashAlgorithm::kSha256, Bytes(32, std::byte{0x11})));
  }
  static Bytes ask(const std::string& url) { return http_stamp_source({.url = url})->ask(query()); }
  /// What the client says of a server that answers `answer`.
  static std::string complaint(const std::string& answer) {
    const ScriptedServer server(answer);
    return complaint_about({.url = server.url()});
  }
  static std::string complaint_about(const AuthorityPath& path) {
    try {
      const Bytes response = http_stamp_source(path)->ask(query());
      return "no complaint, but " + std::to_string(response.size()) + " bytes";
    } catch (const AuthorityError& error) {
      return error.what();
    }
  }
};

TEST_F(HttpStampSourceTest, GetsATokenFromAnAuthority) {
  const test::TemporaryFolder folder;
  Authority authority = Authority::create(folder / "authority", "Test");
  const AuthorityServer server(authority, "127.0.0.1:0");
  TrustStore trust;
  trust.add_trusted(bytes_of(authority.root_pem()), "ca.pem");
  const auto source = http_stamp_source({.url = server.url()});
  for (int i = 0; i < 3; ++i) {
    const Request request = make_request(crypto::HashAlgorithm::kSha256, Bytes(32, std::byte(i)));
    Expectation expectation;
    expectation.imprint = request.imprint;
    expectation.nonce = request.nonce;
    const auto judgement = judge_token(source->ask(encode_request(request)), expectation, trust);
    EXPECT_EQ(judgement.code, TokenCode::kValid) << judgement.explanation;
  }
}

TEST_F(HttpStampSourceTest, GetsATokenFromTheEmbeddedAuthorityInTheSameWay) {
  const test::TemporaryFolder folder;
  Authority authority = Authority::create(folder / "authority", "Test");
  TrustStore trust;
  trust.add_trusted(bytes_of(authority.root_pem()), "ca.pem");
  const auto source = embedded_stamp_source(authority);
  EXPECT_EQ(judge_token(source->ask(query()), {}, trust).code, TokenCode::kValid);
}

TEST_F(HttpStampSourceTest, AsksAsRfc3161Says) {
  const ScriptedServer server(http_answer("200 OK", kReply, "answer"));
  EXPECT_EQ(text_of(ask(server.url())), "answer");
  EXPECT_THAT(server.last_request(), StartsWith("POST / HTTP/1.1\r\n"));
  EXPECT_THAT(server.last_request(), HasSubstr("Content-Type: application/timestamp-query\r\n"));
  EXPECT_THAT(server.last_request(), HasSubstr("Content-Length: " + std::to_string(query().size()) + "\r\n"));
}

TEST_F(HttpStampSourceTest, AcceptsParametersAndCaseOfTheContentType) {
  const ScriptedServer server(
      http_answer("200 OK", "Application/Timestamp-Reply ; charset=binary", "answer"));
  EXPECT_EQ(text_of(ask(server.url())), "answer");
}

TEST_F(HttpStampSourceTest, SuspectsACaptivePortalBehindHtml) {
  const ScriptedServer server(
      http_answer("200 OK", "text/html; charset=utf-8", "<html>Please log in</html>"));
  EXPECT_EQ(complaint_about({.url = server.url()}),
            "the authority " + server.url() +
                " answered text/html, not a time-stamp response: is there a captive portal or proxy login?");
}

TEST_F(HttpStampSourceTest, TellsOtherContent) {
  EXPECT_THAT(complaint(http_answer("200 OK", "application/octet-stream", "x")),
              HasSubstr("answered application/octet-stream, not a time-stamp response"));
  EXPECT_THAT(complaint("HTTP/1.1 200 OK\r\nContent-Length: 1\r\n\r\nx"),
              HasSubstr("answered without a content type, not a time-stamp response"));
  EXPECT_THAT(complaint(http_answer("200 OK", kReply, "")), HasSubstr("answered with nothing"));
}

TEST_F(HttpStampSourceTest, TellsTheHttpStatus) {
  EXPECT_THAT(complaint(http_answer("503 Service Unavailable", "text/html", "later")),
              HasSubstr("answered with HTTP status 503"));
  EXPECT_THAT(complaint(http_answer("429 Too Many Requests", kReply, "x")),
              HasSubstr("answered with HTTP status 429"));
}

TEST_F(HttpStampSourceTest, TellsHowLongAnAuthorityWantsToBeLeftAlone) {
  const auto pause = [](const std::string& status, const std::string& header) {
    const ScriptedServer server("HTTP/1.1 " + status + "\r\n" + header +
                                "Content-Length: 0\r\nConnection: close\r\n\r\n");
    try {
      ask(server.url());
    } catch (const AuthorityError& error) {
      return error.leave_alone_for();
    }
    return std::optional<std::chrono::seconds>(-1);
  };
  EXPECT_EQ(pause("429 Too Many Requests", "Retry-After: 1200\r\n"), std::chrono::seconds(1200));
  EXPECT_EQ(pause("503 Service Unavailable", "Retry-After: 90\r\n"), std::chrono::seconds(90));
  EXPECT_EQ(pause("429 Too Many Requests", ""), std::chrono::seconds(60));
  EXPECT_EQ(pause("429 Too Many Requests", "Retry-After: 99999999\r\n"), std::chrono::hours(24));
  // As a date, far away and gone by.
  EXPECT_EQ(pause("429 Too Many Requests", "Retry-After: Fri, 31 Dec 2399 23:59:59 GMT\r\n"),
            std::chrono::hours(24));
  EXPECT_EQ(pause("429 Too Many Requests", "Retry-After: Fri, 31 Dec 1999 23:59:59 GMT\r\n"),
            std::chrono::seconds(60));
  EXPECT_EQ(pause("503 Service Unavailable", ""), std::nullopt);
  EXPECT_EQ(pause("500 Internal Server Error", "Retry-After: 90\r\n"), std::nullopt);
}

TEST_F(HttpStampSourceTest, TellsWhenNobodyListens) {
  std::string url;
  {
    const ScriptedServer server("x");
    url = server.url();
  }
  EXPECT_THAT(complaint_about({.url = url}), StartsWith("the authority " + url + " is unreachable: "));
}

TEST_F(HttpStampSourceTest, GivesUpInTime) {
  const ScriptedServer server("");
  EXPECT_EQ(complaint_about({.url = server.url(), .total_timeout = std::chrono::milliseconds(250)}),
            "the authority " + server.url() + " did not answer in time (5 s to connect, 0.250 s in all)");
}

TEST_F(HttpStampSourceTest, StopsAtOneMebibyte) {
  EXPECT_EQ(complaint(http_answer("200 OK", kReply, std::string(1 << 20, 'x'))),
            "no complaint, but 1048576 bytes");
  EXPECT_THAT(complaint(http_answer("200 OK", kReply, std::string((1 << 20) + 1, 'x'))),
              HasSubstr("answered with more than 1 MiB"));
}

TEST_F(HttpStampSourceTest, TellsBrokenHttp) {
  EXPECT_THAT(complaint("\x15\x03\x01 this is not HTTP"), HasSubstr("could not be asked"));
  EXPECT_THAT(complaint("HTTP/1.1 200 OK\r\nContent-Type: application/timestamp-reply\r\n"
                        "Content-Length: 10\r\n\r\nhalf"),
              HasSubstr("could not be asked"));
}

TEST_F(HttpStampSourceTest, FollowsARedirectThatKeepsTheScheme) {
  const ScriptedServer target(http_answer("200 OK", kReply, "answer"));
  const ScriptedServer first("HTTP/1.1 302 Found\r\nLocation: " + target.url() +
                             "elsewhere\r\nContent-Length: 0\r\n\r\n");
  EXPECT_EQ(text_of(ask(first.url())), "answer");
  EXPECT_THAT(target.last_request(), StartsWith("POST /elsewhere HTTP/1.1\r\n"));
}

TEST_F(HttpStampSourceTest, FollowsNoRedirectToAnotherSchemeNorEndlessOnes) {
  for (const char* target : {"https://127.0.0.1/", "file:///etc/passwd", "ftp://127.0.0.1/", "/"}) {
    EXPECT_THAT(
        complaint(std::string("HTTP/1.1 302 Found\r\nLocation: ") + target + "\r\nContent-Length: 0\r\n\r\n"),
        HasSubstr("redirects where it may not"))
        << target;
  }
}

TEST_F(HttpStampSourceTest, RefusesAddressesThatAreNotHttp) {
  for (const char* url : {"", "freetsa.org", "ftp://freetsa.org/", "file:///etc/passwd", "://"}) {
    EXPECT_THROW(http_stamp_source({.url = url}), UsageError) << url;
  }
}

TEST_F(HttpStampSourceTest, NeverShowsThePasswordOfAnAddress) {
  const ScriptedServer server(http_answer("401 Unauthorized", "text/plain", "no"));
  EXPECT_EQ(complaint_about({.url = "http://user:secret@127.0.0.1:" + std::to_string(server.port()) + "/"}),
            "the authority " + server.url() + " answered with HTTP status 401");
  EXPECT_THAT(complaint_about({.url = server.url() + "/tsr?apikey=secret"}),
              AllOf(HasSubstr("tsr?***"), Not(HasSubstr("secret"))));
}

TEST_F(HttpStampSourceTest, UsesAProxyOnlyWhenTold) {
  const ScriptedServer proxy(http_answer("200 OK", kReply, "through the proxy"));
  const ScriptedServer direct(http_answer("200 OK", kReply, "directly"));
  ASSERT_EQ(setenv("http_proxy", proxy.url().c_str(), 1), 0);
  ASSERT_EQ(setenv("no_proxy", "127.0.0.1", 1), 0);
  EXPECT_EQ(text_of(ask(direct.url())), "directly");
  EXPECT_EQ(text_of(http_stamp_source({.url = direct.url(), .proxy = proxy.url()})->ask(query())),
            "through the proxy");
  unsetenv("http_proxy");
  unsetenv("no_proxy");
}

TEST_F(HttpStampSourceTest, TrustsNoTlsCertificateThatTheSystemDoesNot) {
  namespace asio = boost::asio;
  const test::TestAuthority stranger = test::make_test_authority("serverAuth");
  asio::io_context context;
  asio::ssl::context tls(asio::ssl::context::tls_server);
  ASSERT_EQ(SSL_CTX_use_certificate(tls.native_handle(), stranger.signer.certificate.get()), 1);
  ASSERT_EQ(SSL_CTX_use_PrivateKey(tls.native_handle(), stranger.signer.key.get()), 1);
  asio::ip::tcp::acceptor acceptor(context, {asio::ip::make_address("127.0.0.1"), 0});
  std::thread server([&] {
    asio::ssl::stream<asio::ip::tcp::socket> stream(acceptor.accept(), tls);
    boost::system::error_code refused;
    stream.handshake(asio::ssl::stream_base::server, refused);
  });
  const std::string url = "https://127.0.0.1:" + std::to_string(acceptor.local_endpoint().port()) + "/";
  EXPECT_THAT(complaint_about({.url = url}),
              StartsWith("the authority " + url + " could not be asked: SSL certificate problem: "));
  server.join();
}

TEST_F(HttpStampSourceTest, BindsToTheInterfaceItIsTold) {
  const ScriptedServer server(http_answer("200 OK", kReply, "answer"));
  EXPECT_EQ(text_of(http_stamp_source({.url = server.url(), .network_interface = "127.0.0.1"})->ask(query())),
            "answer");
  EXPECT_THAT(complaint_about({.url = server.url(), .network_interface = "nosuch0"}),
              HasSubstr("cannot be asked through the network interface 'nosuch0'"));
}

TEST(AuthorityPath, IsNamedForPeopleWithoutPasswords) {
  EXPECT_EQ(path_name({}), "directly");
  EXPECT_EQ(path_name({.proxy = "http://user:secret@proxy:3128"}), "through the proxy http://proxy:3128");
  EXPECT_EQ(path_name({.proxy = "user:secret@proxy:3128"}), "through the proxy proxy:3128");
  EXPECT_EQ(path_name({.network_interface = "wwan0"}), "over wwan0");
  EXPECT_EQ(path_name({.proxy = "proxy:3128", .network_interface = "wwan0"}),
            "over wwan0 through the proxy proxy:3128");
}

class SeveralPathsTest : public HttpStampSourceTest {
 protected:
  /// TimeStampResp that says no: an authority was reached. Proxies answer it by themselves, so that the ways
  /// can be told apart.
  static std::string rejection() { return http_answer("200 OK", kReply, "\x30\x05\x30\x03\x02\x01\x02"); }
  [[nodiscard]] std::vector<AuthorityPath> paths(const std::vector<const ScriptedServer*>& proxies) const {
    std::vector<AuthorityPath> paths;
    for (const ScriptedServer* proxy : proxies) paths.push_back({.url = url_, .proxy = proxy->url()});
    return paths;
  }
  static std::string refusal(StampSource& source) {
    try {
      source.ask(query());
    } catch (const AuthorityError& error) {
      return error.what();
    }
    return "none";
  }
  const std::string url_ = "http://authority.invalid/";
};

TEST_F(SeveralPathsTest, PassesOverWaysThatLeadNowhere) {
  const ScriptedServer portal(http_answer("200 OK", "text/html", "<html>log in</html>"));
  const ScriptedServer broken(http_answer("502 Bad Gateway", "text/plain", "no"));
  const ScriptedServer liar(http_answer("200 OK", kReply, "<html>log in</html>"));
  const ScriptedServer modem(rejection());
  const auto source = http_stamp_source(paths({&portal, &broken, &liar, &modem}));
  EXPECT_EQ(source->path(), "");
  source->ask(query());
  EXPECT_EQ(source->path(), "through the proxy " + modem.url());
}

TEST_F(SeveralPathsTest, BeginsWithTheWayThatWorkedLastThenTheOthersInOrder) {
  ScriptedServer first(http_answer("502 Bad Gateway", "text/plain", "no"));
  ScriptedServer second(rejection());
  const auto source = http_stamp_source(paths({&first, &second}));
  source->ask(query());
  source->ask(query());
  EXPECT_EQ(first.requests(), 1U);
  EXPECT_EQ(second.requests(), 2U);
  first.answer_with(rejection());
  second.answer_with(http_answer("502 Bad Gateway", "text/plain", "no"));
  source->ask(query());
  EXPECT_EQ(source->path(), "through the proxy " + first.url());
}

TEST_F(SeveralPathsTest, TellsWhatWasTheMatterWithEach) {
  const ScriptedServer portal(http_answer("200 OK", "text/html", "<html>log in</html>"));
  const ScriptedServer broken(http_answer("502 Bad Gateway", "text/plain", "no"));
  const auto source = http_stamp_source(paths({&portal, &broken}));
  EXPECT_EQ(refusal(*source),
            "through the proxy " + portal.url() + ": the authority " + url_ +
                " answered text/html, not a time-stamp response: is there a captive portal or "
                "proxy login?; through the proxy " +
                broken.url() + ": the authority " + url_ + " answered with HTTP status 502");
  EXPECT_EQ(refusal(*http_stamp_source(paths({&broken}))),
            "the authority " + url_ + " answered with HTTP status 502");
}

TEST_F(SeveralPathsTest, DoesNotGoRoundALimit) {
  const ScriptedServer limited(
      "HTTP/1.1 429 Too Many Requests\r\nRetry-After: 1200\r\nContent-Length: 0\r\n\r\n");
  const ScriptedServer modem(rejection());
  const auto source = http_stamp_source(paths({&limited, &modem}));
  EXPECT_THAT(refusal(*source), HasSubstr("429"));
  EXPECT_EQ(modem.requests(), 0U);
  EXPECT_THROW(http_stamp_source(std::vector<AuthorityPath>{}), UsageError);
}

}  // namespace
}  // namespace kiroku::timestamp

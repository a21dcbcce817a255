#include "timestamp/authority_server.h"

#include <array>
#include <optional>
#include <thread>
#include <vector>

#include <boost/asio/io_context.hpp>
#include <boost/asio/ip/tcp.hpp>
#include <boost/asio/read.hpp>
#include <boost/asio/write.hpp>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/error.h"
#include "tests/support/temporary_folder.h"
#include "timestamp/client.h"
#include "timestamp/token_verifier.h"

namespace kiroku::timestamp {
namespace {

namespace asio = boost::asio;
using ::testing::HasSubstr;
using ::testing::StartsWith;

class AuthorityServerTest : public ::testing::Test {
 protected:
  /// Everything that the server sends to a client who sends `request` and then nothing more.
  std::string exchange(const std::string& request) const {
    asio::io_context context;
    asio::ip::tcp::socket socket(context);
    socket.connect({asio::ip::make_address("127.0.0.1"), server_.port()});
    boost::system::error_code error;
    asio::write(socket, asio::buffer(request), error);
    socket.shutdown(asio::ip::tcp::socket::shutdown_send, error);
    std::string answer;
    asio::read(socket, asio::dynamic_buffer(answer), error);
    return answer;
  }
  static Bytes query() {
    return encode_request(make_request(crypto::HashAlgorithm::kSha256, Bytes(32, std::byte{0x11})));
  }

  test::TemporaryFolder folder_;
  Authority authority_ = Authority::create(folder_ / "authority", "Test");
  AuthorityServer server_{authority_, "127.0.0.1:0"};
};

TEST_F(AuthorityServerTest, AnswersABrowserWithHelp) {
  const std::string answer = exchange("GET / HTTP/1.1\r\nHost: x\r\n\r\n");
  EXPECT_THAT(answer, StartsWith("HTTP/1.1 405 Method Not Allowed\r\n"));
  EXPECT_THAT(answer, HasSubstr("Allow: POST\r\n"));
  EXPECT_THAT(answer, HasSubstr("openssl ts -query"));
}

TEST_F(AuthorityServerTest, RefusesOtherContentTypes) {
  EXPECT_THAT(
      exchange("POST / HTTP/1.1\r\nHost: x\r\nContent-Type: text/plain\r\nContent-Length: 1\r\n\r\nx"),
      StartsWith("HTTP/1.1 415 Unsupported Media Type\r\n"));
  EXPECT_THAT(exchange("POST / HTTP/1.1\r\nHost: x\r\nContent-Length: 1\r\n\r\nx"),
              StartsWith("HTTP/1.1 415 Unsupported Media Type\r\n"));
}

TEST_F(AuthorityServerTest, RejectsGarbageAsATimeStampResponse) {
  const std::string answer = exchange(
      "POST / HTTP/1.1\r\nHost: x\r\nContent-Type: application/timestamp-query\r\nContent-Length: "
      "7\r\n\r\ngarbage");
  EXPECT_THAT(answer, StartsWith("HTTP/1.1 200 OK\r\n"));
  EXPECT_THAT(answer, HasSubstr("Content-Type: application/timestamp-reply\r\n"));
  std::string why;
  const auto response = parse_response(bytes_of(answer.substr(answer.find("\r\n\r\n") + 4)), why);
  ASSERT_TRUE(response) << why;
  EXPECT_EQ(response->status, 2);
  EXPECT_EQ(response->failure_info, 5);
}

TEST_F(AuthorityServerTest, RefusesWhatIsTooLargeBeforeReadingIt) {
  EXPECT_THAT(exchange("POST / HTTP/1.1\r\nHost: x\r\nContent-Type: application/timestamp-query\r\n"
                       "Content-Length: 1000000000\r\n\r\n"),
              StartsWith("HTTP/1.1 413 Payload Too Large\r\n"));
}

TEST_F(AuthorityServerTest, SurvivesWhatIsNotHttp) {
  EXPECT_THAT(exchange("\x16\x03\x01\x02 hello\r\n\r\n"), StartsWith("HTTP/1.1 400 Bad Request\r\n"));
  EXPECT_THAT(exchange("POST / HTTP/1.1\r\n" + std::string(10'000, 'x') + ": y\r\n\r\n"),
              StartsWith("HTTP/1.1 400 Bad Request\r\n"));
  EXPECT_EQ(exchange(""), "");
  EXPECT_EQ(exchange("POST / HTTP/1.1\r\nHost: x\r\nContent-Length: 10\r\n\r\nhalf"), "");
  // And goes on answering.
  TrustStore trust;
  trust.add_trusted(bytes_of(authority_.root_pem()), "ca.pem");
  EXPECT_EQ(judge_token(http_stamp_source({.url = server_.url()})->ask(query()), {}, trust).code,
            TokenCode::kValid);
}

TEST_F(AuthorityServerTest, RefusesARequestThatCouldHideAnotherAndReadsNoFurther) {
  const std::string hidden = "GET / HTTP/1.1\r\nHost: x\r\n\r\n";
  const std::string length = "Content-Length: " + std::to_string(hidden.size()) + "\r\n";
  for (const std::string& fields : {std::string("Host: x\r\nTransfer-Encoding: gzip\r\n"),
                                    std::string("Host: x\r\nTransfer-Encoding: chunked, identity\r\n"),
                                    "Host: x\r\nTransfer-Encoding: chunked\r\n" + length,
                                    "Host: x\r\n" + length + length, std::string("Host: x\r\nHost: y\r\n"),
                                    std::string("Host: x\r\nX-Note: one\r\n two\r\n"), std::string()}) {
    const std::string answer = exchange("POST / HTTP/1.1\r\nContent-Type: application/timestamp-query\r\n" +
                                        fields + "\r\n" + hidden);
    EXPECT_THAT(answer, StartsWith("HTTP/1.1 400 Bad Request\r\n")) << fields;
    EXPECT_THAT(answer, HasSubstr("Connection: close\r\n")) << fields;
    EXPECT_EQ(answer.find("HTTP/1.1", 1), std::string::npos) << "nothing more is answered: " << fields;
  }
}

TEST_F(AuthorityServerTest, RefusesAChunkWithExtensionsAndReadsNoFurther) {
  const std::string answer = exchange(
      "POST / HTTP/1.1\r\nContent-Type: application/timestamp-query\r\nHost: x\r\n"
      "Transfer-Encoding: chunked\r\n\r\n2;a=\"\n\"\r\n[]\r\n0\r\n\r\nGET / HTTP/1.1\r\nHost: x\r\n\r\n");
  EXPECT_THAT(answer, StartsWith("HTTP/1.1 400 Bad Request\r\n"));
  EXPECT_EQ(answer.find("HTTP/1.1", 1), std::string::npos) << "nothing more is answered";
}

TEST_F(AuthorityServerTest, AnswersSeveralClientsAtOnce) {
  TrustStore trust;
  trust.add_trusted(bytes_of(authority_.root_pem()), "ca.pem");
  std::vector<int> valid(4);
  std::vector<std::thread> clients;
  clients.reserve(valid.size());
  for (int& count : valid) {
    clients.emplace_back([&] {
      const auto source = http_stamp_source({.url = server_.url()});
      for (int i = 0; i < 10; ++i) {
        if (judge_token(source->ask(query()), {}, trust).code == TokenCode::kValid) ++count;
      }
    });
  }
  for (auto& client : clients) client.join();
  EXPECT_EQ(valid, std::vector<int>(4, 10));
}

TEST_F(AuthorityServerTest, IsNotShutByClientsThatSayNothing) {
  asio::io_context context;
  std::vector<asio::ip::tcp::socket> idle;
  for (int i = 0; i < 200; ++i) {
    asio::ip::tcp::socket& socket = idle.emplace_back(context, asio::ip::tcp::v4());
    socket.bind({asio::ip::make_address("127.0.3." + std::to_string(1 + i % 20)), 0});
    socket.connect({asio::ip::make_address("127.0.0.1"), server_.port()});
  }
  EXPECT_THAT(exchange("GET / HTTP/1.1\r\nHost: x\r\n\r\n"), StartsWith("HTTP/1.1 405 "));
  // Accepted in order, so the first ones made room.
  std::array<char, 1> byte{};
  boost::system::error_code error;
  idle.front().read_some(asio::buffer(byte), error);
  EXPECT_TRUE(error);
}

TEST_F(AuthorityServerTest, LetsClientsGoThatNeverFinish) {
  const AuthorityServer hasty(authority_, "127.0.0.1:0", std::chrono::milliseconds(50));
  asio::io_context context;
  asio::ip::tcp::socket socket(context);
  socket.connect({asio::ip::make_address("127.0.0.1"), hasty.port()});
  asio::write(socket, asio::buffer(std::string("POST / HTTP/1.1\r\nHost: x\r\n")));
  std::string answer;
  boost::system::error_code error;
  asio::read(socket, asio::dynamic_buffer(answer), error);
  EXPECT_EQ(answer, "");
  EXPECT_EQ(error, asio::error::eof);
}

TEST_F(AuthorityServerTest, SaysWhereItCannotListen) {
  EXPECT_EQ(server_.url(), "http://127.0.0.1:" + std::to_string(server_.port()) + "/");
  EXPECT_THROW(AuthorityServer(authority_, "127.0.0.1:" + std::to_string(server_.port())), Error);
  for (const char* listen :
       {"", "127.0.0.1", "localhost:1", "127.0.0.1:", "127.0.0.1:65536", "127.0.0.1:1x"}) {
    EXPECT_THROW(AuthorityServer(authority_, listen), UsageError) << listen;
  }
}

}  // namespace
}  // namespace kiroku::timestamp

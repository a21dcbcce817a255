#include "http/server.h"

#include <atomic>
#include <fcntl.h>
#include <fstream>
#include <thread>
#include <utility>
#include <vector>

#include <boost/asio/io_context.hpp>
#include <boost/asio/ip/tcp.hpp>
#include <boost/asio/read.hpp>
#include <boost/asio/write.hpp>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/error.h"
#include "tests/support/temporary_folder.h"

namespace kiroku::http {
namespace {

namespace asio = boost::asio;
using testing::EndsWith;
using testing::HasSubstr;
using testing::Not;
using testing::StartsWith;

class HttpServer : public testing::Test {
 protected:
  ServerOptions options() {
    ServerOptions options;
    options.listen = {"127.0.0.1", 0};
    options.answer = [this](const Request& request) { return answer(request); };
    options.refuse = [](const Refusal& refusal) {
      return Response{refusal.status, {{"Content-Type", "text/plain"}}, refusal.why};
    };
    options.most_body_bytes = 1000;
    return options;
  }

  /// Everything that comes after `request` was sent and nothing more.
  std::string exchange(const std::string& request) {
    if (!server) server.emplace(options());
    asio::io_context context;
    asio::ip::tcp::socket socket(context);
    socket.connect({asio::ip::make_address("127.0.0.1"), server->port()});
    boost::system::error_code error;
    asio::write(socket, asio::buffer(request), error);
    socket.shutdown(asio::ip::tcp::socket::shutdown_send, error);
    std::string received;
    asio::read(socket, asio::dynamic_buffer(received), error);
    return received;
  }
  std::string get(const std::string& method = "GET") {
    return exchange(method + " /x HTTP/1.1\r\nHost: x\r\nConnection: close\r\n\r\n");
  }
  static std::string body_of(const std::string& answer) { return answer.substr(answer.find("\r\n\r\n") + 4); }

  test::TemporaryFolder folder;
  std::function<Response(const Request&)> answer = [](const Request&) {
    return Response{200, {{"Content-Type", "text/plain"}}, "hello"};
  };
  std::optional<Server> server;
};

TEST_F(HttpServer, HandsOverARequestAsItCame) {
  Request seen;
  answer = [&seen](const Request& request) {
    seen = request;
    return Response{204, {}, {}};
  };
  const std::string received = exchange(
      "PUT /a?b=c HTTP/1.1\r\nHost: x\r\nX-One: 1\r\nx-two: 2\r\nTransfer-Encoding: chunked\r\n\r\n"
      "3\r\none\r\n3\r\ntwo\r\n0\r\n\r\n");
  server.reset();
  EXPECT_EQ(seen.method, "PUT");
  EXPECT_EQ(seen.target, "/a?b=c");
  EXPECT_EQ(seen.field("x-one"), "1");
  EXPECT_EQ(seen.field("X-Two"), "2");
  EXPECT_EQ(seen.field("X-Three"), "");
  EXPECT_EQ(seen.body, "onetwo");
  EXPECT_EQ(seen.holder, "127.0.0.1");
  EXPECT_THAT(received, StartsWith("HTTP/1.1 204 No Content\r\n"));
  EXPECT_THAT(received, Not(HasSubstr("Content-Length")));
  EXPECT_THAT(received, EndsWith("\r\n\r\n"));
}

TEST_F(HttpServer, AnswersRequestAfterRequestOnOneConnection) {
  std::atomic<int> count = 0;
  answer = [&count](const Request&) { return Response{200, {}, std::to_string(++count)}; };
  const std::string one = "GET /x HTTP/1.1\r\nHost: x\r\n\r\n";
  const std::string received = exchange(one + one + "GET /x HTTP/1.0\r\n\r\n" + one);
  EXPECT_EQ(count, 3) << "HTTP/1.0 says by itself that it is the last";
  EXPECT_THAT(received, HasSubstr("Connection: keep-alive\r\n"));
  EXPECT_THAT(received, EndsWith("Content-Length: 1\r\nConnection: close\r\n\r\n3"));
}

TEST_F(HttpServer, SendsPartsOfFilesAndOfBytesWithTheirSize) {
  std::string content(700'000, 'a');
  content[100'000] = 'b';
  content[699'999] = 'c';
  std::ofstream(folder / "file", std::ios::binary) << content;
  const auto file = std::make_shared<const Descriptor>(::open((folder / "file").c_str(), O_RDONLY));
  answer = [&](const Request&) { return Response{206, {}, FileBody{file, 100'000, 600'000}}; };
  const std::string of_file = get();
  EXPECT_THAT(of_file, HasSubstr("Content-Length: 600000\r\n"));
  EXPECT_EQ(body_of(of_file), content.substr(100'000));
  server.reset();

  const auto bytes = std::make_shared<const Bytes>(to_bytes(content));
  answer = [&](const Request&) { return Response{200, {}, BytesBody{bytes, 100'000, 300'000}}; };
  EXPECT_EQ(body_of(get()), content.substr(100'000, 300'000));
  server.reset();

  answer = [](const Request&) {
    const auto read = [](std::uint64_t offset, std::span<std::byte> into) {
      for (std::size_t i = 0; i < into.size(); ++i) into[i] = static_cast<std::byte>('0' + (offset + i) % 10);
    };
    return Response{200, {}, ReadBody{read, 3, 5}};
  };
  EXPECT_EQ(body_of(get()), "34567");
}

TEST_F(HttpServer, SendsWhatItComputesInChunks) {
  answer = [](const Request&) {
    return Response{200, {}, StreamBody([left = 3](Bytes& into) mutable {
                      if (left-- == 0) return false;
                      into = to_bytes("piece");
                      return true;
                    })};
  };
  const std::string received = get();
  EXPECT_THAT(received, HasSubstr("Transfer-Encoding: chunked\r\n"));
  EXPECT_EQ(body_of(received), "5\r\npiece\r\n5\r\npiece\r\n5\r\npiece\r\n0\r\n\r\n");
  EXPECT_EQ(body_of(get("HEAD")), "");
  server.reset();
  answer = [](const Request&) { return Response{200, {}, StreamBody([](Bytes&) { return false; })}; };
  EXPECT_EQ(body_of(get()), "0\r\n\r\n");
}

TEST_F(HttpServer, CutsTheConnectionWhereABodyFailsSoThatItsEndIsMissed) {
  answer = [](const Request& request) {
    if (request.method == "HEAD") return Response{200, {{"X-Is", "well"}}, {}};
    return Response{200, {}, StreamBody([is_first = true](Bytes& into) mutable {
                      if (!std::exchange(is_first, false)) throw Error("the disk is gone");
                      into = to_bytes("piece");
                      return true;
                    })};
  };
  EXPECT_EQ(body_of(get()), "5\r\npiece\r\n");
  EXPECT_THAT(get("HEAD"), HasSubstr("X-Is: well")) << "the others are answered";
}

TEST_F(HttpServer, AnEmptyBodyAndAHeadHaveASizeAndNoBytes) {
  EXPECT_THAT(get("HEAD"), HasSubstr("Content-Length: 5\r\n"));
  EXPECT_EQ(body_of(get("HEAD")), "");
  server.reset();
  answer = [](const Request&) { return Response{200, {}, ""}; };
  EXPECT_THAT(get(), HasSubstr("Content-Length: 0\r\n"));
}

TEST_F(HttpServer, SaysThatItFailedAndSplitsNoHeader) {
  answer = [](const Request&) -> Response { throw Error("nothing is ready"); };
  EXPECT_THAT(get(), StartsWith("HTTP/1.1 500 "));
  EXPECT_EQ(body_of(get()), "nothing is ready");
  server.reset();
  answer = [](const Request&) { return Response{200, {{"X-Name", "a\r\nSet-Cookie: b"}}, "hello"}; };
  EXPECT_EQ(get(), "") << "a second header would have gone out";
}

TEST_F(HttpServer, RefusesWhatIsTooMuchOrHidesARequest) {
  EXPECT_THAT(exchange("GET / HTTP/1.1\r\nHost: x\r\nX: " + std::string(9'000, 'x') + "\r\n\r\n"),
              StartsWith("HTTP/1.1 431 "));
  EXPECT_THAT(exchange("GET / HTTP/1.1\r\nHost: x\r\nContent-Length: 1001\r\n\r\n"),
              StartsWith("HTTP/1.1 413 "));
  for (const std::string& fields :
       {std::string("Transfer-Encoding: gzip\r\n"), std::string("Host: y\r\n"),
        std::string("X-A: b\r\n c\r\n"), std::string("Content-Length: 1\r\nContent-Length: 1\r\n")}) {
    const std::string received =
        exchange("POST / HTTP/1.1\r\nHost: x\r\n" + fields + "\r\nGET / HTTP/1.1\r\nHost: x\r\n\r\n");
    EXPECT_THAT(received, StartsWith("HTTP/1.1 400 Bad Request\r\n")) << fields;
    EXPECT_THAT(received, HasSubstr("Connection: close\r\n")) << fields;
    EXPECT_EQ(received.find("HTTP/1.1", 1), std::string::npos) << fields;
  }
}

TEST_F(HttpServer, EndsWhileClientsWaitAndWaitsForWhatItAnswers) {
  std::atomic<bool> is_asked = false, may_end = false, has_ended = false;
  answer = [&](const Request&) {
    is_asked = true;
    is_asked.notify_all();
    may_end.wait(false);
    has_ended = true;
    return Response{200, {}, "late"};
  };
  server.emplace(options());
  asio::io_context context;
  asio::ip::tcp::socket silent(context), asking(context);
  silent.connect({asio::ip::make_address("127.0.0.1"), server->port()});
  asking.connect({asio::ip::make_address("127.0.0.1"), server->port()});
  asio::write(asking, asio::buffer(std::string("GET / HTTP/1.1\r\nHost: x\r\n\r\n")));
  is_asked.wait(false);
  std::thread ending([this] { server.reset(); });
  may_end = true;
  may_end.notify_all();
  ending.join();
  EXPECT_TRUE(has_ended);
  std::string received;
  boost::system::error_code error;
  asio::read(silent, asio::dynamic_buffer(received), error);
  EXPECT_TRUE(error);
  EXPECT_EQ(received, "");
}

TEST_F(HttpServer, SaysWhereItCannotListen) {
  server.emplace(options());
  ServerOptions same = options();
  same.listen.port = server->port();
  try {
    const Server second(std::move(same));
    FAIL() << "two listen at one address";
  } catch (const Error& error) {
    EXPECT_THAT(error.what(), StartsWith("cannot listen on 127.0.0.1:" + std::to_string(server->port())));
  }
}

}  // namespace
}  // namespace kiroku::http

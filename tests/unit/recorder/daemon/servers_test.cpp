#include <array>
#include <atomic>
#include <fstream>
#include <future>
#include <thread>
#include <utility>  // Boost 1.74 forgets it before its awaitable

#include <boost/asio.hpp>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "base/error.h"
#include "recorder/control/control_client.h"
#include "recorder/daemon/control_server.h"
#include "recorder/daemon/http_server.h"
#include "tests/support/temporary_folder.h"

namespace kiroku::recorder {
namespace {

namespace asio = boost::asio;
using nlohmann::json;
using nlohmann::ordered_json;
using testing::HasSubstr;
using testing::StartsWith;

class ControlServerTest : public testing::Test {
 protected:
  static ordered_json echo(const json& request) {
    if (request.contains("fail")) throw UsageError("not today");
    return {{"echo", request}};
  }
  /// What comes back for raw bytes until the server closes or answers one line.
  [[nodiscard]] std::string send(const std::string& bytes) const {
    asio::io_context context;
    asio::local::stream_protocol::socket peer(context);
    peer.connect(asio::local::stream_protocol::endpoint(socket.string()));
    std::string received;
    boost::system::error_code failed;
    asio::write(peer, asio::buffer(bytes), failed);
    asio::read_until(peer, asio::dynamic_buffer(received), '\n', failed);
    return received;
  }
  test::TemporaryFolder folder;
  std::filesystem::path socket = folder / "s";
};

TEST_F(ControlServerTest, AnswersARequestAndTellsWhyNot) {
  const ControlServer server(socket, echo);
  EXPECT_EQ(ask_recorder(socket, {{"do", "x"}})["echo"], json({{"do", "x"}}));
  try {
    ask_recorder(socket, {{"fail", 1}});
    FAIL() << "accepted";
  } catch (const Error& error) {
    EXPECT_STREQ(error.what(), "not today");
  }
}

TEST_F(ControlServerTest, RefusesWhatIsNoObjectAndGoesOn) {
  const ControlServer server(socket, echo);
  EXPECT_THAT(send("nonsense\n"), HasSubstr("one JSON object"));
  EXPECT_THAT(send("[1]\n"), HasSubstr("one JSON object"));
  EXPECT_EQ(send(std::string(2U << 20, 'x')), "") << "a line without end is cut off";
  EXPECT_EQ(ask_recorder(socket, {{"do", "x"}})["ok"], true);
}

TEST_F(ControlServerTest, ASlowAnswerDelaysNobodyElse) {
  std::promise<void> release;
  const std::shared_future<void> released = release.get_future().share();
  const ControlServer server(socket, [&](const json& request) -> ordered_json {
    if (request.contains("slow")) released.wait();
    return {{"done", true}};
  });
  std::thread slow([&] { ask_recorder(socket, {{"slow", 1}}); });
  EXPECT_EQ(ask_recorder(socket, {{"fast", 1}})["done"], true);
  release.set_value();
  slow.join();
}

TEST_F(ControlServerTest, IsNotTakenForAbsentWhereItIsSlow) {
  std::promise<void> release;
  const std::shared_future<void> released = release.get_future().share();
  const ControlServer server(socket, [&](const json& /*request*/) -> ordered_json {
    released.wait();
    return {{"done", true}};
  });
  EXPECT_THROW(ask_recorder(socket, {{"do", "x"}}, std::chrono::seconds(1)), AnswersTooLate);
  release.set_value();
}

TEST_F(ControlServerTest, ReplacesADeadSocketButNotALivingOne) {
  { std::ofstream(socket) << ""; }
  EXPECT_THROW(ControlServer(socket, echo), Error) << "a plain file is somebody's";
  std::filesystem::remove(socket);
  {
    asio::io_context context;
    asio::local::stream_protocol::acceptor dead(context,
                                                asio::local::stream_protocol::endpoint(socket.string()));
  }
  ASSERT_TRUE(std::filesystem::exists(socket));
  const ControlServer server(socket, echo);
  EXPECT_THROW(ControlServer(socket, echo), Error);
  EXPECT_EQ(std::filesystem::status(socket).permissions(), std::filesystem::perms(0660));
}

TEST_F(ControlServerTest, TellsBeforeItIsMadeWhereNothingCouldListen) {
  const auto why_not = [](const std::filesystem::path& at) -> std::string {
    try {
      ControlServer::check(at);
      return "";
    } catch (const UsageError& error) {
      return error.what();
    }
  };
  EXPECT_EQ(why_not(socket), "");
  {
    const ControlServer server(socket, echo);
    EXPECT_EQ(why_not(socket), "") << "a recorder that runs makes room for its successor";
  }
  EXPECT_THAT(why_not(folder / "absent" / "s"), HasSubstr("there is no folder"));
  EXPECT_EQ(why_not("/run/a-service-of-a-test/s"), "") << "its folder is made as the service starts";
  std::ofstream(folder / "file") << "x";
  EXPECT_THAT(why_not(folder / "file"), HasSubstr("something else lies already"));
  EXPECT_THAT(why_not(folder.path()), HasSubstr("something else lies already"));
  EXPECT_THAT(why_not(folder / std::string(108, 's')), HasSubstr("longer than 107 characters"));
}

TEST_F(ControlServerTest, SaysThatNobodyAnswers) {
  EXPECT_THROW(ask_recorder(socket, {{"do", "x"}}), NobodyAnswers);
  EXPECT_THROW(ask_recorder("/" + std::string(200, 'x'), {{"do", "x"}}), UsageError);
}

class HttpServerTest : public testing::Test {
 protected:
  HttpServerTest() : server(options()) {}
  HttpServerOptions options() {
    HttpServerOptions options;
    options.token = "a token of some length";
    options.now = [this] { return now; };
    options.tell = [this](const std::string& sentence) { told.push_back(sentence); };
    options.metrics = [] { return std::string("kiroku_x 1\n"); };
    options.hook = [this](const std::string& room, const std::string& action, const std::string& body,
                          const std::string& meant) {
      if (room == "bad") throw UsageError("no such room");
      if (room.starts_with('\xff')) throw UsageError("there is no room " + room);
      called = room + " " + action + " " + body + (meant.empty() ? "" : " of " + meant);
      return ordered_json{{"case", "c"}};
    };
    return options;
  }
  [[nodiscard]] std::string send(const std::string& request, const std::string& source = "127.0.0.1") const {
    asio::io_context context;
    asio::ip::tcp::socket peer(context, asio::ip::tcp::v4());
    peer.bind({asio::ip::make_address(source), 0});
    peer.connect({asio::ip::make_address("127.0.0.1"), server.port()});
    asio::write(peer, asio::buffer(request));
    std::string received;
    boost::system::error_code failed;
    asio::read(peer, asio::dynamic_buffer(received), failed);
    return received;
  }
  [[nodiscard]] std::string post(const std::string& target, const std::string& token, const std::string& body,
                                 const std::string& source = "127.0.0.1") const {
    return send("POST " + target + " HTTP/1.1\r\nHost: x\r\nConnection: close\r\nAuthorization: Bearer " +
                    token + "\r\nContent-Length: " + std::to_string(body.size()) + "\r\n\r\n" + body,
                source);
  }
  std::string called;
  AttemptGuard::Clock::time_point now{std::chrono::hours(1)};
  std::vector<std::string> told;
  HttpServer server;
};

TEST_F(HttpServerTest, ServesMetrics) {
  const std::string answer = send("GET /metrics HTTP/1.0\r\n\r\n");
  EXPECT_THAT(answer, HasSubstr(" 200 OK"));
  EXPECT_THAT(answer, HasSubstr("version=0.0.4"));
  EXPECT_THAT(answer, HasSubstr("\r\n\r\nkiroku_x 1\n"));
}

TEST_F(HttpServerTest, HookNeedsItsToken) {
  EXPECT_THAT(post("/rooms/or-1/start", "a token of some lengtH", ""), HasSubstr(" 401 "));
  EXPECT_THAT(send("POST /rooms/or-1/start HTTP/1.0\r\n\r\n"), HasSubstr(" 401 "));
  EXPECT_EQ(called, "");
  EXPECT_THAT(post("/rooms/or-1/mark", "a token of some length", "clip"), HasSubstr(" 200 OK"));
  EXPECT_EQ(called, "or-1 mark clip");
}

TEST_F(HttpServerTest, WhoeverGuessesTokensWaits) {
  for (int i = 0; i < 5; ++i) {
    EXPECT_THAT(post("/rooms/or-1/start", "guess number " + std::to_string(i), ""), HasSubstr(" 401 "));
  }
  const std::string refused = post("/rooms/or-1/start", "another guess", "");
  EXPECT_THAT(refused, HasSubstr(" 429 "));
  EXPECT_THAT(refused, HasSubstr("Retry-After: 2\r\n"));
  EXPECT_THAT(post("/rooms/or-1/start", "another guess", "", "127.0.0.2"), HasSubstr(" 401 "))
      << "another address need not wait";
  now += std::chrono::seconds(2);
  EXPECT_THAT(post("/rooms/or-1/start", "another guess", ""), HasSubstr(" 401 "));
  EXPECT_EQ(called, "");
  EXPECT_THAT(told, testing::ElementsAre("a wrong token for the hook came from 127.0.0.1, 1 so far",
                                         "a wrong token for the hook came from 127.0.0.1, 2 so far",
                                         "a wrong token for the hook came from 127.0.0.1, 4 so far",
                                         "a wrong token for the hook came from 127.0.0.2, 1 so far"));
}

TEST_F(HttpServerTest, AnswersAlsoWhereARoomsNameIsNoText) {
  const std::string answer = post("/rooms/\xff\xfe/start", "a token of some length", "");
  EXPECT_THAT(answer, HasSubstr(" 409 "));
  EXPECT_THAT(answer, HasSubstr("there is no room \xef\xbf\xbd")) << "U+FFFD in its place";
}

TEST_F(HttpServerTest, AFewGuessesShutTheHookToNobodyWhoHasItsToken) {
  for (int i = 0; i < 5 + 9; ++i)
    EXPECT_THAT(post("/rooms/or-1/start", "wrong", ""), testing::Not(HasSubstr(" 200 ")));
  EXPECT_EQ(called, "");
  EXPECT_THAT(post("/rooms/or-1/stop", "a token of some length", ""), HasSubstr(" 200 OK"))
      << "though it never came from here before";
  EXPECT_EQ(called, "or-1 stop ");
}

TEST_F(HttpServerTest, OfManyGuessesTenASecondAreLookedAt) {
  for (int i = 0; i < 5 + 10; ++i)
    EXPECT_THAT(post("/rooms/or-1/start", "wrong", ""), testing::Not(HasSubstr(" 200 ")));
  EXPECT_THAT(post("/rooms/or-1/stop", "a token of some length", ""), HasSubstr(" 429 "));
  EXPECT_EQ(called, "");
  now += std::chrono::seconds(1);
  EXPECT_THAT(post("/rooms/or-1/stop", "a token of some length", ""), HasSubstr(" 200 OK"))
      << "the address still has to wait";
}

TEST_F(HttpServerTest, RefusesARequestThatCouldHideAnotherAndReadsNoFurther) {
  const std::string hidden =
      "POST /rooms/or-1/start HTTP/1.1\r\nHost: x\r\nAuthorization: Bearer a token of some length\r\n\r\n";
  const std::string length = "Content-Length: " + std::to_string(hidden.size()) + "\r\n";
  for (const std::string& fields : {std::string("Host: x\r\nTransfer-Encoding: gzip\r\n"),
                                    std::string("Host: x\r\nTransfer-Encoding: chunked, identity\r\n"),
                                    "Host: x\r\nTransfer-Encoding: chunked\r\n" + length,
                                    "Host: x\r\n" + length + length, std::string("Host: x\r\nHost: y\r\n"),
                                    std::string("Host: x\r\nX-Note: one\r\n two\r\n"), std::string()}) {
    const std::string answer = send("GET /healthz HTTP/1.1\r\n" + fields + "\r\n" + hidden);
    EXPECT_THAT(answer, StartsWith("HTTP/1.1 400 Bad Request\r\n")) << fields;
    EXPECT_THAT(answer, HasSubstr("Connection: close\r\n")) << fields;
    EXPECT_EQ(answer.find("HTTP/1.1", 1), std::string::npos) << "nothing more is answered: " << fields;
  }
  EXPECT_EQ(called, "");
}

TEST(HttpServer, HealthIsThatOfTheRooms) {
  std::atomic<bool> healthy = true;
  HttpServerOptions options;
  options.healthy = [&healthy] { return healthy.load(); };
  const HttpServer server(std::move(options));
  const auto status = [&server] {
    asio::io_context context;
    asio::ip::tcp::socket socket(context);
    socket.connect({asio::ip::make_address("127.0.0.1"), server.port()});
    asio::write(socket, asio::buffer(std::string("GET /healthz HTTP/1.1\r\nHost: x\r\n\r\n")));
    std::string received;
    asio::read_until(socket, asio::dynamic_buffer(received), "\r\n");
    return received.substr(0, received.find("\r\n"));
  };
  EXPECT_THAT(status(), StartsWith("HTTP/1.1 200"));
  healthy = false;
  EXPECT_THAT(status(), StartsWith("HTTP/1.1 503"));
}

TEST_F(HttpServerTest, RefusesAChunkWithExtensionsAndReadsNoFurther) {
  const std::string hidden =
      "POST /rooms/or-1/start HTTP/1.1\r\nHost: x\r\nAuthorization: Bearer a token of some length\r\n\r\n";
  const std::string answer = send(
      "GET /healthz HTTP/1.1\r\nHost: x\r\nTransfer-Encoding: chunked\r\n\r\n2;a=\"\n\"\r\n[]\r\n0\r\n\r\n" +
      hidden);
  EXPECT_THAT(answer, StartsWith("HTTP/1.1 400 Bad Request\r\n"));
  EXPECT_EQ(answer.find("HTTP/1.1", 1), std::string::npos) << "nothing more is answered";
  EXPECT_EQ(called, "");
}

TEST_F(HttpServerTest, RefusesWhatIsTooLong) {
  EXPECT_THAT(send("GET / HTTP/1.1\r\nHost: x\r\nX: " + std::string(20'000, 'x') + "\r\n\r\n"),
              StartsWith("HTTP/1.1 431 "));
  EXPECT_THAT(send("POST /rooms/or-1/mark HTTP/1.1\r\nHost: x\r\nContent-Length: 70000\r\n\r\n"),
              StartsWith("HTTP/1.1 413 "));
}

TEST_F(HttpServerTest, IsNotShutByConnectionsThatSayNothing) {
  asio::io_context context;
  std::vector<asio::ip::tcp::socket> idle;
  for (int i = 0; i < 300; ++i) {
    asio::ip::tcp::socket& socket = idle.emplace_back(context, asio::ip::tcp::v4());
    socket.bind({asio::ip::make_address("127.0.3." + std::to_string(1 + i % 50)), 0});
    socket.connect({asio::ip::make_address("127.0.0.1"), server.port()});
  }
  EXPECT_THAT(send("GET /healthz HTTP/1.1\r\nHost: x\r\nConnection: close\r\n\r\n"), HasSubstr("ok"));
  // Accepted in order, so the first ones made room.
  std::array<char, 1> byte{};
  boost::system::error_code error;
  idle.front().read_some(asio::buffer(byte), error);
  EXPECT_TRUE(error);
}

TEST_F(HttpServerTest, TheHookMayNameTheCaseThatIsMeant) {
  const std::string token = "a token of some length", id = "20261128T231843Z-0123abcd";
  EXPECT_THAT(post("/rooms/or-1/stop?case=" + id, token, ""), HasSubstr(" 200 OK"));
  EXPECT_EQ(called, "or-1 stop  of " + id);
  EXPECT_THAT(post("/rooms/or-1/mark?case=" + id, token, "clip"), HasSubstr(" 200 OK"));
  EXPECT_EQ(called, "or-1 mark clip of " + id);
  called.clear();
  // What is not understood is never taken for whichever case runs.
  for (const std::string& query : {std::string("?"), std::string("?case="), "?case=" + id + "&x=1",
                                   "?Case=" + id, "?case=" + id + "/stop", std::string("?case=../x")})
    EXPECT_THAT(post("/rooms/or-1/stop" + query, token, ""), HasSubstr(" 400 ")) << query;
  EXPECT_THAT(post("/rooms/or-1/stop?case=" + id, "wrong", ""), HasSubstr(" 401 "));
  EXPECT_EQ(called, "");
}

TEST_F(HttpServerTest, TellsWhatItCannotDo) {
  const std::string token = "a token of some length";
  EXPECT_THAT(post("/rooms/bad/start", token, ""), HasSubstr("no such room"));
  EXPECT_THAT(post("/rooms/or-1/explode", token, ""), HasSubstr(" 404 "));
  EXPECT_THAT(post("/elsewhere", token, ""), HasSubstr(" 404 "));
  EXPECT_THAT(send("GET /rooms/or-1/start HTTP/1.0\r\n\r\n"), HasSubstr(" 405 "));
  EXPECT_EQ(called, "");
}

}  // namespace
}  // namespace kiroku::recorder

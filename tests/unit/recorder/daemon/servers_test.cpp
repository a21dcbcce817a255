#include <atomic>
#include <fstream>
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
  std::atomic<bool> release{false};
  const ControlServer server(socket, [&](const json& request) -> ordered_json {
    while (request.contains("slow") && !release) std::this_thread::sleep_for(std::chrono::milliseconds(5));
    return {{"done", true}};
  });
  std::thread slow([&] { ask_recorder(socket, {{"slow", 1}}); });
  EXPECT_EQ(ask_recorder(socket, {{"fast", 1}})["done"], true);
  release = true;
  slow.join();
}

TEST_F(ControlServerTest, IsNotTakenForAbsentWhereItIsSlow) {
  std::atomic<bool> release{false};
  const ControlServer server(socket, [&](const json& /*request*/) -> ordered_json {
    while (!release) std::this_thread::sleep_for(std::chrono::milliseconds(5));
    return {{"done", true}};
  });
  EXPECT_THROW(ask_recorder(socket, {{"do", "x"}}, std::chrono::seconds(1)), AnswersTooLate);
  release = true;
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
    options.metrics = [] { return std::string("kiroku_x 1\n"); };
    options.hook = [this](const std::string& room, const std::string& action, const std::string& body) {
      if (room == "bad") throw UsageError("no such room");
      called = room + " " + action + " " + body;
      return ordered_json{{"case", "c"}};
    };
    return options;
  }
  [[nodiscard]] std::string send(const std::string& request) const {
    asio::io_context context;
    asio::ip::tcp::socket peer(context);
    peer.connect({asio::ip::make_address("127.0.0.1"), server.port()});
    asio::write(peer, asio::buffer(request));
    std::string received;
    boost::system::error_code failed;
    asio::read(peer, asio::dynamic_buffer(received), failed);
    return received;
  }
  [[nodiscard]] std::string post(const std::string& target, const std::string& token,
                                 const std::string& body) const {
    return send("POST " + target + " HTTP/1.1\r\nHost: x\r\nConnection: close\r\nAuthorization: Bearer " +
                token + "\r\nContent-Length: " + std::to_string(body.size()) + "\r\n\r\n" + body);
  }
  std::string called;
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

// The server's connections, attacked: requests that hide others, and connections that shut others out.
#include "viewer/server/web_server.h"

#include <arpa/inet.h>
#include <atomic>
#include <future>
#include <netinet/in.h>
#include <poll.h>
#include <sys/resource.h>
#include <sys/socket.h>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/descriptor.h"
#include "tests/support/eventually.h"
#include "tests/support/https_client.h"
#include "tests/support/moved_clock.h"
#include "tests/support/temporary_folder.h"
#include "viewer/http/server_certificate.h"

namespace kiroku::viewer {
namespace {

using test::HttpResponse;
using test::HttpsConnection;
using testing::HasSubstr;

class WebServerTest : public testing::Test {
 protected:
  WebServerTest() {
    router.add("POST", "api/said", Right::kNone, [this](const Request& request) {
      said = request.body;
      return Response::text("taken", "text/plain");
    });
    router.add("GET", "api/hidden", Right::kNone, [this](const Request& /*request*/) {
      ++hidden;
      return Response::text("hidden", "text/plain");
    });
    router.add("GET", "api/mine", Right::kSeeLive,
               [](const Request& /*request*/) { return Response::text("mine", "text/plain"); });
    router.add("GET", "api/large", Right::kNone, [](const Request& /*request*/) {
      return Response::bytes(std::make_shared<const Bytes>(std::size_t{32} << 20), "text/plain");
    });
    router.add("GET", "api/slow", Right::kSeeLive,
               [this](const Request& /*request*/) { return answer_slowly(); });
    router.add("GET", "api/endless", Right::kSeeLive, [this](const Request& /*request*/) {
      return Response::stream(
          [this](Bytes& into) {
            into.assign(100, std::byte{'x'});
            ++units;
            return true;
          },
          "text/plain");
    });
  }
  /// Makes slow answers until the test releases them.
  Response answer_slowly() {
    const int now = ++slow_answers;
    int most = most_slow;
    while (most < now && !most_slow.compare_exchange_weak(most, now)) {
    }
    release.wait();
    --slow_answers;
    return Response::text("slow", "text/plain");
  }
  void serve(const WebServerLimits& limits = {}) { serve(limits, dispatcher); }
  void serve(const WebServerLimits& limits, const Dispatcher& answers) {
    bool made = false;
    ServerCertificate certificate = own_certificate(folder.path(), {"127.0.0.1"}, made);
    WebServerOptions options;
    options.listen = "127.0.0.1:0";
    options.certificate_pem = std::move(certificate.certificate_pem);
    options.key_pem = std::move(certificate.key_pem);
    options.limits = limits;
    server.emplace(std::move(options), answers);
  }
  /// A connection that never says anything, not even to TLS.
  [[nodiscard]] Descriptor silent(const std::string& source) const {
    const auto address = [](const std::string& host, std::uint16_t port) {
      sockaddr_in out{};
      out.sin_family = AF_INET;
      out.sin_port = htons(port);
      inet_pton(AF_INET, host.c_str(), &out.sin_addr);
      return out;
    };
    Descriptor socket(::socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0));
    const sockaddr_in from = address(source, 0), to = address("127.0.0.1", server->port());
    EXPECT_EQ(::bind(socket.number(), reinterpret_cast<const sockaddr*>(&from), sizeof from), 0);
    EXPECT_EQ(::connect(socket.number(), reinterpret_cast<const sockaddr*>(&to), sizeof to), 0);
    return socket;
  }
  static std::string hidden_request() { return "GET /api/hidden HTTP/1.1\r\nHost: localhost\r\n\r\n"; }
  static std::string post(const std::string& fields, const std::string& body) {
    return "POST /api/said HTTP/1.1\r\nX-Kiroku-Request: 1\r\nContent-Type: application/json\r\n" + fields +
           "\r\n" + body;
  }

  test::TemporaryFolder folder;
  std::atomic<int> hidden{0}, units{0}, slow_answers{0}, most_slow{0};
  std::promise<void> released;
  std::shared_future<void> release = released.get_future().share();
  std::string said;
  Router router;
  SessionStore sessions;
  StaticFiles page;
  Dispatcher dispatcher{router, sessions, page, [](const std::string& /*sentence*/) {}};
  std::optional<WebServer> server;
};

TEST_F(WebServerTest, AnswersARequestWhoseBodyEndsInOneWay) {
  serve();
  HttpsConnection connection(server->port());
  connection.send(post("Host: localhost\r\nContent-Length: 2\r\n", "{}") + hidden_request() +
                  post("Host: localhost\r\nTransfer-Encoding: chunked\r\n", "2\r\n[]\r\n0\r\n\r\n"));
  EXPECT_EQ(connection.receive().body, "taken");
  EXPECT_EQ(connection.receive().body, "hidden");
  EXPECT_EQ(connection.receive().body, "taken");
  EXPECT_EQ(said, "[]");
  EXPECT_EQ(hidden, 1);
}

TEST_F(WebServerTest, RefusesARequestThatCouldHideAnotherAndReadsNoFurther) {
  serve();
  const std::string body = hidden_request();
  const std::string length = "Content-Length: " + std::to_string(body.size()) + "\r\n";
  const std::string host = "Host: localhost\r\n";
  for (const std::string& fields :
       {host + "Transfer-Encoding: gzip\r\n", host + "Transfer-Encoding: xchunked\r\n",
        host + "Transfer-Encoding: chunked, identity\r\n", host + "Transfer-Encoding: identity\r\n",
        host + length + "Transfer-Encoding: chunked\r\n", host + "Transfer-Encoding: chunked\r\n" + length,
        host + length + length, host + "Content-Length: 0\r\nContent-Length: 0\r\n",
        host + "Host: elsewhere\r\n", host + host, host + "X-Note: one\r\n two\r\n",
        host + "X-Note: one\r\n\ttwo\r\n", host + "Content-Length: 0, 0\r\n", host + "Content-Length : 0\r\n",
        std::string()}) {
    HttpsConnection connection(server->port());
    connection.send(post(fields, body));
    const HttpResponse answer = connection.receive();
    EXPECT_EQ(answer.status, 400) << fields;
    EXPECT_EQ(answer.headers.at("connection"), "close") << fields;
    EXPECT_EQ(connection.receive().status, 0) << "nothing more is answered: " << fields;
  }
  EXPECT_EQ(hidden, 0);
  EXPECT_EQ(said, "");
}

// Some programs take the line feed within the quotes for the end of the chunk's line.
TEST_F(WebServerTest, RefusesAChunkWithExtensionsAndReadsNoFurther) {
  serve();
  for (const std::string& line : {std::string("2;a=\"\n\""), std::string("2;a"), std::string("2;a=b")}) {
    HttpsConnection connection(server->port());
    connection.send(post("Host: localhost\r\nTransfer-Encoding: chunked\r\n",
                         line + "\r\n[]\r\n0\r\n\r\n" + hidden_request()));
    EXPECT_EQ(connection.receive().status, 400) << line;
    EXPECT_EQ(connection.receive().status, 0) << "nothing more is answered: " << line;
  }
  EXPECT_EQ(hidden, 0);
  EXPECT_EQ(said, "");
}

TEST_F(WebServerTest, TakesAHeadByteByByteAndTellsWhereItIsTooLong) {
  serve({.header_bytes = 300});
  HttpsConnection slow(server->port());
  for (const char c : hidden_request()) slow.send(std::string(1, c));
  EXPECT_EQ(slow.receive().body, "hidden");
  HttpsConnection at_once(server->port());
  at_once.send("GET / HTTP/1.1\r\nHost: localhost\r\nX: " + std::string(400, 'x') + "\r\n\r\n");
  EXPECT_EQ(at_once.receive().status, 431);
  HttpsConnection endless(server->port());
  endless.send(std::string(1000, 'x'));
  EXPECT_EQ(endless.receive().status, 431);
}

TEST_F(WebServerTest, SilentConnectionsShutNobodyOut) {
  serve({.connections = 20, .connections_of_address = 10});
  const std::string cookie =
      std::string(kSessionCookie) + "=" + sessions.open("anna", Role::kSurgeon, {}).token;
  HttpsConnection signed_in(server->port());
  const std::string mine = test::http_request("GET", "/api/mine", {{"Cookie", cookie}});
  signed_in.send(mine);
  ASSERT_EQ(signed_in.receive().body, "mine");
  std::vector<Descriptor> held;
  for (int i = 0; i < 100; ++i) held.push_back(silent("127.0.1." + std::to_string(1 + i % 50)));
  EXPECT_EQ(test::ask_once(server->port(), hidden_request()).body, "hidden");
  signed_in.send(mine);
  EXPECT_EQ(signed_in.receive().body, "mine") << "whoever signed in keeps the connection";
}

// Files and sources of a recording in the same process need some of the descriptors that a shell gives.
TEST_F(WebServerTest, ConnectionsLeaveDescriptorsForWhatRecords) {
  struct SoftLimit {
    SoftLimit() {
      ::getrlimit(RLIMIT_NOFILE, &before);
      rlimit now = before;
      now.rlim_cur = 1024;
      lowered = ::setrlimit(RLIMIT_NOFILE, &now) == 0;
    }
    ~SoftLimit() { ::setrlimit(RLIMIT_NOFILE, &before); }
    SoftLimit(const SoftLimit&) = delete;
    SoftLimit& operator=(const SoftLimit&) = delete;
    rlimit before{};
    bool lowered = false;
  };
  serve();
  const SoftLimit limit;
  ASSERT_TRUE(limit.lowered);
  // Each takes two here: the client's end is in the same process.
  std::vector<Descriptor> held;
  for (int i = 0; i < 450; ++i) held.push_back(silent("127.0.1." + std::to_string(1 + i % 50)));
  pollfd last{held.back().number(), POLLIN, 0};
  EXPECT_EQ(::poll(&last, 1, 5000), 1) << "it is let go";
  pollfd first{held.front().number(), POLLIN, 0};
  EXPECT_EQ(::poll(&first, 1, 0), 0) << "and the first stay";
  held.clear();
  EXPECT_TRUE(test::eventually([this] {
    try {
      return test::ask_once(server->port(), hidden_request()).body == "hidden";
    } catch (const std::runtime_error&) {
      return false;
    }
  }));
}

TEST_F(WebServerTest, WhoTakesAnAnswerSlowlyShutsNobodyOut) {
  serve({.connections = 20, .connections_of_address = 10});
  std::vector<HttpsConnection> slow;
  for (int i = 0; i < 20; ++i) {
    slow.emplace_back(server->port(), "127.0.1." + std::to_string(1 + i));
    slow.back().send("GET /api/large HTTP/1.1\r\nHost: localhost\r\n\r\n");
  }
  // None of them reads; the answers are being sent when the buffers of the kernel are full.
  EXPECT_TRUE(test::eventually([this] {
    try {
      return test::ask_once(server->port(), hidden_request(), "127.0.9.9").body == "hidden";
    } catch (const std::runtime_error&) {  // let go before TLS: all places are taken
      return false;
    }
  }));
}

TEST_F(WebServerTest, OneUsersConnectionsShutNobodyOut) {
  serve({.connections = 20, .connections_of_address = 10, .kept_connections_of_person = 2});
  const auto ask_mine = [this](HttpsConnection& connection, const std::string& user) {
    const std::string cookie =
        std::string(kSessionCookie) + "=" + sessions.open(user, Role::kSurgeon, {}).token;
    connection.send(test::http_request("GET", "/api/mine", {{"Cookie", cookie}}));
    return connection.receive().body;
  };
  HttpsConnection anna(server->port());
  ASSERT_EQ(ask_mine(anna, "anna"), "mine");
  std::vector<HttpsConnection> held;
  for (int i = 0; i < 30; ++i) {
    held.emplace_back(server->port(), "127.0.1." + std::to_string(1 + i));
    ASSERT_EQ(ask_mine(held.back(), "ben"), "mine") << i;
  }
  HttpsConnection carla(server->port(), "127.0.9.9");
  EXPECT_EQ(ask_mine(carla, "carla"), "mine");
  EXPECT_EQ(ask_mine(anna, "anna"), "mine") << "whoever has few connections keeps them";
}

TEST_F(WebServerTest, UsersOfOneAddressDoNotShutOutItsOthers) {
  serve({.connections = 100, .connections_of_address = 16, .kept_connections_of_person = 2});
  const auto ask_mine = [this](HttpsConnection& connection, const std::string& cookie) {
    connection.send(test::http_request("GET", "/api/mine", {{"Cookie", cookie}}));
    return connection.receive().body;
  };
  const auto cookie_of = [this](const std::string& user) {
    return std::string(kSessionCookie) + "=" + sessions.open(user, Role::kSurgeon, {}).token;
  };
  const std::string anna = cookie_of("anna"), ben = cookie_of("ben"), carla = cookie_of("carla");
  HttpsConnection of_carla(server->port(), "127.0.3.1");
  ASSERT_EQ(ask_mine(of_carla, carla), "mine");
  std::vector<HttpsConnection> held;
  for (int i = 0; i < 24; ++i) {
    held.emplace_back(server->port(), "127.0.3.1");
    ASSERT_EQ(ask_mine(held.back(), i % 2 == 0 ? anna : ben), "mine") << i;
  }
  // Nobody of whom the server knows anything, at the same address.
  EXPECT_EQ(test::ask_once(server->port(), hidden_request(), "127.0.3.1").body, "hidden");
  HttpsConnection of_dora(server->port(), "127.0.3.1");
  EXPECT_EQ(ask_mine(of_dora, cookie_of("dora")), "mine");
  EXPECT_EQ(ask_mine(of_carla, carla), "mine") << "whoever has few connections keeps them";
}

TEST_F(WebServerTest, OnePersonsAnswersDoNotKeepTheOthersFromTheirs) {
  serve({.answers_of_person = 2});
  const auto request = [this](const std::string& user, const std::string& target) {
    const std::string token = sessions.open(user, Role::kSurgeon, {}).token;
    return test::http_request("GET", target, {{"Cookie", std::string(kSessionCookie) + "=" + token}});
  };
  std::vector<HttpsConnection> waiting;
  for (int i = 0; i < 6; ++i) {
    waiting.emplace_back(server->port());
    waiting.back().send(request("anna", "/api/slow"));
  }
  ASSERT_TRUE(test::eventually([this] { return slow_answers == 2; }));
  HttpsConnection ben(server->port());
  ben.send(request("ben", "/api/slow"));
  EXPECT_TRUE(test::eventually([this] { return slow_answers == 3; })) << "another person's";
  released.set_value();
  for (HttpsConnection& each : waiting) EXPECT_EQ(each.receive().body, "slow");
  EXPECT_EQ(ben.receive().body, "slow");
  EXPECT_LE(most_slow, 3) << "the third of one person waits for the first";
}

TEST_F(WebServerTest, LargeAnswersThatNobodyTakesAreNotMadeWithoutEnd) {
  std::atomic<int> made = 0;
  router.add({"GET", "api/untaken", Right::kSeeLive, [&made](const Request& /*request*/) {
                ++made;
                return Response::text(std::string(64U << 20, 'x'), "text/plain");  // more than sockets hold
              }});
  serve({.answers_of_person = 2});
  const auto request = [this](const std::string& user) {
    const std::string token = sessions.open(user, Role::kSurgeon, {}).token;
    return test::http_request("GET", "/api/untaken", {{"Cookie", std::string(kSessionCookie) + "=" + token}});
  };
  std::vector<HttpsConnection> of_anna;
  for (int i = 0; i < 6; ++i) {
    of_anna.emplace_back(server->port());
    of_anna.back().send(request("anna"));
  }
  ASSERT_TRUE(test::eventually([&] { return made == 2; }));
  HttpsConnection ben(server->port());
  ben.send(request("ben"));
  EXPECT_EQ(ben.receive().body.size(), 64U << 20);
  EXPECT_EQ(made, 3) << "the third of one person waits until one is taken";
}

TEST_F(WebServerTest, QuickAnswersDoNotWaitBehindTheSamePersonsOthers) {
  Route status{"GET", "api/quick", Right::kSeeLive,
               [](const Request& /*request*/) { return Response::text("quick", "text/plain"); }};
  status.is_quick = true;
  router.add(std::move(status));
  serve({.answers_of_person = 1});
  const std::string cookie =
      std::string(kSessionCookie) + "=" + sessions.open("anna", Role::kSurgeon, {}).token;
  HttpsConnection film(server->port()), room(server->port());
  film.send(test::http_request("GET", "/api/slow", {{"Cookie", cookie}}));
  ASSERT_TRUE(test::eventually([this] { return slow_answers == 1; }));
  room.send(test::http_request("GET", "/api/quick", {{"Cookie", cookie}}));
  EXPECT_EQ(room.receive().body, "quick");
  released.set_value();
  EXPECT_EQ(film.receive().body, "slow");
}

TEST_F(WebServerTest, ADownloadEndsWithItsSession) {
  serve();
  const SessionStore::Opened anna = sessions.open("anna", Role::kSurgeon, {});
  const std::string cookie = std::string(kSessionCookie) + "=" + anna.token;
  HttpsConnection connection(server->port());
  connection.send(test::http_request("GET", "/api/endless", {{"Cookie", cookie}}));
  std::future<HttpResponse> answer = std::async(std::launch::async, [&] { return connection.receive(); });
  ASSERT_TRUE(test::eventually([this] { return units > 1; }));
  anna.session->end();
  ASSERT_EQ(answer.wait_for(std::chrono::seconds(60)), std::future_status::ready);
}

TEST_F(WebServerTest, ADownloadThatIsTakenTooSlowlyIsCut) {
  // No client is as fast as this.
  serve({.least_download_pace = std::size_t{1} << 50, .pace_counts_after = std::chrono::milliseconds(20)});
  const std::string cookie =
      std::string(kSessionCookie) + "=" + sessions.open("anna", Role::kSurgeon, {}).token;
  HttpsConnection connection(server->port());
  connection.send(test::http_request("GET", "/api/endless", {{"Cookie", cookie}}));
  std::future<HttpResponse> answer = std::async(std::launch::async, [&] { return connection.receive(); });
  ASSERT_EQ(answer.wait_for(std::chrono::seconds(60)), std::future_status::ready);
  EXPECT_EQ(test::ask_once(server->port(), test::http_request("GET", "/api/mine", {{"Cookie", cookie}})).body,
            "mine");
}

TEST_F(WebServerTest, ADownloadThatIsTakenDoesNotEndItsSession) {
  test::MovedClock clock;
  SessionStore timed({.idle = std::chrono::minutes(30)}, clock);
  Dispatcher by_clock(router, timed, page, [](const std::string& /*sentence*/) {});
  serve({}, by_clock);
  const SessionStore::Opened anna = timed.open("anna", Role::kSurgeon, {});
  const std::string cookie = std::string(kSessionCookie) + "=" + anna.token;
  HttpsConnection connection(server->port());
  connection.send(test::http_request("GET", "/api/endless", {{"Cookie", cookie}}));
  std::future<HttpResponse> answer = std::async(std::launch::async, [&] { return connection.receive(); });
  for (int half = 0; half < 4; ++half) {
    clock.move(std::chrono::minutes(20));
    const int before = units;
    ASSERT_TRUE(test::eventually([&] { return units > before + 1; }));
    timed.sweep([](const Session& /*session*/) { return false; });
  }
  EXPECT_FALSE(anna.session->has_ended());
  anna.session->end();
  answer.wait();
  server.reset();
}

TEST_F(WebServerTest, AnAddressTakesFromItsOwnConnectionsAlone) {
  serve({.connections = 100, .connections_of_address = 3});
  HttpsConnection other(server->port(), "127.0.2.2");
  std::vector<Descriptor> held;
  for (int i = 0; i < 30; ++i) held.push_back(silent("127.0.2.1"));
  EXPECT_EQ(test::ask_once(server->port(), hidden_request(), "127.0.2.1").body, "hidden");
  other.send(hidden_request());
  EXPECT_EQ(other.receive().body, "hidden");
}

}  // namespace
}  // namespace kiroku::viewer

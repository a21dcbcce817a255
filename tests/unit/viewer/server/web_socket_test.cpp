#include <atomic>
#include <condition_variable>
#include <mutex>
#include <thread>

#include <boost/system/system_error.hpp>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/support/moved_clock.h"
#include "tests/support/socket_client.h"
#include "tests/support/temporary_folder.h"
#include "viewer/http/server_certificate.h"
#include "viewer/server/web_server.h"

namespace kiroku::viewer {
namespace {

using test::SocketClient;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::Pair;

/// What handlers of a test saw, from whichever thread.
struct Seen {
  std::mutex mutex;
  std::condition_variable changed;
  std::vector<std::string> messages;
  int opened = 0, gone = 0;
  std::shared_ptr<SocketOutput> output;

  template <typename Condition>
  bool wait_for(Condition condition) {
    std::unique_lock lock(mutex);
    return changed.wait_for(lock, std::chrono::seconds(10), condition);
  }
};

/// Answers text with text and bytes with bytes, but for a few words.
class Echo final : public SocketHandler {
 public:
  Echo(Seen& seen, std::shared_ptr<SocketOutput> output) : seen_(seen), output_(std::move(output)) {
    const std::lock_guard guard(seen_.mutex);
    ++seen_.opened;
    seen_.output = output_;
  }
  ~Echo() override {
    const std::lock_guard guard(seen_.mutex);
    ++seen_.gone;
    seen_.changed.notify_all();
  }
  Echo(const Echo&) = delete;
  Echo& operator=(const Echo&) = delete;

  void receive(const SocketMessage& message) override {
    const std::string text(text_of(message.bytes));
    if (text == "refuse") throw Refusal(400, "there is no tool " + std::string(200, 'x'));
    if (text == "fail") throw std::runtime_error("a detail");
    {
      const std::lock_guard guard(seen_.mutex);
      seen_.messages.push_back((message.is_text ? "text " : "bytes ") + std::to_string(text.size()));
    }
    if (message.is_text) {
      output_->send_text("you said " + text);
    } else {
      output_->send_bytes(std::make_shared<const Bytes>(message.bytes.rbegin(), message.bytes.rend()));
    }
  }

 private:
  Seen& seen_;
  std::shared_ptr<SocketOutput> output_;
};

class WebSocketTest : public testing::Test {
 protected:
  WebSocketTest() {
    const auto open = [this](const Request& /*request*/, std::shared_ptr<SocketOutput> output) {
      return std::make_unique<Echo>(seen, std::move(output));
    };
    router.add_socket("api/echo", Right::kSeeLive, open);
    router.add_socket("api/locked", Right::kSeeLive,
                      [](const Request& /*request*/,
                         const std::shared_ptr<SocketOutput>& /*output*/) -> std::unique_ptr<SocketHandler> {
                        throw Refusal(423, "give an identity first");
                      });
    Route quiet;
    quiet.method = "GET";
    quiet.pattern = "api/quiet";
    quiet.right = Right::kSeeLive;
    quiet.socket = open;
    quiet.is_activity = false;
    quiet.body_limit = 16;
    router.add(std::move(quiet));
    start();
  }
  void start() {
    bool made = false;
    ServerCertificate certificate = own_certificate(folder.path(), {"127.0.0.1"}, made);
    WebServerOptions options;
    options.listen = "127.0.0.1:0";
    options.certificate_pem = std::move(certificate.certificate_pem);
    options.key_pem = std::move(certificate.key_pem);
    server.emplace(std::move(options), dispatcher);
  }
  SocketClient connect(const std::string& target, const std::string& cookie, const std::string& origin = "") {
    const std::string own = "https://127.0.0.1:" + std::to_string(server->port());
    return SocketClient(server->port(), target, cookie, origin.empty() ? own : origin);
  }
  /// "" where the connection is made.
  std::string refusal(const std::string& target, const std::string& cookie, const std::string& origin = "") {
    try {
      connect(target, cookie, origin);
      return "";
    } catch (const boost::system::system_error& error) {
      return error.code().message();
    }
  }
  std::string signed_in(Role role) {
    opened = sessions.open("anna", role, {});
    return std::string(kSessionCookie) + "=" + opened.token;
  }
  static std::string text_of_message(const std::optional<SocketClient::Message>& message) {
    return message ? (message->is_text ? "text " : "bytes ") + std::string(text_of(message->bytes))
                   : "nothing";
  }

  test::TemporaryFolder folder;
  Seen seen;
  Router router;
  test::MovedClock time;
  SessionStore sessions{SessionLimits(), time};
  SessionStore::Opened opened;
  StaticFiles page;
  std::mutex told_mutex;
  std::vector<std::string> told;
  Dispatcher dispatcher{router, sessions, page, [this](const std::string& sentence) {
                          const std::lock_guard guard(told_mutex);
                          told.push_back(sentence);
                        }};
  std::optional<WebServer> server;
};

TEST_F(WebSocketTest, CarriesTextAndBytesBothWaysInOrder) {
  SocketClient client = connect("/api/echo", signed_in(Role::kSurgeon));
  client.send_text("{\"tool\":1}");
  EXPECT_EQ(text_of_message(client.receive()), "text you said {\"tool\":1}");
  client.send_bytes(to_bytes("abc"));
  EXPECT_EQ(text_of_message(client.receive()), "bytes cba");
  for (int i = 0; i < 100; ++i) client.send_text(std::to_string(i));
  for (int i = 0; i < 100; ++i) {
    EXPECT_EQ(text_of_message(client.receive()), "text you said " + std::to_string(i));
  }
  const std::lock_guard guard(seen.mutex);
  EXPECT_EQ(seen.output->waiting(), 0U);
}

TEST_F(WebSocketTest, IsRefusedAsEveryRequestIs) {
  const std::string surgeon = signed_in(Role::kSurgeon);
  EXPECT_NE(refusal("/api/echo", ""), "");
  EXPECT_NE(refusal("/api/echo", "__Host-kiroku=forged"), "");
  EXPECT_NE(refusal("/api/echo", surgeon, "https://evil.example"), "");
  EXPECT_NE(refusal("/api/locked", surgeon), "");
  EXPECT_NE(refusal("/api/echo", signed_in(Role::kAuditor)), "");
  EXPECT_EQ(seen.opened, 0);
  EXPECT_EQ(refusal("/api/echo", surgeon), "");
}

TEST_F(WebSocketTest, TellsItsHandlerThatTheBrowserHasGone) {
  const std::string cookie = signed_in(Role::kSurgeon);
  connect("/api/echo", cookie).close();
  EXPECT_TRUE(seen.wait_for([&] { return seen.gone == 1; }));
  { const SocketClient cut = connect("/api/echo", cookie); }
  EXPECT_TRUE(seen.wait_for([&] { return seen.gone == 2; }));
  EXPECT_FALSE(seen.output->send_text("is anybody there"));
}

TEST_F(WebSocketTest, TakesNoLongerMessageThanItsRouteAllows) {
  SocketClient client = connect("/api/quiet", signed_in(Role::kSurgeon));
  client.send_text("sixteen letters.");
  EXPECT_EQ(text_of_message(client.receive()), "text you said sixteen letters.");
  client.send_text("seventeen letters");
  EXPECT_EQ(client.receive(), std::nullopt);
  EXPECT_EQ(client.farewell().first, 1009);
  EXPECT_TRUE(seen.wait_for([&] { return seen.gone == 1; }));
  EXPECT_THAT(seen.messages, ElementsAre("text 16"));
}

TEST_F(WebSocketTest, ClosesWithTheSentenceOfWhatItsHandlerRefuses) {
  const std::string cookie = signed_in(Role::kSurgeon);
  SocketClient refused = connect("/api/echo", cookie);
  refused.send_text("refuse");
  EXPECT_EQ(refused.receive(), std::nullopt);
  EXPECT_THAT(refused.farewell(), Pair(1008, HasSubstr("there is no tool xxx")));
  SocketClient failed = connect("/api/echo", cookie);
  failed.send_text("fail");
  EXPECT_EQ(failed.receive(), std::nullopt);
  EXPECT_THAT(failed.farewell(), Pair(1011, testing::Not(HasSubstr("detail"))));
  EXPECT_TRUE(seen.wait_for([&] { return seen.gone == 2; }));
  const std::lock_guard guard(told_mutex);
  EXPECT_THAT(told, ElementsAre("GET api/echo: a detail"));
}

TEST_F(WebSocketTest, ClosesSoonAfterItsSessionEnded) {
  SocketClient client = connect("/api/echo", signed_in(Role::kSurgeon));
  opened.session->end();
  EXPECT_EQ(client.receive(), std::nullopt);
  EXPECT_THAT(client.farewell(), Pair(1008, "the session has ended"));
  EXPECT_TRUE(seen.wait_for([&] { return seen.gone == 1; }));
}

// A guest whose invitation was revoked, and who takes nothing: signs of life do not keep the connection.
TEST_F(WebSocketTest, IsCutSoonAfterItsSessionEndedAlsoWhereNothingIsTaken) {
  const SocketClient client = connect("/api/echo", signed_in(Role::kSurgeon));
  ASSERT_TRUE(seen.wait_for([&] { return seen.output != nullptr; }));
  const auto picture = std::make_shared<const Bytes>(1U << 20);
  while (seen.output->send_bytes(picture)) {
  }
  opened.session->end();
  EXPECT_TRUE(seen.wait_for([&] { return seen.gone == 1; }));
}

TEST_F(WebSocketTest, KeepsTheSessionAliveByWhatABrowserSendsWhereThatIsADeed) {
  const std::string cookie = signed_in(Role::kSurgeon);
  const auto left_after_a_message = [&](const std::string& target) {
    SocketClient client = connect(target, cookie);
    time.move(std::chrono::milliseconds(1200));
    client.send_text("here");
    client.receive();
    return sessions.left(*opened.session);
  };
  const std::chrono::seconds whole = SessionLimits().idle;
  EXPECT_LT(left_after_a_message("/api/quiet"), whole - std::chrono::seconds(1));
  EXPECT_GE(left_after_a_message("/api/echo"), whole - std::chrono::seconds(1));
}

TEST_F(WebSocketTest, QueuesNoMoreForASlowBrowserThanItsLimit) {
  const SocketClient client = connect("/api/echo", signed_in(Role::kSurgeon));
  ASSERT_TRUE(seen.wait_for([&] { return seen.output != nullptr; }));
  const auto picture = std::make_shared<const Bytes>(1U << 20);
  int taken = 0;
  while (seen.output->send_bytes(picture)) ASSERT_LT(++taken, 200);
  EXPECT_GE(taken, 4);
  EXPECT_LE(seen.output->waiting(), 4U << 20);
}

TEST_F(WebSocketTest, EndsWithASentenceAfterWhatWasQueuedBefore) {
  SocketClient client = connect("/api/echo", signed_in(Role::kSurgeon));
  ASSERT_TRUE(seen.wait_for([&] { return seen.output != nullptr; }));
  seen.output->send_text("the last one");
  seen.output->end("the table is taken away");
  EXPECT_FALSE(seen.output->send_text("too late"));
  seen.output->end("only the first reason counts");
  EXPECT_EQ(text_of_message(client.receive()), "text the last one");
  EXPECT_EQ(client.receive(), std::nullopt);
  EXPECT_THAT(client.farewell(), Pair(1008, "the table is taken away"));
  EXPECT_TRUE(seen.wait_for([&] { return seen.gone == 1; }));
}

TEST_F(WebSocketTest, TellsOnceWhatWasQueuedHasBeenTakenOrNeverWill) {
  std::optional<SocketClient> client;
  client.emplace(server->port(), "/api/echo", signed_in(Role::kSurgeon),
                 "https://127.0.0.1:" + std::to_string(server->port()));
  ASSERT_TRUE(seen.wait_for([&] { return seen.output != nullptr; }));
  std::atomic<int> told_taken = 0;
  const auto tell_taken = [&] {
    ++told_taken;
    // Whoever waits looks under the mutex: without it they could miss this.
    { const std::lock_guard guard(seen.mutex); }
    seen.changed.notify_all();
  };
  seen.output->when_taken(tell_taken);
  EXPECT_EQ(told_taken, 1) << "nothing waits";
  seen.output->send_text("a message");
  seen.output->when_taken(tell_taken);
  EXPECT_TRUE(seen.wait_for([&] { return told_taken == 2; }));
  const auto picture = std::make_shared<const Bytes>(1U << 20);
  while (seen.output->send_bytes(picture)) {
  }
  seen.output->when_taken(tell_taken);
  EXPECT_EQ(told_taken, 2) << "the browser takes nothing";
  client.reset();
  EXPECT_TRUE(seen.wait_for([&] { return told_taken == 3; })) << "and has gone";
}

TEST_F(WebSocketTest, MayBeKeptByItsHandlersFriendsBeyondTheServer) {
  const SocketClient client = connect("/api/echo", signed_in(Role::kSurgeon));
  ASSERT_TRUE(seen.wait_for([&] { return seen.output != nullptr; }));
  server.reset();
  EXPECT_EQ(seen.gone, 1);
  EXPECT_FALSE(seen.output->send_text("late"));
  seen.output.reset();
}

TEST_F(WebSocketTest, SaysSoToWhoAsksForItAsAPage) {
  const std::string cookie = signed_in(Role::kSurgeon);
  const auto admission =
      dispatcher.admit({"GET", "/api/echo", "192.0.2.7", {{"host", "or-3"}, {"cookie", cookie}}});
  ASSERT_FALSE(admission.refusal);
  EXPECT_EQ(dispatcher.answer(admission).status, 426);
}

}  // namespace
}  // namespace kiroku::viewer

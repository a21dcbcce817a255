// What the viewer asks of a program behind it, where that program does not read, does not answer, or is asked
// for by one person again and again. A real program's door.
#include "viewer/server/workplace_link.h"

#include <condition_variable>
#include <future>
#include <mutex>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "tests/support/eventually.h"
#include "tests/support/temporary_folder.h"
#include "viewer/people/session.h"
#include "viewer/server/web_server.h"
#include "viewer/server/workplace_caller.h"

namespace kiroku::viewer {
namespace {

using namespace std::chrono_literals;
using testing::ElementsAre;
using testing::HasSubstr;

/// What the browser would be told.
class Told final : public SocketOutput {
 public:
  bool send_text(std::string /*text*/) override { return true; }
  bool send_bytes(std::shared_ptr<const Bytes> /*bytes*/) override { return true; }
  [[nodiscard]] std::size_t waiting() const override { return 0; }
  void when_taken(std::function<void()> action) override { action(); }
  void end(std::string sentence) override {
    const std::lock_guard guard(mutex_);
    ended_ = std::move(sentence);
  }
  [[nodiscard]] std::string ended() const {
    const std::lock_guard guard(mutex_);
    return ended_;
  }

 private:
  mutable std::mutex mutex_;
  std::string ended_;
};

/// A program that does nothing more for anybody until it is released.
class Program {
 public:
  explicit Program(const std::filesystem::path& socket) {
    router_.add("GET", "api/planning/plans", Right::kPlan, [this](const Request& request) {
      stop_here(request.session->user());
      return Response::json({{"user", request.session->user()}});
    });
    router_.add_socket("api/planning/table", Right::kPlan,
                       [this](const Request& /*request*/, const std::shared_ptr<SocketOutput>& /*output*/) {
                         return std::make_unique<Reader>(*this);
                       });
    WebServerOptions options;
    options.listen = "";
    options.inner_door = std::make_unique<InnerDoor>(socket);
    server_.emplace(std::move(options), dispatcher_, &dispatcher_);
  }
  ~Program() { release(); }
  Program(const Program&) = delete;
  Program& operator=(const Program&) = delete;

  void release() {
    const std::lock_guard guard(mutex_);
    released_ = true;
    changed_.notify_all();
  }
  /// Of requests, who asked; of a WebSocket, what was said. In the order they came.
  [[nodiscard]] std::vector<std::string> heard() const {
    const std::lock_guard guard(mutex_);
    return heard_;
  }

 private:
  class Reader final : public SocketHandler {
   public:
    explicit Reader(Program& program) : program_(program) {}
    void receive(const SocketMessage& message) override {
      program_.stop_here(
          std::string(text_of(message.bytes.first(std::min<std::size_t>(message.bytes.size(), 8)))));
    }

   private:
    Program& program_;
  };
  void stop_here(const std::string& what) {
    std::unique_lock lock(mutex_);
    heard_.push_back(what);
    changed_.wait(lock, [this] { return released_; });
  }

  mutable std::mutex mutex_;
  std::condition_variable changed_;
  bool released_ = false;
  std::vector<std::string> heard_;
  Router router_;
  StaticFiles no_page_;
  Dispatcher dispatcher_{router_, whom_the_viewer_names(), no_page_, [](const std::string& /*sentence*/) {}};
  std::optional<WebServer> server_;  // last: over before what it calls
};

class WorkplaceLinkTest : public testing::Test {
 protected:
  Request request_of(const std::string& user, const std::string& target) {
    Request request;
    request.method = "GET";
    request.target = target;
    request.peer = "192.0.2.7";
    request.session = sessions.open(user, Role::kSurgeon, {}).session;
    return request;
  }
  /// The status that comes, or that of the refusal.
  std::future<int> ask(WorkplaceLink& link, std::shared_ptr<Session> session) {
    return std::async(std::launch::async, [this, &link, session = std::move(session)] {
      Request request = request_of("nobody", "/api/planning/plans");
      request.session = session;
      try {
        return link.ask(request).status;
      } catch (const Refusal& refusal) {
        return refusal.status();
      }
    });
  }
  std::shared_ptr<Session> session_of(const std::string& user) {
    return sessions.open(user, Role::kSurgeon, {}).session;
  }
  /// Says so many KiB, one a message; what it is refused with, or "".
  static std::string say(SocketHandler& handler, std::size_t messages) {
    const std::string text(1024, 'x');
    try {
      for (std::size_t i = 0; i < messages; ++i) handler.receive({true, bytes_of(text)});
    } catch (const Refusal& refusal) {
      return refusal.what();
    }
    return "";
  }

  test::TemporaryFolder folder;
  SessionStore sessions;
  std::atomic<bool> closing = false;
  Program program{folder / "planning.sock"};
  std::shared_ptr<Told> told = std::make_shared<Told>();
};

TEST_F(WorkplaceLinkTest, HoldsNoThreadForAProgramThatDoesNotRead) {
  // Nothing here waits for the program: no time limit is reached.
  WorkplaceLink link("planning", folder / "planning.sock", closing, {.to_take = 1h});
  const auto handler = link.open(request_of("anna", "/api/planning/table"), told);
  EXPECT_THAT(say(*handler, 100'000), HasSubstr("takes less than is sent")) << "what waits is bounded";
}

TEST_F(WorkplaceLinkTest, EndsAConnectionWhoseProgramDoesNotReadInTime) {
  WorkplaceLink link("planning", folder / "planning.sock", closing,
                     {.untaken_bytes = 64U << 20, .untaken_messages = 1U << 20, .to_take = 50ms});
  const auto handler = link.open(request_of("anna", "/api/planning/table"), told);
  // More than the kernel holds between two programs.
  EXPECT_EQ(say(*handler, 16'000), "");
  EXPECT_TRUE(test::eventually([&] { return !told->ended().empty(); }));
  EXPECT_THAT(told->ended(), HasSubstr("takes nothing of what is sent"));
  EXPECT_EQ(say(*handler, 100'000), "") << "nothing is kept for a connection that is over";
}

TEST_F(WorkplaceLinkTest, SendsWhatWasSaidBeforeTheBrowserWent) {
  WorkplaceLink link("planning", folder / "planning.sock", closing, {.to_take_last = 1h});
  auto handler = link.open(request_of("anna", "/api/planning/table"), told);
  for (const char* text : {"one", "two", "three"}) handler->receive({true, bytes_of(std::string_view(text))});
  handler.reset();
  program.release();
  EXPECT_TRUE(test::eventually([&] { return program.heard().size() == 3; }));
  EXPECT_THAT(program.heard(), ElementsAre("one", "two", "three"));
}

TEST_F(WorkplaceLinkTest, LeavesPlacesForOthersThanWhoAsksAgainAndAgain) {
  WorkplaceLink link("planning", folder / "planning.sock", closing, {.waiting = {.all = 3, .of_person = 2}});
  std::vector<std::future<int>> waiting;
  for (std::size_t i = 1; i <= 2; ++i) {
    // Sessions of one person count as one.
    waiting.push_back(ask(link, session_of("anna")));
    ASSERT_TRUE(test::eventually([&] { return program.heard().size() == i; }));
  }
  EXPECT_EQ(ask(link, session_of("anna")).get(), 503);
  EXPECT_THROW(link.open(request_of("anna", "/api/planning/table"), told), Refusal);
  waiting.push_back(ask(link, session_of("bert")));
  ASSERT_TRUE(test::eventually([&] { return program.heard().size() == 3; }));
  EXPECT_EQ(ask(link, session_of("carla")).get(), 503) << "all places are taken";
  program.release();
  for (std::future<int>& one : waiting) EXPECT_EQ(one.get(), 200);
  EXPECT_EQ(ask(link, session_of("anna")).get(), 200) << "places are given back";
}

TEST_F(WorkplaceLinkTest, TakesAQuestionBackWhoseSessionHasEnded) {
  WorkplaceLink link("planning", folder / "planning.sock", closing, {.to_answer = 1h});
  const std::shared_ptr<Session> session = session_of("anna");
  std::future<int> answer = ask(link, session);
  ASSERT_TRUE(test::eventually([&] { return program.heard().size() == 1; }));
  session->end();
  EXPECT_EQ(answer.get(), 401) << "while the program still thinks";
}

}  // namespace
}  // namespace kiroku::viewer

// Somebody wants through the viewer's address to what is not theirs: in another's name, from another site,
// with another server's cookie, as a guest, past the end of their session. And a program behind the viewer
// that was taken over, by a CT that it read, wants to reach who looks at it. A real viewer, a real program's
// door.
#include <atomic>
#include <condition_variable>
#include <fcntl.h>
#include <filesystem>
#include <fstream>
#include <future>
#include <mutex>
#include <poll.h>
#include <span>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/un.h>
#include <sys/wait.h>
#include <thread>

#include <boost/system/system_error.hpp>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "crypto/encoding.h"
#include "crypto/hash.h"
#include "recorder/daemon/control_server.h"
#include "tests/support/https_client.h"
#include "tests/support/moved_clock.h"
#include "tests/support/socket_client.h"
#include "tests/support/temporary_folder.h"
#include "viewer/api/workplaces.h"
#include "viewer/http/server_certificate.h"
#include "viewer/server/inner_door.h"
#include "viewer/viewer.h"

namespace kiroku::viewer {
namespace {

using nlohmann::json;
using test::HttpResponse;
using test::SocketClient;
using testing::HasSubstr;
using testing::Not;
using testing::StartsWith;

constexpr const char* kPassword = "correct horse battery";

crypto::Secret quickly_hashed(const crypto::Secret& password, ByteView salt, int /*cost*/) {
  std::string text(password.text());
  for (const std::byte byte : salt) text += static_cast<char>(byte);
  return crypto::Secret::copy_of(std::string_view(crypto::to_hex(crypto::sha256(bytes_of(text)))));
}

/// Says who asks, and lets go of nobody by itself.
class Echo final : public SocketHandler {
 public:
  Echo(std::string user, std::shared_ptr<SocketOutput> output, std::promise<void>* gone,
       std::shared_future<void> stalls)
      : user_(std::move(user)), output_(std::move(output)), gone_(gone), stalls_(std::move(stalls)) {}
  ~Echo() override {
    if (gone_ != nullptr) gone_->set_value();
  }
  Echo(const Echo&) = delete;
  Echo& operator=(const Echo&) = delete;
  void receive(const SocketMessage& message) override {
    const std::string text(text_of(message.bytes));
    if (text == "stall" && stalls_.valid()) stalls_.wait();
    if (text == "refuse") throw Refusal(409, "this plan is open already");
    output_->send_text(user_ + " said " + text);
  }

 private:
  std::string user_;
  std::shared_ptr<SocketOutput> output_;
  std::promise<void>* gone_;
  std::shared_future<void> stalls_;
};

class EntranceAttack : public testing::Test {
 protected:
  EntranceAttack() {
    std::filesystem::create_directory(home / "archive");
    const auto users = UserStore::open(home / "users.sqlite", quickly_hashed);
    for (const auto& [name, role] : {std::pair{"anna", Role::kSurgeon},
                                     {"ben", Role::kSurgeon},
                                     {"otto", Role::kOperator},
                                     {"audit", Role::kAuditor},
                                     {"root", Role::kAdministrator}}) {
      users->add(name, role, crypto::Secret::copy_of(std::string_view(kPassword)));
    }
    viewer.emplace(options_of("cases", "127.0.0.1:0"));
  }

  ViewerOptions options_of(const std::string& serves, const std::string& listen) {
    bool made = false;
    ServerCertificate certificate = own_certificate(home.path(), {"127.0.0.1"}, made);
    ViewerOptions options{.home = {.archive = home / "archive",
                                   .catalogue_file = home / "catalogue.sqlite",
                                   .log_folder = home / "archive/log",
                                   .users_file = home / "users.sqlite",
                                   .control_socket = home / "control.sock",
                                   .copies_folder = home / ("copies-" + serves),
                                   .handout_folder = home / ("files-" + serves),
                                   .planning_socket = home / "planning.sock",
                                   .training_socket = home / "training.sock",
                                   .device_key = &key,
                                   .device = crypto::VerifierKey("or-3", key.public_key()),
                                   .trust = &trust,
                                   .identities = nullptr,
                                   .password_hasher = quickly_hashed},
                          .web = {.listen = listen,
                                  .certificate_pem = std::move(certificate.certificate_pem),
                                  .key_pem = std::move(certificate.key_pem),
                                  .limits = {}},
                          .sessions = {},
                          .page = {},
                          .tell = [](const std::string& /*sentence*/) {}};
    options.home.serves = serves;
    return options;
  }
  /// A program behind the viewer whose routes say who asks; with `listen` also at an address of its own.
  void start_planning(const std::string& listen = "") {
    ViewerOptions options = options_of("planning", listen);
    options.more_routes = [this](Router& router, ViewerContext& /*context*/) {
      router.add("GET", "api/planning/plans", Right::kPlan, [](const Request& request) {
        return Response::json({{"user", request.session->user()},
                               {"role", role_name(request.session->role())},
                               {"peer", request.peer},
                               {"cookie", std::string(request.header("cookie"))}});
      });
      Route table;
      table.method = "GET";
      table.pattern = "api/planning/table";
      table.right = Right::kPlan;
      table.socket = [this](const Request& request, std::shared_ptr<SocketOutput> output) {
        return std::make_unique<Echo>(request.session->user(), std::move(output), gone, stalls);
      };
      router.add(std::move(table));
    };
    planning.emplace(std::move(options));
  }

  static HttpResponse ask(const Viewer& at, const std::string& method, const std::string& target,
                          const std::string& cookie, std::map<std::string, std::string> headers = {},
                          const std::string& body = "") {
    if (!cookie.empty()) headers["Cookie"] = cookie;
    return test::ask_once(at.port(), test::http_request(method, target, headers, body));
  }
  HttpResponse get(const std::string& target, const std::string& cookie,
                   std::map<std::string, std::string> headers = {}) {
    return ask(*viewer, "GET", target, cookie, std::move(headers));
  }
  static std::string sign_in(const Viewer& at, const std::string& user) {
    const HttpResponse answer =
        ask(at, "POST", "/api/session", "", {}, json{{"user", user}, {"password", kPassword}}.dump());
    EXPECT_EQ(answer.status, 200) << answer.body;
    // The last one of the two that are set.
    const std::string& cookie = answer.headers.at("set-cookie");
    const std::size_t begin = cookie.rfind("__Host-kiroku");
    return cookie.substr(begin, cookie.find(';', begin) - begin);
  }
  std::unique_ptr<SocketClient> connect(const std::string& cookie, const std::string& origin = "") {
    return std::make_unique<SocketClient>(
        viewer->port(), "/api/planning/table", cookie,
        origin.empty() ? "https://127.0.0.1:" + std::to_string(viewer->port()) : origin);
  }
  static std::string said(SocketClient& client) {
    const auto message = client.receive();
    return message ? std::string(text_of(message->bytes)) : "nothing";
  }

  test::TemporaryFolder home;
  crypto::SigningKey key = crypto::SigningKey::generate();
  timestamp::TrustStore trust;
  std::promise<void>* gone = nullptr;
  std::shared_future<void> stalls;  // by which whoever says "stall" is read no further
  std::optional<Viewer> viewer, planning;
};

TEST_F(EntranceAttack, ANameInTheRequestIsNobodysName) {
  start_planning("127.0.0.1:0");
  const std::map<std::string, std::string> forged{
      {"X-Kiroku-User", "root"}, {"X-Kiroku-Role", "administrator"}, {"X-Kiroku-Address", "10.0.0.1"}};
  EXPECT_EQ(get("/api/planning/plans", "", forged).status, 401);
  EXPECT_EQ(ask(*planning, "GET", "/api/planning/plans", "", forged).status, 401)
      << "these fields count at the inner door alone";
  const json answer = json::parse(get("/api/planning/plans", sign_in(*viewer, "anna"), forged).body);
  EXPECT_EQ(answer["user"], "anna");
  EXPECT_EQ(answer["role"], "surgeon");
  EXPECT_EQ(answer["peer"], "127.0.0.1") << "the address that the appliance log will name";
  EXPECT_EQ(answer["cookie"], "") << "a program behind the viewer never sees the session's token";
}

TEST_F(EntranceAttack, WhoMayNotIsRefusedBeforeTheProgramHearsOfIt) {
  start_planning();
  for (const char* user : {"otto", "audit"}) {
    const std::string cookie = sign_in(*viewer, user);
    EXPECT_EQ(get("/api/planning/plans", cookie).status, 403) << user;
    EXPECT_THROW(connect(cookie), boost::system::system_error) << user;
    EXPECT_THAT(get("/api/workplaces", cookie).body, HasSubstr(R"("planning","state":"no-right")"));
  }
  EXPECT_EQ(get("/api/workplaces", "").status, 401);
  EXPECT_EQ(get("/api/training", sign_in(*viewer, "otto")).status, 503) << "may train, but nothing answers";
}

// A recorder's control socket, whose room records or not.
TEST_F(EntranceAttack, RefusedRequestsFillNoLog) {
  const auto entries = [&](const std::string& what) {
    std::ifstream log(home / "archive/log/ledger.jsonl");
    std::size_t count = 0;
    for (std::string line; std::getline(log, line);) count += line.find(what) != std::string::npos ? 1U : 0U;
    return count;
  };
  std::atomic<bool> is_recording = true, can_start = false;
  std::atomic<std::size_t> entered_at_start = 0;
  const recorder::ControlServer recorder(home / "control.sock", [&](const json& question) {
    const std::string state = is_recording ? "recording" : "idle";
    if (question.at("do") == "status")
      return nlohmann::ordered_json{
          {"rooms", nlohmann::ordered_json::array({{{"room", "or-1"}, {"state", state}}})}};
    if (!can_start) throw UsageError("the camera cannot be opened");
    entered_at_start = entries("asked to start recording in or-1");
    is_recording = true;
    return nlohmann::ordered_json{{"room", "or-1"}, {"case", "c"}};
  });
  const std::string otto = sign_in(*viewer, "otto"), anna = sign_in(*viewer, "anna");
  const auto post = [&](const std::string& what, const std::string& who, const std::string& body = "") {
    return ask(*viewer, "POST", "/api/rooms/" + what, who, {}, body);
  };

  const HttpResponse refused = post("or-1/start", otto);
  EXPECT_EQ(refused.status, 409);
  EXPECT_THAT(refused.body, HasSubstr("room or-1 is recording already"));
  EXPECT_EQ(post("or-2/stop", otto).status, 409);
  is_recording = false;
  EXPECT_EQ(post("or-1/stop", otto).status, 409);
  EXPECT_THAT(post("or-1/mark", otto, R"({"text":"x"})").body, HasSubstr("room or-1 is not recording"));
  EXPECT_EQ(entries("asked to") + entries("marked"), 0U) << "what the room's state forbids is not entered";

  // What only the trying shows is entered; who is refused again and again waits.
  std::size_t told_to_wait = 0;
  for (int i = 0; i < 60; ++i) told_to_wait += post("or-1/start", otto).status == 429 ? 1U : 0U;
  EXPECT_GE(told_to_wait, 20U);
  EXPECT_LE(entries("asked to start"), 40U);
  EXPECT_GE(entries("asked to start"), 1U);

  // Others are not kept from recording, and are in the log before it begins.
  can_start = true;
  const std::size_t before = entries("asked to start");
  EXPECT_EQ(post("or-1/start", anna).status, 200);
  EXPECT_EQ(entered_at_start, before + 1);
}

// Somebody began a dialog in one case and presses its button in the next: nothing of the one gets into the
// other.
TEST_F(EntranceAttack, WhatWasPreparedInOneCaseReachesNoOther) {
  const std::string earlier = "20261128T080000Z-0000000a", later = "20261128T090000Z-0000000b";
  json room{{"room", "or-1"}, {"state", "recording"}, {"case", later}};
  std::vector<json> done;
  // The recorder's own answer where the room goes on between the viewer's look and the deed.
  std::string refuses;
  const recorder::ControlServer recorder(home / "control.sock", [&](const json& question) {
    if (question.at("do") == "status")
      return nlohmann::ordered_json{{"rooms", nlohmann::ordered_json::array({room})}};
    if (!refuses.empty()) throw UsageError(refuses);
    done.push_back(question);
    return nlohmann::ordered_json{{"room", "or-1"}, {"case", question.value("case", "")}};
  });
  const auto entered = [&] {
    std::ifstream log(home / "archive/log/ledger.jsonl");
    std::string all(std::istreambuf_iterator<char>(log), {});
    return all.find("or-1") != std::string::npos;
  };
  const std::string otto = sign_in(*viewer, "otto");
  const std::vector<std::pair<std::string, json>> deeds{
      {"subject", {{"subject", {{"patient", {{"id", "A1"}}}}}}},
      {"stop", json::object()},
      {"mark", {{"text", "clip"}}},
      {"profile", {{"profile", "lossless"}}}};
  const auto post = [&](const std::string& deed, json body, const json& meant) {
    body["case"] = meant;
    return ask(*viewer, "POST", "/api/rooms/or-1/" + deed, otto, {}, body.dump());
  };
  for (const auto& [deed, body] : deeds) {
    const HttpResponse refused = post(deed, body, earlier);
    EXPECT_EQ(refused.status, 409) << deed;
    EXPECT_THAT(refused.body, HasSubstr("room or-1 is recording case " + later + ", and not case " + earlier +
                                        ": nothing was done"))
        << deed;
    EXPECT_EQ(post(deed, body, "whichever").status, 400) << deed;
    EXPECT_EQ(post(deed, body, nullptr).status, 400) << deed;
  }
  EXPECT_EQ(post("start", json::object(), later).status, 400) << "a start never becomes anything else";
  room["case"] = earlier;
  room["state"] = "idle";
  for (const auto& [deed, body] : deeds) {
    const HttpResponse refused = post(deed, body, earlier);
    EXPECT_EQ(refused.status, 409) << deed;
    EXPECT_THAT(refused.body, HasSubstr("room or-1 is not recording case " + earlier + ": nothing was done"));
  }
  EXPECT_TRUE(done.empty());
  EXPECT_FALSE(entered()) << "what came to nothing fills no log";

  room["tries_again"] = true;
  EXPECT_EQ(post("stop", json::object(), earlier).status, 200) << "the operation that goes on by itself";
  room = {{"room", "or-1"}, {"state", "recording"}, {"case", later}};
  for (const auto& [deed, body] : deeds) EXPECT_EQ(post(deed, body, later).status, 200) << deed;
  EXPECT_EQ(done.size(), 5U);
  for (const json& question : done) EXPECT_TRUE(question.contains("case")) << question;
  EXPECT_TRUE(entered());
  refuses = "room or-1 is not recording case " + later + ": nothing was done";
  const HttpResponse late = post("mark", {{"text", "clip"}}, later);
  EXPECT_EQ(late.status, 409);
  EXPECT_THAT(late.body, HasSubstr(refuses));
}

// Each is signed, flushed, and stays for good: nobody writes without end what everybody's log must carry.
TEST_F(EntranceAttack, DeedsThatSucceedAgainAndAgainFillNoLog) {
  const auto entries = [&](const std::string& what) {
    std::ifstream log(home / "archive/log/ledger.jsonl");
    std::size_t count = 0;
    for (std::string line; std::getline(log, line);) count += line.find(what) != std::string::npos ? 1U : 0U;
    return count;
  };
  std::atomic<bool> is_recording = true;
  std::atomic<std::size_t> marks = 0;
  const recorder::ControlServer recorder(home / "control.sock", [&](const json& question) {
    const std::string state = is_recording ? "recording" : "idle";
    if (question.at("do") == "status")
      return nlohmann::ordered_json{
          {"rooms", nlohmann::ordered_json::array({{{"room", "or-1"}, {"state", state}}})}};
    if (question.at("do") == "mark") ++marks;
    if (question.at("do") == "stop") is_recording = false;
    return nlohmann::ordered_json{{"room", "or-1"}, {"case", "c"}};
  });
  test::MovedClock clock;
  ViewerOptions options = options_of("cases", "127.0.0.1:0");
  options.home.clock = &clock;
  viewer.reset();
  viewer.emplace(std::move(options));
  const std::string otto = sign_in(*viewer, "otto"), anna = sign_in(*viewer, "anna");
  const auto mark = [&](const std::string& who) {
    return ask(*viewer, "POST", "/api/rooms/or-1/mark", who, {}, R"({"text":"x"})");
  };
  std::size_t told_to_wait = 0;
  for (int i = 0; i < 150; ++i) told_to_wait += mark(otto).status == 429 ? 1U : 0U;
  EXPECT_EQ(told_to_wait, 30U);
  EXPECT_EQ(marks, 120U) << "the case is not filled either";
  EXPECT_EQ(entries("marked a moment in or-1"), 120U);
  const HttpResponse refused = mark(otto);
  EXPECT_THAT(refused.body, HasSubstr("more was done than the appliance log takes of one person at a time"));
  EXPECT_EQ(refused.headers.at("retry-after"), "1");
  EXPECT_EQ(mark(anna).status, 200) << "nobody waits for another";
  clock.move(std::chrono::seconds(5));
  for (int i = 0; i < 10; ++i) EXPECT_EQ(mark(otto).status, 200);
  EXPECT_EQ(mark(otto).status, 429);
  EXPECT_EQ(ask(*viewer, "POST", "/api/rooms/or-1/stop", otto, {}).status, 200)
      << "nobody is kept from ending a recording";
  viewer.reset();  // before its clock
}

TEST_F(EntranceAttack, AGuestIsLedNowhere) {
  for (const auto& routes :
       {std::span<const WorkplaceRoute>(kPlanningRoutes), std::span<const WorkplaceRoute>(kBreathingRoutes),
        std::span<const WorkplaceRoute>(kTrainingRoutes)}) {
    for (const WorkplaceRoute& route : routes) EXPECT_FALSE(may(Role::kGuest, route.right)) << route.pattern;
  }
}

TEST_F(EntranceAttack, AnotherSiteReachesNothing) {
  start_planning();
  const std::string cookie = sign_in(*viewer, "anna");
  for (const char* origin : {"https://evil.example", "null", "https://127.0.0.1:1"}) {
    EXPECT_EQ(get("/api/planning/plans", cookie, {{"Origin", origin}}).status, 403) << origin;
    EXPECT_THROW(connect(cookie, origin), boost::system::system_error) << origin;
  }
  EXPECT_EQ(get("/api/planning/plans", cookie, {{"Sec-Fetch-Site", "cross-site"}}).status, 403);
  EXPECT_EQ(ask(*viewer, "POST", "/api/training/trainees", cookie, {{"X-Kiroku-Request", ""}}, "{}").status,
            403);
}

TEST_F(EntranceAttack, ServersOfOneHostDoNotTakeEachOthersCookies) {
  start_planning("127.0.0.1:0");
  const std::string of_viewer = sign_in(*viewer, "anna"), of_planning = sign_in(*planning, "anna");
  EXPECT_THAT(of_viewer, StartsWith("__Host-kiroku="));
  EXPECT_THAT(of_planning, StartsWith("__Host-kiroku-planning="));
  // A browser sends both to both: cookies know no port.
  const std::string both = of_planning + "; " + of_viewer;
  EXPECT_EQ(get("/api/session", both).status, 200);
  EXPECT_EQ(ask(*planning, "GET", "/api/session", both).status, 200);
  const std::string token = of_planning.substr(of_planning.find('=') + 1);
  EXPECT_EQ(get("/api/session", "__Host-kiroku=" + token).status, 401) << "another server's session";
  EXPECT_EQ(ask(*planning, "DELETE", "/api/session", both).status, 204);
  EXPECT_EQ(get("/api/session", both).status, 200) << "signed out there alone";
}

TEST_F(EntranceAttack, TheInnerDoorLeadsToWhatItsProgramAddsAndNothingElse) {
  start_planning();
  const auto through_the_door = [&](const std::string& target) {
    const std::optional<Descriptor> socket = knock(home / "planning.sock");
    if (!socket) return std::string("nobody");
    ::fcntl(socket->number(), F_SETFL, 0);
    const std::string request = "GET " + target +
                                " HTTP/1.1\r\nHost: kiroku\r\nConnection: close\r\nX-Kiroku-User: root\r\n"
                                "X-Kiroku-Role: administrator\r\nX-Kiroku-Address: 192.0.2.1\r\n\r\n";
    EXPECT_EQ(::send(socket->number(), request.data(), request.size(), MSG_NOSIGNAL),
              static_cast<ssize_t>(request.size()));
    std::string answer(4096, '\0');
    const ssize_t count = ::recv(socket->number(), answer.data(), answer.size(), 0);
    answer.resize(static_cast<std::size_t>(std::max<ssize_t>(count, 0)));
    return answer.substr(0, 12);
  };
  EXPECT_EQ(through_the_door("/api/planning/plans"), "HTTP/1.1 200");
  for (const char* target : {"/api/session", "/api/users", "/api/log", "/api/cases", "/", "/index.html"})
    EXPECT_EQ(through_the_door(target), "HTTP/1.1 404") << target;
}

TEST_F(EntranceAttack, AnotherUserOfTheMachineIsLetGo) {
  if (::geteuid() != 0) GTEST_SKIP() << "only root can become somebody else";
  start_planning();
  struct stat file {};
  ASSERT_EQ(::stat((home / "planning.sock").c_str(), &file), 0);
  EXPECT_EQ(file.st_mode & 0777U, 0600U);
  // As if folder and socket had been opened to everybody: the kernel still says who comes.
  for (auto folder = home.path(); folder != folder.root_path(); folder = folder.parent_path()) {
    if (::stat(folder.c_str(), &file) == 0 && folder != "/tmp") ::chmod(folder.c_str(), 0755);
  }
  ::chmod((home / "planning.sock").c_str(), 0777);
  sockaddr_un address{};
  address.sun_family = AF_UNIX;
  (home / "planning.sock").string().copy(address.sun_path, sizeof address.sun_path - 1);
  const pid_t other = ::fork();
  if (other == 0) {
    constexpr uid_t kNobody = 65534;
    if (::setuid(kNobody) != 0) ::_exit(2);
    const int socket = ::socket(AF_UNIX, SOCK_STREAM, 0);
    if (::connect(socket, reinterpret_cast<const sockaddr*>(&address), sizeof address) != 0) ::_exit(3);
    constexpr std::string_view kRequest =
        "GET /api/planning/plans HTTP/1.1\r\nHost: kiroku\r\nX-Kiroku-User: root\r\nX-Kiroku-Role: "
        "administrator\r\n\r\n";
    static_cast<void>(::send(socket, kRequest.data(), kRequest.size(), MSG_NOSIGNAL));
    char answer = 0;
    ::_exit(::recv(socket, &answer, 1, 0) > 0 ? 1 : 0);
  }
  int status = 0;
  ASSERT_EQ(::waitpid(other, &status, 0), other);
  EXPECT_EQ(WEXITSTATUS(status), 0) << "1: it was answered; 2, 3: it could not try";
  EXPECT_EQ(get("/api/planning/plans", sign_in(*viewer, "anna")).status, 200);
}

TEST_F(EntranceAttack, NothingGoesOnPastTheEndOfASession) {
  std::promise<void> over;
  gone = &over;
  start_planning();
  const std::string cookie = sign_in(*viewer, "anna");
  const auto client = connect(cookie);
  client->send_text("here");
  EXPECT_EQ(said(*client), "anna said here");
  EXPECT_EQ(ask(*viewer, "DELETE", "/api/session", cookie).status, 204);
  EXPECT_EQ(over.get_future().wait_for(std::chrono::seconds(60)), std::future_status::ready)
      << "the program behind hears of it too";
  EXPECT_FALSE(client->receive().has_value());
  EXPECT_EQ(client->farewell().second, "the session has ended");
  EXPECT_THROW(connect(cookie), boost::system::system_error) << "the same cookie again";
}

TEST_F(EntranceAttack, WhatTheProgramRefusesIsToldAndItsEndTooAndItCanComeBack) {
  start_planning();
  const std::string cookie = sign_in(*viewer, "anna");
  auto client = connect(cookie);
  client->send_text("refuse");
  EXPECT_FALSE(client->receive().has_value());
  EXPECT_EQ(client->farewell(), (std::pair{1008, std::string("this plan is open already")}));
  client = connect(cookie);
  client->send_text("here");
  EXPECT_EQ(said(*client), "anna said here");
  planning.reset();
  EXPECT_FALSE(client->receive().has_value());
  EXPECT_THAT(client->farewell().second, HasSubstr("has ended"));
  EXPECT_EQ(get("/api/planning/plans", cookie).status, 503);
  EXPECT_THAT(get("/api/workplaces", cookie).body, HasSubstr(R"("planning","state":"not-)"));
  start_planning();
  EXPECT_EQ(get("/api/planning/plans", cookie).status, 200);
}

TEST_F(EntranceAttack, OneProgramOfAKindIsBehindAHomesViewer) {
  start_planning();
  EXPECT_THROW(InnerDoor(home / "planning.sock"), Error);
  EXPECT_THROW(InnerDoor(home / std::string(120, 'x')), UsageError);
  EXPECT_EQ(get("/api/planning/plans", sign_in(*viewer, "anna")).status, 200) << "and it is still there";
}

/// A program that was taken over: answers every request at its door with these bytes, or hangs.
class TakenOver {
 public:
  TakenOver(const std::filesystem::path& socket, std::string answer)
      : door_(socket),
        listener_(door_.take_listener()),
        answer_(std::move(answer)),
        thread_([this] { run(); }) {}
  ~TakenOver() {
    ::shutdown(listener_.number(), SHUT_RDWR);
    thread_.join();
  }
  TakenOver(const TakenOver&) = delete;
  TakenOver& operator=(const TakenOver&) = delete;

  static constexpr const char* kHangs = "hangs";
  /// Waits until whoever hangs longest has been let go by the viewer.
  bool is_let_go() {
    const int socket = [this] {
      const std::lock_guard guard(mutex_);
      return hanging_.front().number();
    }();
    pollfd ended{socket, POLLRDHUP, 0};
    return ::poll(&ended, 1, 60'000) == 1;
  }
  /// Waits until so many of those who asked hang.
  bool wait_for(std::size_t hanging) {
    std::unique_lock lock(mutex_);
    return changed_.wait_for(lock, std::chrono::seconds(60), [&] { return hanging_.size() >= hanging; });
  }

 private:
  void run() {
    for (;;) {
      Descriptor peer(::accept(listener_.number(), nullptr, nullptr));
      if (!peer) return;
      std::string request;
      char some[4096];
      while (request.find("\r\n\r\n") == std::string::npos) {
        const ssize_t count = ::recv(peer.number(), some, sizeof some, 0);
        if (count <= 0) break;
        request.append(some, static_cast<std::size_t>(count));
      }
      if (answer_ == kHangs) {
        const std::lock_guard guard(mutex_);
        hanging_.push_back(std::move(peer));
        changed_.notify_all();
        continue;
      }
      if (!request.empty())
        static_cast<void>(::send(peer.number(), answer_.data(), answer_.size(), MSG_NOSIGNAL));
    }
  }
  InnerDoor door_;
  Descriptor listener_;
  const std::string answer_;
  std::mutex mutex_;
  std::condition_variable changed_;
  std::vector<Descriptor> hanging_;
  std::thread thread_;
};

std::string http_answer(const std::string& status, const std::string& fields, const std::string& body) {
  return "HTTP/1.1 " + status + "\r\n" + fields + "Content-Length: " + std::to_string(body.size()) +
         "\r\n\r\n" + body;
}

TEST_F(EntranceAttack, AProgramThatWasTakenOverCanSendNoPageNoCookieNoRedirectAndNobodyAway) {
  const std::string cookie = sign_in(*viewer, "anna");
  const std::string script = "<script src=/api/planning/plans></script>";
  struct Try {
    const char* what;
    std::string answer;
  };
  for (const Try& one : std::vector<Try>{
           {"a page", http_answer("200 OK", "Content-Type: text/html\r\n", script)},
           {"a script", http_answer("200 OK", "Content-Type: text/javascript\r\n", "alert(1)")},
           {"a page as an error", http_answer("404 Not Found", "Content-Type: text/html\r\n", script)},
           {"a page by a type that hides another",
            http_answer("200 OK", "Content-Type: application/json, text/html\r\n", script)},
           {"no type", http_answer("200 OK", "", script)},
           {"another address", http_answer("302 Found", "Location: https://evil.example/\r\n", "")},
           {"a session's end", http_answer("401 Unauthorized", "Content-Type: application/json\r\n",
                                           R"({"error":"sign in first"})")},
           {"more than fits", http_answer("200 OK", "Content-Type: application/json\r\n",
                                          std::string(std::size_t{17} << 20, ' '))},
           {"less than it says",
            "HTTP/1.1 200 OK\r\nContent-Type: application/json\r\nContent-Length: 99\r\n\r\n{}"},
           {"no HTTP", "nonsense\r\n\r\n"},
           {"nothing", ""}}) {
    const TakenOver program(home / "planning.sock", one.answer);
    const HttpResponse answer = get("/api/planning/plans", cookie);
    EXPECT_EQ(answer.status, 502) << one.what << ": " << answer.body.substr(0, 200);
    EXPECT_EQ(answer.headers.at("content-type"), "application/json") << one.what;
    EXPECT_THAT(answer.body, Not(HasSubstr("script"))) << one.what;
    EXPECT_FALSE(answer.headers.contains("location")) << one.what;
    EXPECT_THROW(connect(cookie), boost::system::system_error) << one.what;
  }
  const TakenOver program(
      home / "planning.sock",
      http_answer("200 OK",
                  "Content-Type: application/json\r\nSet-Cookie: __Host-kiroku=mine; Path=/; "
                  "Secure\r\nContent-Security-Policy: default-src *\r\nX-Own: 1\r\n",
                  "{}"));
  const HttpResponse answer = get("/api/planning/plans", cookie);
  EXPECT_EQ(answer.status, 200);
  EXPECT_FALSE(answer.headers.contains("set-cookie"));
  EXPECT_FALSE(answer.headers.contains("x-own"));
  EXPECT_THAT(answer.headers.at("content-security-policy"), StartsWith("default-src 'self'"));
  EXPECT_EQ(answer.headers.at("x-content-type-options"), "nosniff");
}

TEST_F(EntranceAttack, AProgramThatHangsDoesNotHangTheViewer) {
  TakenOver program(home / "planning.sock", TakenOver::kHangs);
  const std::string cookie = sign_in(*viewer, "anna");
  std::vector<std::future<int>> waiting;
  std::size_t hanging = 0;
  for (const char* user : {"anna", "ben", "root"}) {
    const std::string own = sign_in(*viewer, user);
    for (int i = 0; i < 2; ++i) {
      waiting.push_back(
          std::async(std::launch::async, [this, own] { return get("/api/planning/plans", own).status; }));
    }
    hanging += 2;
    ASSERT_TRUE(program.wait_for(hanging));
    EXPECT_EQ(get("/api/planning/plans", own).status, 503) << "one user leaves places for others";
  }
  for (int i = 0; i < 20; ++i) {
    EXPECT_EQ(get("/api/planning/plans", cookie).status, 503) << "each would hold a thread of the viewer";
    EXPECT_THROW(connect(cookie), boost::system::system_error);
    EXPECT_EQ(get("/api/cases", cookie).status, 200);
  }
  viewer.reset();
  for (std::future<int>& one : waiting) EXPECT_NE(one.get(), 200) << "nobody waits past the viewer's end";
}

TEST_F(EntranceAttack, ARequestThatWasPassedOnEndsWithItsSession) {
  TakenOver program(home / "planning.sock", TakenOver::kHangs);
  const std::string cookie = sign_in(*viewer, "anna");
  std::future<int> answer =
      std::async(std::launch::async, [&] { return get("/api/planning/plans", cookie).status; });
  ASSERT_TRUE(program.wait_for(1));
  EXPECT_EQ(ask(*viewer, "DELETE", "/api/session", cookie).status, 204);
  EXPECT_EQ(answer.get(), 401);
  EXPECT_TRUE(program.is_let_go()) << "the program hears of it too";
}

TEST_F(EntranceAttack, AProgramThatReadsNothingTakesNoThreadOfTheViewer) {
  std::promise<void> released;
  stalls = released.get_future().share();
  start_planning();
  const std::string cookie = sign_in(*viewer, "anna");
  std::vector<std::unique_ptr<SocketClient>> clients;
  const std::string much(60'000, 'x');
  for (int i = 0; i < 20; ++i) clients.push_back(connect(cookie));
  for (const auto& client : clients) {
    client->send_text("stall");
    // More than lies between two programs, and less than the viewer keeps for one browser.
    for (int message = 0; message < 16; ++message) client->send_text(much);
  }
  EXPECT_EQ(get("/api/cases", cookie).status, 200);
  for (const auto& client : clients) {
    EXPECT_FALSE(client->receive(std::chrono::seconds(60)).has_value());
    EXPECT_THAT(client->farewell().second, HasSubstr("takes nothing of what is sent"));
  }
  released.set_value();
}

// A session ends soon after its user was removed by another program, whether anybody asks or not.
TEST_F(EntranceAttack, WhoWasRemovedIsSweptOutByTheViewersClock) {
  test::MovedClock clock;
  viewer.reset();
  ViewerOptions options = options_of("cases", "127.0.0.1:0");
  options.home.clock = &clock;
  viewer.emplace(std::move(options));
  const std::string anna = sign_in(*viewer, "anna"), ben = sign_in(*viewer, "ben");
  UserStore::open(home / "users.sqlite", quickly_hashed)->remove("anna");
  // Who looks after sessions, and who after viewing copies.
  clock.await_waiting(2);
  EXPECT_EQ(get("/api/cases", anna).status, 200) << "nobody has looked yet";
  clock.move(std::chrono::seconds(5));
  clock.await_waiting(2);
  EXPECT_EQ(get("/api/cases", anna).status, 401);
  EXPECT_EQ(get("/api/cases", ben).status, 200);
  viewer.reset();
}

TEST_F(EntranceAttack, ADoorIsTakenAwayByNobodyButWhoseItIs) {
  const std::filesystem::path socket = home / "planning.sock";
  std::optional<InnerDoor> ending(std::in_place, socket);
  // Its program is about to end: nobody answers any more.
  { const Descriptor listener = ending->take_listener(); }
  EXPECT_FALSE(knock(socket));
  EXPECT_THROW(InnerDoor{socket}, Error) << "it would be taken away from whoever comes now";
  ending.reset();
  InnerDoor next(socket);
  const Descriptor listener = next.take_listener();
  EXPECT_TRUE(knock(socket));
}

TEST_F(EntranceAttack, ATargetCarriesNoSecondRequest) {
  start_planning();
  const std::string cookie = sign_in(*viewer, "anna");
  for (const char* target :
       {"/api/planning/plans%0d%0aX-Kiroku-User:%20root", "/api/planning/plans%20HTTP/1.1",
        "/api/planning/../users", "/api/planning/%2e%2e/users", "/api/planning%2fplans",
        "//api/planning/plans", "/api/planning/plans/"}) {
    const int status = get(target, cookie).status;
    EXPECT_TRUE(status == 400 || status == 404) << target << ": " << status;
  }
}

}  // namespace
}  // namespace kiroku::viewer

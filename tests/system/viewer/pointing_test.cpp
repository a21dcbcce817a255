// Pointing through a real kirokud: shown to the room, kept in the case, and harmless whatever is sent.
#include <algorithm>
#include <thread>

#include <boost/system/system_error.hpp>

#include "tests/support/build_paths.h"
#include "tests/support/eventually.h"
#include "tests/support/reserved_port.h"
#include "tests/support/socket_client.h"
#include "tests/system/viewer/served_home.h"

namespace kiroku::test {
namespace {

using namespace std::chrono_literals;
using nlohmann::json;
using testing::HasSubstr;

class Pointing : public ServedHome {
 protected:
  void SetUp() override {
    make_demo_home();
    port_ = reserved_port();
    write_text(home() / "kiroku.toml", read_text(home() / "kiroku.toml") + R"(
[[room]]
name = "or-1"
[[room.stream]]
name = "endoscope"
source = "synthetic:endoscope?size=320x240&rate=10"
[daemon]
socket = ")" + path("s") + R"("
[viewer]
listen = "127.0.0.1:)" + std::to_string(port_) +
                                           "\"\n");
    ASSERT_NO_FATAL_FAILURE(add_users());
    Process::Options started = options({});
    started.command = {built_file("kirokud")};
    server_.emplace(started);
    ASSERT_TRUE(server_->wait_for("recording for 1 room"));
  }
  [[nodiscard]] std::unique_ptr<SocketClient> look_on(const std::string& cookie) const {
    return std::make_unique<SocketClient>(port_, "/api/live/or-1", cookie,
                                          "https://127.0.0.1:" + std::to_string(port_));
  }
  [[nodiscard]] std::string guest(const std::string& inviter) const {
    const HttpResponse made = ask("POST", "/api/invitations", inviter,
                                  json{{"guest", "Dr. Sato"}, {"room", "or-1"}, {"minutes", 60}}.dump());
    return cookie_of(
        ask("POST", "/api/session", "", json{{"invitation", json::parse(made.body)["token"]}}.dump()));
  }
  /// The next message with this key.
  static json next(SocketClient& socket, const std::string& key) {
    for (;;) {
      const auto message = socket.receive();
      if (!message) return {};
      json said = json::parse(text_of(message->bytes));
      if (said.contains(key)) return said[key];
    }
  }
  static std::string point(double x, double y, const std::string& stream = "endoscope") {
    return json{{"stream", stream}, {"x", x}, {"y", y}, {"picture_ns", 1000}}.dump();
  }
};

TEST_F(Pointing, IsSeenByTheRoomAndStandsInTheCase) {
  const std::string surgeon = sign_in("a-surgeon");
  case_id_ = kiroku_json({"case", "start", "--json"})["case"];
  const auto anna = look_on(surgeon);
  EXPECT_EQ(next(*anna, "watchers"), json::parse(R"([{"name":"a-surgeon","role":"surgeon"}])"));
  const auto sato = look_on(guest(surgeon));
  const json both =
      json::parse(R"([{"name":"a-surgeon","role":"surgeon"},{"name":"Dr. Sato","role":"guest"}])");
  EXPECT_EQ(next(*anna, "watchers"), both);
  EXPECT_EQ(next(*sato, "watchers"), both);

  std::vector<json> seen;
  for (int i = 0; i < 20; ++i) {
    (i % 2 == 0 ? sato : anna)->send_text(point(i / 20.0, 0.25));
    const json pointer = next(*anna, "pointer");
    EXPECT_EQ(next(*sato, "pointer"), pointer) << "the same for everybody";
    EXPECT_EQ(pointer["by"], i % 2 == 0 ? "Dr. Sato" : "a-surgeon");
    EXPECT_EQ(pointer["role"], i % 2 == 0 ? "guest" : "surgeon");
    EXPECT_EQ(pointer["x"], i / 20.0);
    seen.push_back(pointer);
  }
  sato->close();
  EXPECT_EQ(next(*anna, "watchers"), json::parse(R"([{"name":"a-surgeon","role":"surgeon"}])"));
  ASSERT_EQ(kiroku({"case", "stop"}).status, 0);

  ASSERT_EQ(kiroku({"export", case_id_, "--stream", "pointing", "-o", path("p.jsonl")}).status, 0);
  std::istringstream lines(read_text(path("p.jsonl")));
  std::size_t read = 0;
  for (std::string text; std::getline(lines, text); ++read) {
    const json line = json::parse(text);
    ASSERT_LT(read, seen.size());
    for (const auto& [key, value] : seen[read].items()) EXPECT_EQ(line[key], value) << key;
    EXPECT_EQ(line["picture_ns"], 1000);
  }
  EXPECT_EQ(read, seen.size()) << "what was shown, neither more nor less";
  const ProcessResult verified =
      kiroku({"verify", case_id_, "--identity", (home() / "identity.txt").string()});
  EXPECT_EQ(verified.status, 0) << verified.out << verified.err;

  const json strokes = json::parse(ask("GET", case_path("/pointing"), surgeon).body)["strokes"];
  ASSERT_EQ(strokes.size(), 2U);
  EXPECT_EQ(strokes[0]["by"], "Dr. Sato");
  EXPECT_EQ(strokes[0]["points"], 10);
  EXPECT_EQ(strokes[0]["start_ns"], seen.front()["time_ns"]);
  EXPECT_EQ(strokes[1]["end_ns"], seen.back()["time_ns"]);
  const json points = json::parse(
      ask("GET", case_path("/pointing/points?from_ns=0&to_ns=" + seen[5]["time_ns"].dump()), surgeon)
          .body)["points"];
  ASSERT_EQ(points.size(), 5U) << "half open";
  EXPECT_EQ(points[4]["x"], seen[4]["x"]);
  EXPECT_EQ(ask("GET", case_path("/pointing/points?from_ns=0&to_ns=600000000001"), surgeon).status, 400);
  EXPECT_EQ(ask("GET", case_path("/pointing"), sign_in("a-auditor")).status, 403);
  EXPECT_EQ(ask("GET", case_path("/pointing"), sign_in("a-operator")).status, 403);
}

// A hand that is still held down, or a message that was on its way, when the next patient's case began.
TEST_F(Pointing, InOneCaseReachesNoOther) {
  const auto meaning = [](double x, const std::string& meant) {
    json said = json::parse(point(x, 0.5));
    if (!meant.empty()) said["case"] = meant;
    return said.dump();
  };
  const std::string surgeon = sign_in("a-surgeon");
  const std::string earlier = kiroku_json({"case", "start", "--json"})["case"];
  const auto anna = look_on(surgeon);
  anna->send_text(meaning(0.1, earlier));
  EXPECT_EQ(next(*anna, "pointer")["x"], 0.1);
  ASSERT_EQ(kiroku({"case", "stop"}).status, 0);
  case_id_ = kiroku_json({"case", "start", "--json"})["case"];
  anna->send_text(meaning(0.2, earlier));
  anna->send_text(meaning(0.3, case_id_));
  EXPECT_EQ(next(*anna, "pointer")["x"], 0.3) << "the one before was in no case";
  anna->send_text(meaning(0.4, ""));
  EXPECT_EQ(next(*anna, "pointer")["x"], 0.4) << "whichever runs";
  ASSERT_EQ(kiroku({"case", "stop"}).status, 0);
  for (const auto& [id, most] : {std::pair(earlier, 1U), std::pair(case_id_, 2U)}) {
    ASSERT_EQ(kiroku({"export", id, "--stream", "pointing", "-o", path(id + ".jsonl")}).status, 0);
    const std::string lines = read_text(path(id + ".jsonl"));
    EXPECT_EQ(std::ranges::count(lines, '\n'), most) << lines;
  }
}

TEST_F(Pointing, TakesNothingElseAndNoMoreThanAHandPoints) {
  const std::string surgeon = sign_in("a-surgeon");
  case_id_ = kiroku_json({"case", "start", "--json"})["case"];
  for (const std::string& message :
       {std::string("no json"), std::string("[]"), std::string("{}"), point(1.01, 0), point(0, -0.01),
        point(0.5, 0.5, "vitals"), std::string(R"({"stream":"endoscope","x":"0","y":0})"),
        std::string(R"({"stream":"endoscope","x":1e999,"y":0})"),
        std::string(R"({"stream":["endoscope"],"x":0,"y":0})"),
        std::string(R"({"stream":"endoscope","x":0,"y":0,"case":"whichever"})"),
        std::string(R"({"stream":"endoscope","x":0,"y":0,"case":null})"),
        std::string(R"({"stream":"endoscope","x":0,"y":0,"picture_ns":1.5})"),
        std::string(R"({"stream":"endoscope","x":0,"y":0,"picture_ns":-9223372036854775808})"),
        std::string(R"({"stream":"endoscope","x":0,"y":0,"picture_ns":18446744073709551615})")}) {
    const auto socket = look_on(surgeon);
    socket->send_text(message);
    while (socket->receive()) {
    }
    EXPECT_EQ(socket->farewell().first, 1008) << message;
  }
  const auto large = look_on(surgeon);
  large->send_text(R"({"stream":"endoscope","x":0,"y":0,"more":")" + std::string(600, 'x') + "\"}");
  while (large->receive()) {
  }
  EXPECT_EQ(large->farewell().first, 1009);
  const auto flooding = look_on(surgeon);
  flooding->send_bytes(to_bytes(bytes_of(point(0, 0))));
  while (flooding->receive()) {
  }
  EXPECT_EQ(flooding->farewell().first, 1008) << "text alone";

  const auto socket = look_on(surgeon);
  const auto began = std::chrono::steady_clock::now();
  for (int i = 0; i < 3000; ++i) socket->send_text(point(0.5, 0.5));
  socket->close();
  const std::chrono::duration<double> took = std::chrono::steady_clock::now() - began;
  ASSERT_EQ(kiroku({"case", "stop"}).status, 0);
  ASSERT_EQ(kiroku({"export", case_id_, "--stream", "pointing", "-o", path("p.jsonl")}).status, 0);
  const std::string lines = read_text(path("p.jsonl"));
  EXPECT_LE(std::ranges::count(lines, '\n'), 31 + 30 * took.count());
  EXPECT_GE(std::ranges::count(lines, '\n'), 30);
  const json status = kiroku_json({"status", "--json"});
  EXPECT_EQ(status["rooms"][0]["streams"][0]["dropped"], 0) << "the pictures are all there";
}

TEST_F(Pointing, IsOfTheCaseAloneThatSomebodyMaySee) {
  const std::string surgeon = sign_in("a-surgeon");
  const std::string invited = guest(surgeon);
  const auto early = look_on(surgeon);
  early->send_text(point(0.1, 0.1));
  const std::string first = kiroku_json({"case", "start", "--json"})["case"];
  const auto sato = look_on(invited);
  sato->send_text(point(0.2, 0.2));
  EXPECT_EQ(next(*early, "pointer")["x"], 0.2) << "what was pointed at before the case was shown to nobody";
  EXPECT_EQ(next(*sato, "pointer")["x"], 0.2);
  ASSERT_EQ(kiroku({"case", "stop"}).status, 0);
  const std::string second = kiroku_json({"case", "start", "--json"})["case"];
  try {
    sato->send_text(point(0.3, 0.3));
  } catch (const boost::system::system_error&) {
    // Closed already: the invitation has ended.
  }
  early->send_text(point(0.4, 0.4));
  EXPECT_EQ(next(*early, "pointer")["x"], 0.4) << "nothing of a guest in another case";
  EXPECT_TRUE(next(*sato, "pointer").is_null());
  ASSERT_EQ(kiroku({"case", "stop"}).status, 0);
  for (const auto& [id, x] : std::map<std::string, std::string>{{first, "0.2"}, {second, "0.4"}}) {
    ASSERT_EQ(kiroku({"export", id, "--stream", "pointing", "-o", path(id + ".jsonl")}).status, 0);
    const std::string lines = read_text(path(id + ".jsonl"));
    EXPECT_EQ(std::ranges::count(lines, '\n'), 1);
    EXPECT_THAT(lines, HasSubstr("\"x\":" + x));
  }
}

TEST_F(Pointing, OutlivesARecorderThatDies) {
  const std::string surgeon = sign_in("a-surgeon");
  case_id_ = kiroku_json({"case", "start", "--json"})["case"];
  ASSERT_EQ(kiroku({"case", "mark", "something happened"}).status, 0);
  const auto socket = look_on(surgeon);
  json last;
  for (int i = 0; i < 10; ++i) {
    socket->send_text(point(0.5, 0.5));
    last = next(*socket, "pointer");
  }
  // Until nothing of it is on its way to the disk any more.
  EXPECT_TRUE(eventually([&] {
    std::int64_t until_ns = 0;
    std::istringstream entered(read_text(home() / "archive" / case_id_ / "ledger.jsonl"));
    for (std::string text; std::getline(entered, text);) {
      const json entry = json::parse(text, nullptr, false);
      if (entry.is_object() && entry["type"] == "segment" && entry["stream"] == "pointing")
        until_ns = entry["end_ns"];
    }
    return until_ns > last["time_ns"].get<std::int64_t>();
  }));
  server_->signal(SIGKILL);
  (void)server_->wait(10s);
  server_.reset();
  ASSERT_EQ(kiroku({"recover"}).status, 0);
  ASSERT_EQ(kiroku({"export", case_id_, "--stream", "pointing", "-o", path("p.jsonl")}).status, 0);
  const std::string lines = read_text(path("p.jsonl"));
  EXPECT_EQ(std::ranges::count(lines, '\n'), 10);
  std::istringstream ledger(read_text(home() / "archive" / case_id_ / "ledger.jsonl"));
  std::vector<json> gaps;
  std::int64_t sealed_until_ns = 0, last_entry_ns = 0;
  for (std::string text; std::getline(ledger, text);) {
    const json entry = json::parse(text);
    if (entry["type"] == "segment" && entry["stream"] == "pointing") sealed_until_ns = entry["end_ns"];
    if (entry["type"] == "recovered") break;
    last_entry_ns = entry["mono_ns"];
  }
  for (std::string text; std::getline(ledger, text);) {
    const json entry = json::parse(text);
    if (entry["type"] == "gap" && entry["stream"] == "pointing") gaps.push_back(entry);
  }
  ASSERT_EQ(gaps.size(), 1U);
  EXPECT_GT(sealed_until_ns, last["time_ns"]);
  EXPECT_EQ(gaps[0]["start_ns"], std::max(sealed_until_ns, last_entry_ns - 1'000'000'000))
      << "what was sealed is not said to be lost, nor the time in which nobody pointed, whatever was marked";
}

}  // namespace
}  // namespace kiroku::test

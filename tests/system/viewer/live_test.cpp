// Live pictures of a real kirokud: what a browser is sent, how old it is, and that the recording loses
// nothing for it.
#include <algorithm>
#include <cmath>
#include <csignal>
#include <sstream>

#include "archive/reading/case_reader.h"
#include "tests/support/build_paths.h"
#include "tests/support/decoded_video.h"
#include "tests/support/https_client.h"
#include "tests/support/reserved_port.h"
#include "tests/support/socket_client.h"
#include "tests/system/program_test.h"

namespace kiroku::test {
namespace {

using namespace std::chrono_literals;
using nlohmann::json;
using testing::HasSubstr;

constexpr const char* kPassword = "correct horse battery";
constexpr int kRate = 25;
constexpr double kWhite = 200;  // a flash is brighter

class Live : public ProgramTest {
 protected:
  void SetUp() override {
    make_demo_home();
    port_ = reserved_port();
    write_text(home() / "kiroku.toml", read_text(home() / "kiroku.toml") + R"(
[[room]]
name = "or-1"
[[room.stream]]
name = "endoscope"
source = "synthetic:endoscope?size=640x480&rate=25&flash=1"
[daemon]
socket = ")" + path("s") + R"("
[viewer]
listen = "127.0.0.1:)" + std::to_string(port_) +
                                           "\"\n");
    for (const char* role : {"operator", "auditor"}) {
      Process::Options adding = options({"user", "add", std::string("a-") + role, "--role", role});
      adding.environment["KIROKU_PASSPHRASE"] = kPassword;
      ASSERT_EQ(run_process(adding).status, 0);
    }
    Process::Options started = options({});
    started.command = {built_file("kirokud")};
    daemon_.emplace(started);
    ASSERT_TRUE(daemon_->wait_for("recording for 1 room"));
  }
  void TearDown() override {
    if (!daemon_) return;
    daemon_->signal(SIGTERM);
    EXPECT_EQ(daemon_->wait(60s).status, 0);
  }
  [[nodiscard]] std::string sign_in(const std::string& user) const {
    const HttpResponse answer = ask_once(
        port_,
        http_request("POST", "/api/session", {}, json{{"user", user}, {"password", kPassword}}.dump()));
    EXPECT_EQ(answer.status, 200) << answer.body;
    const std::string cookie = answer.headers.at("set-cookie");
    return cookie.substr(0, cookie.find(';'));
  }
  /// Somebody who still watches when the daemon is told to end.
  SocketClient& watch() {
    return watcher_.emplace(port_, "/api/live/or-1/endoscope", sign_in("a-operator"),
                            "https://127.0.0.1:" + std::to_string(port_));
  }
  /// How a browser that asks for a WebSocket is answered; 101: it has one.
  [[nodiscard]] int status_of(const std::string& target, const std::string& cookie,
                              const std::string& origin = "") const {
    return ask_once(port_, http_request("GET", target,
                                        {{"Connection", "Upgrade"},
                                         {"Upgrade", "websocket"},
                                         {"Sec-WebSocket-Version", "13"},
                                         {"Sec-WebSocket-Key", "dGhlIHNhbXBsZSBub25jZQ=="},
                                         {"Cookie", cookie},
                                         {"Origin", origin}}))
        .status;
  }

  std::uint16_t port_ = 0;
  std::optional<Process> daemon_;
  std::optional<SocketClient> watcher_;
};

TEST_F(Live, WhoStartsMarksAndStopsStandsInTheApplianceLog) {
  const std::string cookie = sign_in("a-operator");
  const auto deed = [&](const std::string& action, const std::string& body) {
    return ask_once(port_, http_request("POST", "/api/rooms/or-1/" + action, {{"Cookie", cookie}}, body));
  };
  const HttpResponse started = deed("start", "");
  ASSERT_EQ(started.status, 200) << started.body;
  const std::string case_id = json::parse(started.body)["case"];
  EXPECT_EQ(deed("mark", R"({"text":"clip placed"})").status, 200);
  EXPECT_EQ(deed("profile", R"({"profile":"lossless","stream":"endoscope","why":"resection"})").status, 200);
  EXPECT_THAT(deed("profile", R"({"profile":"h264"})").body, HasSubstr("must be mpeg2, uncompressed or"));
  EXPECT_EQ(deed("profile", R"({"stream":"endoscope"})").status, 400);
  EXPECT_EQ(deed("subject", R"({"subject":{"patient":{"name":"DOE^JANE"}}})").status, 200);
  EXPECT_EQ(deed("stop", "").status, 200);
  const std::string log = read_text(home() / "archive/log/ledger.jsonl");
  std::vector<std::string> deeds;
  std::istringstream lines(log);
  for (std::string line; std::getline(lines, line);) {
    const json entry = json::parse(line);
    if (entry["type"] != "access" ||
        !entry["who"].get<std::string>().starts_with("a-operator (kiroku view, "))
      continue;
    deeds.push_back(entry["case"].get<std::string>() + " " + entry["what"].get<std::string>());
  }
  EXPECT_THAT(deeds,
              testing::ElementsAre("* asked to start recording in or-1", case_id + " marked a moment in or-1",
                                   case_id + " changed how pictures of or-1 are archived",
                                   case_id + " changed how pictures of or-1 are archived",
                                   case_id + " gave patient and procedure of or-1",
                                   case_id + " asked to stop recording in or-1"));
  // As a word: three letters stand in the base64 of a key by chance.
  const auto word = [](const std::string& name) {
    return testing::ContainsRegex("[^A-Za-z0-9+/]" + name + "[^A-Za-z0-9+/]");
  };
  EXPECT_THAT(log, testing::Not(testing::AnyOf(HasSubstr("clip placed"), HasSubstr("resection"), word("DOE"),
                                               word("JANE"))));
}

TEST_F(Live, ShowsWhatIsRecordedAndCostsNoFrame) {
  const std::string case_id = kiroku_json({"case", "start", "--json"})["case"];
  SocketClient& client = watch();
  const auto first = client.receive();
  ASSERT_TRUE(first && first->is_text);
  EXPECT_THAT(json::parse(text_of(first->bytes))["codecs"].get<std::string>(), testing::StartsWith("avc1."));
  const auto init = client.receive();
  ASSERT_TRUE(init && !init->is_text);

  Bytes film = init->bytes;
  std::vector<std::chrono::system_clock::time_point> arrivals;
  const auto flashes_of = [](const DecodedVideo& seen) {
    return std::ranges::count_if(seen.frames, [](const auto& frame) { return frame.brightness > kWhite; });
  };
  // Whoever watches on a busy machine is not shown every picture, so not every flash either.
  DecodedVideo video;
  while (flashes_of(video) < 3) {
    for (int i = 0; i < 2 * kRate; ++i) {
      const auto fragment = client.receive();
      ASSERT_TRUE(fragment && !fragment->is_text);
      append(film, fragment->bytes);
      arrivals.push_back(fragment->arrived);
    }
    video = decode_video(film);
    ASSERT_LT(arrivals.size(), std::size_t{60} * kRate) << "no flashes in a minute of pictures";
  }
  const auto room = kiroku_json({"status", "--json"})["rooms"][0];
  EXPECT_EQ(room["streams"][0]["dropped"], 0);
  EXPECT_EQ(kiroku({"case", "stop"}).status, 0);

  EXPECT_THAT(video.complaints, testing::IsEmpty());
  ASSERT_EQ(video.frames.size(), arrivals.size());
  // Case-clock zero, by the same machine's clock as the arrivals.
  const auto recording = archive::CaseReader::open(home() / "archive" / case_id);
  const auto zero = recording.opened_at().utc - std::chrono::duration_cast<std::chrono::microseconds>(
                                                    std::chrono::nanoseconds(recording.opened_at().mono_ns));
  std::vector<double> ages;
  for (std::size_t i = 0; i < arrivals.size(); ++i) {
    const std::chrono::duration<double> seen(static_cast<double>(video.frames[i].pts) / 90'000);
    ages.push_back(std::chrono::duration<double>(arrivals[i] - zero).count() - seen.count());
    EXPECT_GE(ages.back(), 0) << "picture " << i << " came before it was made";
    const bool is_white = video.frames[i].brightness > kWhite;
    // The picture shows its own time: white at whole seconds.
    const double part = seen.count() - std::floor(seen.count() + 0.01);
    EXPECT_EQ(is_white, part < 0.9 / kRate)
        << "picture " << i << " at " << seen.count() << ", brightness " << video.frames[i].brightness;
  }
  std::ranges::sort(ages);
  RecordProperty("age_median_ms", static_cast<int>(ages[ages.size() / 2] * 1'000));
  RecordProperty("age_p95_ms", static_cast<int>(ages[ages.size() * 95 / 100] * 1'000));
  recording.for_each([](const archive::CaseEntry& entry) {
    const auto* segment = std::get_if<archive::SegmentEntry>(&entry.body);
    if (segment != nullptr) {
      EXPECT_EQ(segment->dropped, 0U);
    }
  });
}

TEST_F(Live, IsForWhoMaySeeItAlone) {
  const std::string target = "/api/live/or-1/endoscope";
  EXPECT_EQ(status_of(target, ""), 401);
  EXPECT_EQ(status_of(target, sign_in("a-auditor")), 403);
  const std::string cookie = sign_in("a-operator");
  EXPECT_EQ(status_of("/api/live/or-1/vitals", cookie), 404);
  EXPECT_EQ(status_of("/api/live/or-2/endoscope", cookie), 404);
  EXPECT_EQ(status_of(target, cookie, "https://elsewhere.example"), 403);
  EXPECT_EQ(status_of("/api/status", cookie), 200) << "an address that is no WebSocket answers as ever";
  EXPECT_THAT(read_text(home() / "archive/log/ledger.jsonl"),
              testing::Not(HasSubstr("watched or-1/endoscope live")));
  EXPECT_EQ(json::parse(ask_once(port_, http_request("GET", "/api/live", {{"Cookie", cookie}})).body),
            json::parse(R"({"streams":[{"room":"or-1","stream":"endoscope","now_ns":null}]})"));
  EXPECT_EQ(status_of(target, cookie), 101);
  EXPECT_EQ(ask_once(port_, http_request("GET", target, {{"Cookie", cookie}})).status, 426);
  EXPECT_THAT(read_text(home() / "archive/log/ledger.jsonl"), HasSubstr("watched or-1/endoscope live"));
}

TEST_F(Live, ConfigurationIsCheckedBeforeAnythingIsRecorded) {
  const auto check = [this](const std::string& section) {
    write_text(
        path("checked.toml"),
        "[[room]]\nname = \"or-1\"\n[[room.stream]]\nname = \"endoscope\"\nsource = \"synthetic:pattern\"\n" +
            section);
    Process::Options checking = options({});
    checking.command = {built_file("kirokud"), "--check", "--config", path("checked.toml")};
    const ProcessResult result = run_process(checking);
    return result.status == 0 ? std::string("good") : result.err;
  };
  EXPECT_EQ(check("[viewer]\nlisten = \"0.0.0.0:8443\"\n"), "good");
  EXPECT_EQ(check("[viewer]\nlisten = \"[::1]:8443\"\ncertificate = \"a.pem\"\nkey = \"a.key\"\n"), "good");
  EXPECT_THAT(check("[viewer]\nlisten = \"8443\"\n"), HasSubstr("no address to listen on"));
  EXPECT_THAT(check("[viewer]\ncertificate = \"a.pem\"\nkey = \"a.key\"\n"), HasSubstr("needs a 'listen'"));
  EXPECT_THAT(check("[viewer]\nlisten = \"127.0.0.1:8443\"\nkey = \"a.key\"\n"),
              HasSubstr("belong together"));
  EXPECT_THAT(check("[viewer]\nlisten = \"127.0.0.1:8443\"\nport = 1\n"), HasSubstr("port"));
}

}  // namespace
}  // namespace kiroku::test

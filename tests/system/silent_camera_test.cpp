// A room whose camera is open and says nothing, through the real daemon and libavdevice's own capture.
#include <csignal>
#include <functional>
#include <sstream>
#include <thread>

#include <boost/asio/ip/tcp.hpp>

#include "tests/support/build_paths.h"
#include "tests/support/eventually.h"
#include "tests/support/reserved_port.h"
#include "tests/system/program_test.h"

namespace kiroku::test {
namespace {

using testing::Ge;
using testing::HasSubstr;
using testing::Not;

constexpr const char* kDevice = "/dev/full";
// What the recorder promises with this test's source_timeout is less than three seconds.
constexpr std::chrono::seconds kLimit{30};

class SilentCamera : public ProgramTest {
 protected:
  void SetUp() override {
    if (std::string(KIROKU_SANITIZERS) != "")
      GTEST_SKIP() << "a sanitizer's library must be the first one that is loaded";
    make_demo_home();
    port_ = reserved_port();
  }
  void configure(const std::string& source) const {
    std::string text = read_text(home() / "kiroku.toml");
    const std::string usual = "source_timeout = \"5s\"";
    const std::size_t at = text.find(usual);
    ASSERT_NE(at, std::string::npos);
    // Within it a decoder's process must start, too, on a machine that runs the other tests.
    text.replace(at, usual.size(), "source_timeout = \"2s\"");
    text += std::string(R"(
[[room]]
name = "or-1"
[[room.stream]]
name = "endoscope"
source = ")") +
            source +
            R"("
[[room.stream]]
name = "room"
source = "synthetic:room?size=64x48&rate=10"
[daemon]
socket = ")" +
            path("s") + "\"\nlisten = \"127.0.0.1:" + std::to_string(port_) + "\"\n";
    write_text(home() / "kiroku.toml", text);
  }
  [[nodiscard]] Process::Options kirokud(const std::string& then) const {
    Process::Options started = options({});
    started.command.front() = built_file("kirokud");
    started.environment["LD_PRELOAD"] = built_file("played_camera");
    started.environment["KIROKU_CAMERA_DEVICE"] = kDevice;
    write_text(path("given"), std::string(8, '\0'));
    started.environment["KIROKU_CAMERA_GIVEN"] = path("given");
    started.environment["KIROKU_CAMERA_PICTURES"] = "20";
    started.environment["KIROKU_CAMERA_THEN"] = then;
    return started;
  }
  template <typename Condition>
  [[nodiscard]] bool until(const Condition& holds) const {
    return eventually([&] { return holds(kiroku_json({"status", "--json"})["rooms"][0]["streams"]); });
  }
  [[nodiscard]] std::string metrics() const {
    boost::asio::ip::tcp::iostream connection("127.0.0.1", std::to_string(port_));
    connection << "GET /metrics HTTP/1.1\r\nHost: localhost\r\nConnection: close\r\n\r\n" << std::flush;
    return {std::istreambuf_iterator<char>(connection), {}};
  }
  /// Records until the camera has fallen silent and the recorder knows, then ends the case and the recorder.
  void record(const std::string& then, const std::function<bool(const nlohmann::json& streams)>& known,
              const std::string& source = kDevice) {
    configure(source);
    Process daemon(kirokud(then));
    ASSERT_TRUE(daemon.wait_for("recording for 1 room"));
    const std::string id = kiroku_json({"case", "start", "--json"})["case"];
    ASSERT_TRUE(until([](const nlohmann::json& streams) { return streams[0]["frames"].get<int>() > 0; }))
        << daemon.out();
    ASSERT_TRUE(until(known));
    metrics_ = metrics();
    const ProcessResult stopped = run_process(options({"case", "stop"}), kLimit);
    EXPECT_FALSE(stopped.timed_out) << "the case does not end";
    EXPECT_EQ(stopped.status, 0) << stopped.err;
    daemon.signal(SIGTERM);
    ended_ = daemon.wait(kLimit);
    EXPECT_FALSE(ended_.timed_out) << "the recorder does not end";
    EXPECT_EQ(ended_.status, 0);
    const nlohmann::json report =
        kiroku_json({"verify", "--json", "--identity", (home() / "identity.txt").string(),
                     (home() / "archive" / id).string()});
    EXPECT_EQ(report["verdict"], "intact-with-gaps");
    ledger_ = read_text(home() / "archive" / id / "ledger.jsonl");
  }
  /// The only gap of the camera, once it was opened, lasts until the case is closed, but for what closing
  /// takes.
  void expect_gap_to_the_end() const {
    std::istringstream lines(ledger_);
    std::vector<nlohmann::json> gaps;
    std::int64_t camera_until_ns = 0, room_until_ns = 0;
    for (std::string line; std::getline(lines, line);) {
      const nlohmann::json entry = nlohmann::json::parse(line);
      // Until a camera is open nothing can be recorded of it, and that is stated.
      const bool is_opening = entry["type"] == "gap" && entry["start_ns"] == 0;
      if (entry["type"] == "gap" && entry["stream"] == "endoscope" && !is_opening) gaps.push_back(entry);
      if (entry["type"] != "segment") continue;
      auto& until_ns = entry["stream"] == "endoscope" ? camera_until_ns : room_until_ns;
      until_ns = std::max(until_ns, entry["end_ns"].get<std::int64_t>());
    }
    ASSERT_EQ(gaps.size(), 1U) << ledger_;
    EXPECT_EQ(gaps[0]["cause"], "signal-lost");
    EXPECT_EQ(gaps[0]["start_ns"], camera_until_ns);
    EXPECT_GE(gaps[0]["end_ns"].get<std::int64_t>(), room_until_ns - 500'000'000);
  }

  std::uint16_t port_ = 0;
  std::string metrics_, ledger_;
  ProcessResult ended_;
};

TEST_F(SilentCamera, ThatGivesNoPictureHoldsNothing) {
  record("silent", [](const nlohmann::json& streams) { return !streams[0]["live"].get<bool>(); });
  expect_gap_to_the_end();
  EXPECT_THAT(ended_.err, HasSubstr("source '/dev/full' sent nothing for too long"));
  EXPECT_THAT(ended_.err, Not(HasSubstr("left behind")));
  EXPECT_THAT(metrics_, HasSubstr("kiroku_stream_live{room=\"or-1\",stream=\"endoscope\"} 0"));
  EXPECT_THAT(metrics_, HasSubstr("kiroku_room_recording{room=\"or-1\"} 1"));
}

// A driver that not even SIGKILL gets a process out of is played in source_guard_test.cpp.
TEST_F(SilentCamera, WhoseDriverKeepsTheDecoderHoldsNothing) {
  record("stuck", [](const nlohmann::json& streams) { return !streams[0]["live"].get<bool>(); });
  expect_gap_to_the_end();
  EXPECT_THAT(ended_.err, testing::ContainsRegex(
                              "source '/dev/full' has not answered for [0-9.]+ s: its decoder was killed"));
  EXPECT_THAT(ended_.err, Not(HasSubstr("left behind")));
  EXPECT_THAT(metrics_, HasSubstr("kiroku_stream_live{room=\"or-1\",stream=\"endoscope\"} 0"));
  EXPECT_THAT(metrics_, HasSubstr("kiroku_source_threads_stuck{room=\"or-1\",stream=\"endoscope\"} 0"));
}

TEST_F(SilentCamera, WhoseDriverKeepsWhoClosesItHoldsNothing) {
  record("stuck-closing", [](const nlohmann::json& streams) { return !streams[0]["live"].get<bool>(); });
  expect_gap_to_the_end();
  EXPECT_THAT(ended_.err, Not(HasSubstr("left behind")));
}

TEST_F(SilentCamera, ThatOffersOtherPicturesThanWereAskedForSaysSo) {
  record(
      "silent",
      [](const nlohmann::json& streams) {
        return streams[0]["input"] == "64x48 yuyv422, 20 a second" && !streams[0]["live"].get<bool>();
      },
      std::string(kDevice) + "?size=1920x1080&rate=60");
  EXPECT_THAT(ended_.err, HasSubstr("was asked for 1920x1080, 60 pictures a second, which it does not offer: "
                                    "recorded is 64x48 yuyv422, 20 a second"));
}

}  // namespace
}  // namespace kiroku::test

#include <csignal>
#include <thread>

#include "tests/system/program_test.h"

namespace kiroku::test {
namespace {

using testing::HasSubstr;

constexpr const char* kOneRoom = R"(
[[room]]
name = "or-1"
[[room.stream]]
name = "endoscope"
source = "synthetic:endoscope?size=64x48&rate=10"
[[room.stream]]
name = "vitals"
kind = "vitals"
source = "synthetic:patient"
)";

class Daemon : public ProgramTest {
 protected:
  void SetUp() override {
    make_demo_home();
    write_text(home() / "kiroku.toml",
               read_text(home() / "kiroku.toml") + kOneRoom + "[daemon]\nsocket = \"" + path("s") + "\"\n");
  }
  [[nodiscard]] Process::Options kirokud(const Arguments& arguments = {}) const {
    Process::Options started = options(arguments);
    started.command.front() = KIROKU_DAEMON_PROGRAM;
    return started;
  }
  /// Waits until `status` says of the only room what is wanted.
  template <typename Condition>
  [[nodiscard]] bool until(const Condition& holds) const {
    for (int i = 0; i < 600; ++i) {
      if (holds(kiroku_json({"status", "--json"})["rooms"][0])) return true;
      std::this_thread::sleep_for(std::chrono::milliseconds(50));
    }
    return false;
  }
};

TEST_F(Daemon, RecordsWhatItIsToldAndClosesWhenItEnds) {
  Process daemon(kirokud());
  ASSERT_TRUE(daemon.wait_for("recording for 1 room"));
  EXPECT_EQ(kiroku_json({"status", "--json"})["rooms"][0]["state"], "idle");
  write_text(path("subject.json"), R"({"patient":{"id":"7"}})");
  const std::string first =
      kiroku_json({"case", "start", "--subject", path("subject.json"), "--json"})["case"];
  EXPECT_TRUE(
      until([](const nlohmann::json& room) { return room["streams"][0]["segments"].get<int>() > 0; }));
  EXPECT_EQ(kiroku({"case", "mark", "clip placed"}).status, 0);
  EXPECT_REFUSED(kiroku({"case", "start"}), "recording already");
  EXPECT_EQ(kiroku_json({"case", "stop", "--json"})["case"], first);
  EXPECT_EQ(kiroku_json({"verify", "--json", (home() / "archive" / first).string()})["verdict"], "intact");
  EXPECT_TRUE(std::filesystem::exists(home() / "archive" / first / "subject.json.age"));
  EXPECT_EQ(kiroku_json({"cases", "--json"})["cases"][0]["case"], first);

  const std::string second = kiroku_json({"case", "start", "--json"})["case"];
  EXPECT_TRUE(until([](const nlohmann::json& room) { return room["streams"][0]["frames"].get<int>() > 0; }));
  daemon.signal(SIGTERM);
  EXPECT_EQ(daemon.wait().status, 0);
  EXPECT_EQ(kiroku_json({"verify", "--json", (home() / "archive" / second).string()})["verdict"], "intact");
  EXPECT_THAT(read_text(home() / "archive" / "log" / "ledger.jsonl"), HasSubstr(R"("type":"shutdown")"));
  EXPECT_REFUSED(kiroku({"status"}), "no recorder answers");
}

TEST_F(Daemon, OnlyOneOnAHome) {
  Process daemon(kirokud());
  ASSERT_TRUE(daemon.wait_for("recording for 1 room"));
  const ProcessResult second = run_process(kirokud());
  EXPECT_EQ(second.status, 2);
  EXPECT_THAT(second.err, HasSubstr("another recorder (process "));
}

TEST_F(Daemon, ChecksItsConfiguration) {
  EXPECT_EQ(run_process(kirokud({"--check"})).status, 0);
  write_text(path("bad.toml"),
             "[[room]]\nname = \"or-1\"\n[[room.stream]]\nname = \"endoscope\"\nsorce = \"x\"\n");
  const ProcessResult bad = run_process(kirokud({"--check", "--config", path("bad.toml")}));
  EXPECT_EQ(bad.status, 2);
  EXPECT_THAT(bad.err, HasSubstr("bad.toml:5:1: unknown key 'sorce'"));
  write_text(path("none.toml"), "");
  EXPECT_THAT(run_process(kirokud({"--check", "--config", path("none.toml")})).err,
              HasSubstr("names no [[room]]"));
}

}  // namespace
}  // namespace kiroku::test

// The real kirokud is killed while it records, and started again: the operation goes on in a new case.
#include <csignal>
#include <thread>

#include "recorder/control/control_client.h"
#include "tests/support/build_paths.h"
#include "tests/support/eventually.h"
#include "tests/system/program_test.h"

namespace kiroku::test {
namespace {

using testing::HasSubstr;
using testing::Not;

constexpr const char* kRoom = R"(
[[room]]
name = "or-1"
resume = true
[[room.stream]]
name = "endoscope"
source = "synthetic:endoscope?size=64x48&rate=10"
)";

class Resuming : public ProgramTest {
 protected:
  void SetUp() override {
    make_demo_home();
    configuration_ = read_text(home() / "kiroku.toml") + "[daemon]\nsocket = \"" + path("s") + "\"\n";
    configure(kRoom);
  }
  void configure(const std::string& rooms) const {
    write_text(home() / "kiroku.toml", configuration_ + rooms);
  }
  [[nodiscard]] Process::Options kirokud() const {
    Process::Options started = options({});
    started.command.front() = built_file("kirokud");
    return started;
  }
  [[nodiscard]] nlohmann::json room() const { return kiroku_json({"status", "--json"})["rooms"][0]; }
  [[nodiscard]] bool until_segment() const {
    return eventually([this] {
      const nlohmann::json now = room();
      return !now["streams"].empty() && now["streams"][0]["segments"].get<int>() > 0;
    });
  }
  [[nodiscard]] bool until_state(const std::string& wanted) const {
    return eventually([&] { return room()["state"] == wanted; });
  }
  /// Starts kirokud, and a case if asked, and kills it while it records; the case.
  [[nodiscard]] std::string record_and_kill(const Arguments& start) const {
    Process daemon(kirokud());
    EXPECT_TRUE(daemon.wait_for("recording for 1 room"));
    if (!start.empty()) {
      EXPECT_EQ(kiroku(start).status, 0);
    }
    EXPECT_TRUE(until_state("recording"));
    EXPECT_TRUE(until_segment());
    const std::string id = room()["case"];
    daemon.signal(SIGKILL);
    daemon.wait();
    return id;
  }
  [[nodiscard]] nlohmann::json verified(const std::string& id) const {
    return kiroku_json({"verify", "--json", (home() / "archive" / id).string()});
  }
  [[nodiscard]] std::size_t cases() const { return kiroku_json({"cases", "--json"})["cases"].size(); }

 private:
  std::string configuration_;
};

TEST_F(Resuming, AKilledRecorderGoesOnInANewCaseThatIsLinkedInBothLedgers) {
  write_text(path("subject.json"), R"({"patient":{"id":"7"}})");
  const std::string first = record_and_kill({"case", "start", "--subject", path("subject.json")});
  Process daemon(kirokud());
  ASSERT_TRUE(daemon.wait_for("carries on case " + first)) << daemon.out();
  ASSERT_TRUE(until_segment());
  const nlohmann::json now = room();
  const std::string second = now["case"];
  EXPECT_NE(second, first);
  EXPECT_EQ(now["carries_on"], first);
  EXPECT_EQ(now["resumed"], 1);
  EXPECT_EQ(now["subject"], "carried-over");
  EXPECT_THAT(kiroku({"status"}).out, HasSubstr("carries on case " + first));
  EXPECT_EQ(kiroku({"case", "stop"}).status, 0);
  for (const auto& [id, verdict] : {std::pair(first, "intact-with-gaps"), std::pair(second, "intact")}) {
    const nlohmann::json report = verified(id);
    EXPECT_EQ(report["verdict"], verdict) << report["findings"].dump(1);
    EXPECT_THAT(report["findings"].dump(), HasSubstr("carrying-on-holds"));
  }
  EXPECT_EQ(read_text(home() / "archive" / first / "subject.json.age"),
            read_text(home() / "archive" / second / "subject.json.age"));
  EXPECT_EQ(kiroku({"log", "--verify"}).status, 0);

  // The earlier case elsewhere, and then changed in its place.
  std::filesystem::rename(home() / "archive" / first, folder() / "aside");
  EXPECT_THAT(verified(second)["findings"].dump(), HasSubstr("carried-on-not-here"));
  EXPECT_EQ(verified(second)["verdict"], "intact");
  std::filesystem::rename(folder() / "aside", home() / "archive" / first);
  flip_byte(home() / "archive" / first / "ledger.jsonl", 100);
  const ProcessResult judged = kiroku({"verify", "--json", (home() / "archive" / second).string()});
  EXPECT_EQ(judged.status, 0);  // what is wrong with that one is no fault of this one
  const nlohmann::json beside = nlohmann::json::parse(judged.out);
  EXPECT_THAT(beside["findings"].dump(), HasSubstr("carried-on-not-compared"));
  EXPECT_EQ(kiroku({"verify", (home() / "archive" / first).string()}).status, 1);
}

// A case that was begun under a wrong name, or none, and corrected while it ran.
TEST_F(Resuming, AKilledRecorderGoesOnWithWhomTheCaseWasSaidToBeAboutLast) {
  write_text(path("subject.json"), R"({"patient":{"id":"wrong"}})");
  for (const Arguments& start :
       {Arguments{"case", "start", "--subject", path("subject.json")}, Arguments{"case", "start"}}) {
    std::string first;
    {
      Process daemon(kirokud());
      ASSERT_TRUE(daemon.wait_for("recording for 1 room"));
      EXPECT_EQ(kiroku(start).status, 0);
      first = room()["case"];
      recorder::ask_recorder(path("s"),
                             {{"do", "subject"}, {"room", "or-1"}, {"subject", {{"patient", "7"}}}});
      daemon.signal(SIGKILL);
      daemon.wait();
    }
    Process daemon(kirokud());
    ASSERT_TRUE(daemon.wait_for("carries on case " + first)) << daemon.out();
    EXPECT_EQ(room()["subject"], "carried-over");
    const std::string second = room()["case"];
    EXPECT_EQ(kiroku({"case", "stop"}).status, 0);
    EXPECT_THAT(kiroku({"unseal", "-i", (home() / "identity.txt").string(),
                        (home() / "archive" / second / "subject.json.age").string()})
                    .out,
                HasSubstr(R"({"patient":"7"})"));
    // The one that was killed is time-stamped later.
    for (const std::string& id : {first, second})
      EXPECT_THAT(kiroku({"verify", "--json", (home() / "archive" / id).string()}).out,
                  HasSubstr("carrying-on-holds"));
    daemon.signal(SIGTERM);
    EXPECT_EQ(daemon.wait().status, 0);
  }
}

// Who can write the archive while the recorder is down must not choose the patient.
TEST_F(Resuming, ASubjectThatTheDeviceDidNotSignIsNotCarriedOver) {
  write_text(path("subject.json"), R"({"patient":{"id":"wrong"}})");
  std::string first;
  {
    Process daemon(kirokud());
    ASSERT_TRUE(daemon.wait_for("recording for 1 room"));
    EXPECT_EQ(kiroku({"case", "start", "--subject", path("subject.json")}).status, 0);
    first = room()["case"];
    recorder::ask_recorder(path("s"), {{"do", "subject"}, {"room", "or-1"}, {"subject", {{"patient", "7"}}}});
    daemon.signal(SIGKILL);
    daemon.wait();
  }
  const std::filesystem::path file = home() / "archive" / ".running" / "or-1.json";
  nlohmann::json note = nlohmann::json::parse(read_text(file));
  ASSERT_TRUE(note.contains("subject"));
  EXPECT_THAT(note.dump(), Not(HasSubstr("patient")));
  note["subject"]["sealed"] = "AAAA";
  write_text(file, note.dump());
  Process daemon(kirokud());
  ASSERT_TRUE(daemon.wait_for("is not as this device signed it")) << daemon.out();
  ASSERT_TRUE(until_state("recording"));
  EXPECT_EQ(room()["carries_on"], first);
  EXPECT_EQ(room()["subject"], "none") << "not the one that was corrected, either";
  EXPECT_TRUE(daemon.wait_for("the case goes on after one whose subject it is not given"));
  EXPECT_EQ(kiroku({"case", "stop"}).status, 0);
}

TEST_F(Resuming, WhatSomebodyEndedIsNotCarriedOn) {
  {
    Process daemon(kirokud());
    ASSERT_TRUE(daemon.wait_for("recording for 1 room"));
    EXPECT_EQ(kiroku({"case", "start"}).status, 0);
    ASSERT_TRUE(until_segment());
    EXPECT_EQ(kiroku({"case", "stop"}).status, 0);
    daemon.signal(SIGTERM);
    EXPECT_EQ(daemon.wait().status, 0);
  }
  Process daemon(kirokud());
  ASSERT_TRUE(daemon.wait_for("recording for 1 room"));
  EXPECT_EQ(room()["state"], "idle");
  EXPECT_EQ(room()["not_resumed"], false);
  EXPECT_EQ(cases(), 1U);
}

// As needrestart does after a library was upgraded.
TEST_F(Resuming, ARecorderThatIsRestartedWhileItRecordsSaysThatNothingIsCarriedOn) {
  std::string first;
  {
    Process daemon(kirokud());
    ASSERT_TRUE(daemon.wait_for("recording for 1 room"));
    EXPECT_EQ(kiroku({"case", "start"}).status, 0);
    ASSERT_TRUE(until_segment());
    first = room()["case"];
    daemon.signal(SIGTERM);
    EXPECT_EQ(daemon.wait().status, 0);
  }
  Process daemon(kirokud());
  ASSERT_TRUE(daemon.wait_for("recording for 1 room"));
  EXPECT_EQ(room()["state"], "idle");
  EXPECT_EQ(room()["not_resumed"], true);
  EXPECT_THAT(room()["problem"], HasSubstr("case " + first + " was ended (shutdown) while its operation"));
  EXPECT_EQ(cases(), 1U);
  EXPECT_EQ(kiroku({"case", "start"}).status, 0);
  EXPECT_EQ(room()["not_resumed"], false);
  EXPECT_EQ(kiroku({"case", "stop"}).status, 0);
}

TEST_F(Resuming, WithoutTheRuleNothingIsCarriedOn) {
  std::string without(kRoom);
  without.erase(without.find("resume = true\n"), 14);
  configure(without);
  const std::string first = record_and_kill({"case", "start"});
  Process daemon(kirokud());
  ASSERT_TRUE(daemon.wait_for("recording for 1 room"));
  EXPECT_EQ(room()["state"], "idle");
  EXPECT_EQ(cases(), 1U);
  EXPECT_THAT(verified(first)["findings"].dump(), Not(HasSubstr("carried-on")));
}

TEST_F(Resuming, ARecorderThatDiesAgainAndAgainIsCarriedOnABoundedNumberOfTimes) {
  std::string last = record_and_kill({"case", "start"});
  for (int i = 0; i < 2; ++i) {
    const std::string next = record_and_kill({});
    EXPECT_NE(next, last);
    last = next;
  }
  Process daemon(kirokud());
  ASSERT_TRUE(daemon.wait_for("die as soon as it records")) << daemon.out();
  ASSERT_TRUE(daemon.wait_for("recording for 1 room"));
  EXPECT_EQ(room()["state"], "idle");
  EXPECT_EQ(room()["not_resumed"], true);
  EXPECT_EQ(cases(), 3U);
  EXPECT_EQ(kiroku({"log", "--verify"}).status, 0);
}

}  // namespace
}  // namespace kiroku::test

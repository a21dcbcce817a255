// The profile follows the procedure, and is changed while a case runs: the real recorder, and everything that
// reads its cases.
#include <array>
#include <csignal>
#include <cstdio>
#include <fstream>
#include <sstream>

#include "tests/support/build_paths.h"
#include "tests/support/eventually.h"
#include "tests/system/program_test.h"

namespace kiroku::test {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;

constexpr const char* kRooms = R"(
[[recording.profile_for]]
name = "mucosa"
words = ["EMR", "粘膜切除"]
codes = ["K653"]
profile = "lossless"
streams = ["endoscope"]
[[recording.profile_for]]
name = "second"
words = ["stomach"]
profile = "uncompressed"
[[room]]
name = "or-1"
[[room.stream]]
name = "endoscope"
source = "synthetic:endoscope?size=64x48&rate=20"
[[room.stream]]
name = "room"
source = "synthetic:room?size=64x48&rate=10"
)";

class ProfileByProcedure : public ProgramTest {
 protected:
  void SetUp() override { make_demo_home(); }
  void configure(const std::string& room) const {
    write_text(home() / "kiroku.toml",
               read_text(home() / "kiroku.toml") + room + "[daemon]\nsocket = \"" + path("s") + "\"\n");
  }
  [[nodiscard]] Process::Options kirokud() const {
    Process::Options started = options({});
    started.command.front() = built_file("kirokud");
    return started;
  }
  [[nodiscard]] nlohmann::json room() const { return kiroku_json({"status", "--json"})["rooms"][0]; }
  template <typename Condition>
  [[nodiscard]] bool until(const Condition& holds) const {
    return eventually([&] { return holds(room()); });
  }
  /// Until so many more pictures of the first stream are recorded, in this form.
  [[nodiscard]] bool records(const std::string& profile, int more = 10) const {
    const int before = room()["streams"][0]["frames"];
    return until([&](const nlohmann::json& now) {
      const nlohmann::json& stream = now["streams"][0];
      return stream["profile"] == profile && stream["frames"].get<int>() >= before + more;
    });
  }
  [[nodiscard]] std::string begin(const std::string& subject) const {
    if (subject.empty()) return kiroku_json({"case", "start", "--json"})["case"];
    write_text(path("subject.json"), subject);
    return kiroku_json({"case", "start", "--subject", path("subject.json"), "--json"})["case"];
  }
  [[nodiscard]] std::filesystem::path folder_of(const std::string& id) const {
    return home() / "archive" / id;
  }
  [[nodiscard]] std::vector<nlohmann::json> entries(const std::string& id, const std::string& type) const {
    std::vector<nlohmann::json> found;
    std::ifstream lines(folder_of(id) / "ledger.jsonl");
    for (std::string line; std::getline(lines, line);) {
      nlohmann::json entry = nlohmann::json::parse(line);
      if (entry["type"] == type) found.push_back(std::move(entry));
    }
    return found;
  }
  /// The profiles in which a stream was archived, one after the other.
  [[nodiscard]] std::vector<std::string> forms(const std::string& id, const std::string& stream) const {
    std::string opened;
    const nlohmann::json open = entries(id, "open").at(0);
    for (const nlohmann::json& each : open["streams"]) {
      if (each["name"] == stream) opened = each["profile"];
    }
    std::vector<std::string> forms;
    for (const nlohmann::json& segment : entries(id, "segment")) {
      if (segment["stream"] != stream) continue;
      const std::string form = segment.value("profile", opened);
      if (forms.empty() || forms.back() != form) forms.push_back(form);
    }
    return forms;
  }
  /// What the case's events say of the profile.
  [[nodiscard]] std::vector<nlohmann::json> decisions(const std::string& id) const {
    const std::string file = path("events-" + id + ".jsonl");
    const ProcessResult exported =
        kiroku({"export", folder_of(id).string(), "--stream", "events", "--identity",
                (home() / "identity.txt").string(), "--force", "-o", file});
    std::vector<nlohmann::json> found;
    if (exported.status != 0) return found;
    std::istringstream lines(read_text(file));
    for (std::string line; std::getline(lines, line);) {
      const auto event = nlohmann::json::parse(nlohmann::json::parse(line)["event"].get<std::string>());
      if (event["kind"] == "profile") found.push_back(event["profile"]);
    }
    return found;
  }
  [[nodiscard]] std::string verdict(const std::string& id) const {
    return nlohmann::json::parse(
        kiroku({"verify", "--json", "--identity", (home() / "identity.txt").string(), folder_of(id).string()})
            .out)["verdict"];
  }
  /// The script of docs/how-to/verify-with-stock-tools.md; its last line.
  [[nodiscard]] std::string by_stock_tools(const std::string& id) const {
    std::istringstream page(read_text(source_folder() / "docs/how-to/verify-with-stock-tools.md"));
    std::string script;
    bool on = false;
    for (std::string line; std::getline(page, line);) {
      if (line == "```bash") {
        on = true;
      } else if (line == "```") {
        on = false;
      } else if (on) {
        script += line + "\n";
      }
    }
    write_text(path("verify.sh"), script);
    const std::string out =
        tool({"bash", path("verify.sh"), folder_of(id).string(), (home() / "own-authority.pem").string(),
              (home() / "device.pub").string(), (home() / "identity.txt").string()})
            .out;
    const std::string text = out.substr(0, out.find_last_not_of('\n') + 1);
    return text.substr(text.rfind('\n') + 1);
  }
};

TEST_F(ProfileByProcedure, ARuleChoosesBeforeTheFirstPicture) {
  configure(kRooms);
  Process daemon(kirokud());
  ASSERT_TRUE(daemon.wait_for("recording for 1 room"));

  const std::string emr =
      begin(R"({"patient":{"id":"7"},"procedure":{"description":"胃ＥＭＲ, stomach","code":"K99"}})");
  EXPECT_EQ(room()["profile_rule"], "mucosa") << "two rules match: the first counts";
  EXPECT_THAT(kiroku({"status"}).out, HasSubstr("profile chosen by rule mucosa"));
  ASSERT_TRUE(records("lossless"));
  EXPECT_EQ(kiroku({"case", "stop"}).status, 0);
  EXPECT_THAT(forms(emr, "endoscope"), ElementsAre("lossless"));
  EXPECT_THAT(forms(emr, "room"), ElementsAre("mpeg2")) << "the rule is for the endoscope";
  const auto said = decisions(emr);
  ASSERT_EQ(said.size(), 1U);
  EXPECT_EQ(said[0]["by"], "rule mucosa");
  EXPECT_EQ(said[0]["why"], "the word 'EMR' in '胃ＥＭＲ, stomach'");
  EXPECT_EQ(read_text(folder_of(emr) / "ledger.jsonl").find("EMR"), std::string::npos);
  EXPECT_EQ(read_text(folder_of(emr) / "ledger.jsonl").find("mucosa"), std::string::npos);
  EXPECT_EQ(verdict(emr), "intact");

  const std::string other = begin(R"({"procedure":"laparoscopic cholecystectomy"})");
  EXPECT_EQ(room()["profile_rule"], "");
  ASSERT_TRUE(records("mpeg2"));
  // The procedure is corrected while the case runs.
  const ProcessResult told =
      tool({"python3", "-c",
            "import socket, sys\ns = socket.socket(socket.AF_UNIX)\ns.connect(sys.argv[1])\n"
            "s.sendall(sys.argv[2].encode() + b'\\n')\nprint(s.makefile().readline())",
            path("s"), R"({"do":"subject","subject":{"procedure":{"code":"k653"}}})"});
  EXPECT_THAT(told.out, HasSubstr(R"("ok":true)"));
  EXPECT_TRUE(until([](const nlohmann::json& now) {
    return now["problem"].get<std::string>().find("rule mucosa would archive pictures as lossless") !=
           std::string::npos;
  }));
  ASSERT_TRUE(records("mpeg2", 5));
  EXPECT_EQ(kiroku({"case", "stop"}).status, 0);
  EXPECT_THAT(forms(other, "endoscope"), ElementsAre("mpeg2"));
  const auto late = decisions(other);
  ASSERT_EQ(late.size(), 1U);
  EXPECT_EQ(late[0]["unchanged"], true);

  const std::string without = begin("");
  ASSERT_TRUE(records("mpeg2", 3));
  EXPECT_EQ(room()["profile_rule"], "");
  daemon.signal(SIGTERM);
  const ProcessResult ended = daemon.wait();
  EXPECT_EQ(ended.status, 0);
  const std::string journal = ended.out + ended.err;
  EXPECT_THAT(journal, HasSubstr("rule mucosa archives pictures as lossless"));
  EXPECT_EQ(journal.find("stomach"), std::string::npos) << "the journal is not sealed";
  EXPECT_EQ(journal.find("k653"), std::string::npos) << "the journal is not sealed";
  EXPECT_THAT(forms(without, "endoscope"), ElementsAre("mpeg2"));
}

TEST_F(ProfileByProcedure, ChangesDuringTheCaseAndEverythingReadsIt) {
  configure(kRooms);
  Process daemon(kirokud());
  ASSERT_TRUE(daemon.wait_for("recording for 1 room"));
  EXPECT_REFUSED(kiroku({"case", "profile", "lossless"}), "is not recording");
  const std::string id = begin("");
  ASSERT_TRUE(records("mpeg2"));
  EXPECT_EQ(
      kiroku({"case", "profile", "lossless", "--camera", "endoscope", "--why", "resection begins"}).status,
      0);
  ASSERT_TRUE(records("lossless", 30));
  EXPECT_REFUSED(kiroku({"case", "profile", "lossless", "--camera", "endoscope"}), "lossless already");
  EXPECT_REFUSED(kiroku({"case", "profile", "h264"}), "h264");
  EXPECT_REFUSED(kiroku({"case", "profile", "mpeg2", "--camera", "vitals"}),
                 "no stream of pictures of this case; there are: endoscope, room");
  EXPECT_EQ(kiroku({"case", "profile", "mpeg2"}).status, 0);
  ASSERT_TRUE(records("mpeg2"));
  EXPECT_EQ(kiroku({"case", "stop"}).status, 0);

  EXPECT_THAT(forms(id, "endoscope"), ElementsAre("mpeg2", "lossless", "mpeg2"));
  EXPECT_THAT(forms(id, "room"), ElementsAre("mpeg2"));
  EXPECT_EQ(entries(id, "gap").size(), 0U);
  EXPECT_EQ(verdict(id), "intact");
  if (has_tool("age") && has_tool("ffmpeg")) {
    EXPECT_THAT(by_stock_tools(id), testing::StartsWith("INTACT: "));
  }
  const auto said = decisions(id);
  ASSERT_EQ(said.size(), 2U);
  EXPECT_EQ(said[0]["why"], "resection begins");
  EXPECT_EQ(said[0]["by"], "operator");

  // Each picture stands in one of the films, at its time.
  const ProcessResult exported = kiroku({"export", folder_of(id).string(), "--all", "--identity",
                                         (home() / "identity.txt").string(), "-o", path("films")});
  ASSERT_EQ(exported.status, 0) << exported.err;
  int frames = 0;
  double last = -1;
  for (const char* film : {"endoscope", "endoscope-2", "endoscope-3"}) {
    std::istringstream times(read_text(path("films") + "/" + film + ".frames.csv"));
    std::string line;
    std::getline(times, line);
    while (std::getline(times, line)) {
      const double time = std::stod(line.substr(line.find(',') + 1));
      EXPECT_GT(time, last) << film << " " << line;
      last = time;
      ++frames;
    }
  }
  int stated = 0;
  for (const nlohmann::json& segment : entries(id, "segment")) {
    if (segment["stream"] == "endoscope") stated += segment["frames"].get<int>();
  }
  EXPECT_EQ(frames, stated);
  EXPECT_REFUSED(kiroku({"export", folder_of(id).string(), "--stream", "endoscope", "--identity",
                         (home() / "identity.txt").string(), "-o", path("one.mkv")}),
                 "its profile was changed while it was recorded");

  // An excerpt across both changes.
  std::array<char, 32> to{};
  const double end_s = entries(id, "segment").back()["start_ns"].get<double>() / 1e9;
  std::snprintf(to.data(), to.size(), "00:00:%06.3f", end_s);
  const ProcessResult cut = kiroku({"excerpt", folder_of(id).string(), "--from", "00:00:00", "--to",
                                    to.data(), "--stream", "endoscope", "-o", path("excerpt")});
  ASSERT_EQ(cut.status, 0) << cut.err;
  EXPECT_EQ(nlohmann::json::parse(kiroku({"verify", "--json", "--identity",
                                          (home() / "identity.txt").string(), path("excerpt")})
                                      .out)["verdict"],
            "intact-excerpt");
  daemon.signal(SIGTERM);
  EXPECT_EQ(daemon.wait().status, 0);
}

// What a crash leaves is brought to its end, and the operation goes on in the form in which it was cut off.
TEST_F(ProfileByProcedure, ACrashAfterAChangeLosesNeitherPicturesNorTheForm) {
  std::string rooms = kRooms;
  rooms.replace(rooms.find("name = \"or-1\""), 0, "resume = true\n");
  configure(rooms);
  std::string id;
  {
    Process daemon(kirokud());
    ASSERT_TRUE(daemon.wait_for("recording for 1 room"));
    id = begin("");
    ASSERT_TRUE(records("mpeg2"));
    EXPECT_EQ(kiroku({"case", "profile", "lossless", "--camera", "endoscope"}).status, 0);
    ASSERT_TRUE(records("lossless", 60));
    daemon.signal(SIGKILL);
    daemon.wait();
  }
  Process daemon(kirokud());
  ASSERT_TRUE(daemon.wait_for("recording for 1 room"));
  ASSERT_TRUE(until([&](const nlohmann::json& now) { return now["carries_on"] == id; }));
  ASSERT_TRUE(records("lossless"));
  const std::string later = room()["case"];
  EXPECT_EQ(kiroku({"case", "stop"}).status, 0);
  EXPECT_THAT(forms(later, "endoscope"), ElementsAre("lossless"));
  EXPECT_THAT(forms(later, "room"), ElementsAre("mpeg2"));
  EXPECT_EQ(verdict(later), "intact");
  EXPECT_EQ(verdict(id), "intact-with-gaps");
}

TEST_F(ProfileByProcedure, KirokuRecordFollowsTheRulesToo) {
  configure(kRooms);
  write_text(path("subject.json"), R"({"procedure":"内視鏡的粘膜切除術"})");
  const auto record_as = [this](const Arguments& more) {
    Arguments all{"record",
                  "--endoscope",
                  "synthetic:endoscope?size=64x48&rate=10&speed=max",
                  "--duration",
                  "00:00:02",
                  "--subject",
                  path("subject.json"),
                  "--json"};
    all.insert(all.end(), more.begin(), more.end());
    const std::string id = kiroku_json(all)["id"];
    return forms(id, "endoscope");
  };
  EXPECT_THAT(record_as({}), ElementsAre("lossless"));
  EXPECT_THAT(record_as({"--profile", "uncompressed"}), ElementsAre("uncompressed")) << "a person said so";
}

TEST_F(ProfileByProcedure, BothFormsOfOneSourceAtOnce) {
  std::string rooms = kRooms;
  const std::string source = "source = \"synthetic:endoscope?size=64x48&rate=20\"\n";
  rooms.insert(rooms.find(source) + source.size(), "also = \"lossless\"\n");
  configure(rooms);
  {
    Process daemon(kirokud());
    ASSERT_TRUE(daemon.wait_for("recording for 1 room"));
    const std::string id = begin("");
    ASSERT_TRUE(records("mpeg2"));
    EXPECT_EQ(kiroku({"case", "profile", "uncompressed"}).status, 0);
    ASSERT_TRUE(records("uncompressed"));
    EXPECT_EQ(kiroku({"case", "stop"}).status, 0);
    EXPECT_THAT(forms(id, "endoscope"), ElementsAre("mpeg2", "uncompressed"));
    EXPECT_THAT(forms(id, "endoscope-lossless"), ElementsAre("lossless")) << "nobody named it";
    EXPECT_EQ(verdict(id), "intact");
    daemon.signal(SIGTERM);
    EXPECT_EQ(daemon.wait().status, 0);
  }

  const Arguments record{"record",     "--endoscope", "synthetic:endoscope?size=64x48&rate=10&speed=max",
                         "--duration", "00:00:02",    "--also"};
  const auto with = [&](const std::string& also) {
    Arguments all = record;
    all.insert(all.end(), {also, "--json"});
    return all;
  };
  const nlohmann::json recorded = kiroku_json(with("endoscope=lossless"));
  EXPECT_EQ(recorded["streams"][1]["name"], "endoscope-lossless");
  EXPECT_EQ(recorded["streams"][1]["frames"], recorded["streams"][0]["frames"]);
  EXPECT_EQ(verdict(recorded["id"]), "intact");
  EXPECT_REFUSED(kiroku(with("endoscope")), "endoscope=lossless");
  EXPECT_REFUSED(kiroku(with("room=lossless")), "of those that are recorded");
  EXPECT_REFUSED(kiroku(with("endoscope=h264")), "must be mpeg2, uncompressed or lossless");
  EXPECT_REFUSED(kiroku(with("endoscope=mpeg2")), "are archived already");
}

}  // namespace
}  // namespace kiroku::test

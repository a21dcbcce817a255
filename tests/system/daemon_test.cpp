#include <csignal>
#include <cstring>
#include <fcntl.h>
#include <thread>
#include <utility>  // Boost 1.74 forgets it before its awaitable

#include <boost/asio.hpp>

#include "tests/support/build_paths.h"
#include "tests/support/child_processes.h"
#include "tests/support/eventually.h"
#include "tests/support/mllp_client.h"
#include "tests/support/reserved_port.h"
#include "tests/support/worklist_server.h"
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
    started.command.front() = built_file("kirokud");
    return started;
  }
  /// The configuration but for its table of recipients, which init writes empty.
  [[nodiscard]] static std::string without_recipients(std::string text) {
    constexpr std::string_view kTable = "\n[recipients]\n";
    text.replace(text.find(kTable), kTable.size(), "\n");
    return text;
  }
  /// Waits until `status` says of the only room what is wanted.
  template <typename Condition>
  [[nodiscard]] bool until(const Condition& holds) const {
    return eventually([&] { return holds(kiroku_json({"status", "--json"})["rooms"][0]); });
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
  EXPECT_TRUE(until([](const nlohmann::json& room) {
    return room["authorities"].size() == 1 && room["authorities"][0]["name"] == "embedded" &&
           room["authorities"][0]["last_token"].is_string();
  }));
  EXPECT_THAT(kiroku({"status"}).out, testing::ContainsRegex("embedded  answers  last token 20[0-9-]+T"));
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

// A shell gives 1,024 descriptors; the hard limit is what there is.
TEST_F(Daemon, TakesTheDescriptorsThatItMayHaveAndSaysWhereTheyAreFew) {
  const auto limited = [this](const std::string& limit) {
    Process::Options started = kirokud();
    std::vector<std::string> command{"/bin/sh", "-c",
                                     "ulimit " + limit + "; echo $$ >" + path("pid") + "; exec \"$@\"", "sh"};
    command.insert(command.end(), started.command.begin(), started.command.end());
    started.command = std::move(command);
    return started;
  };
  {
    Process daemon(limited("-n 512"));
    ASSERT_TRUE(daemon.wait_for("recording for 1 room"));
    EXPECT_TRUE(daemon.wait_for("only 512 files and connections may be open at once"));
  }
  Process daemon(limited("-Sn 512"));
  ASSERT_TRUE(daemon.wait_for("recording for 1 room"));
  const pid_t process = std::stoi(read_text(path("pid")));
  const std::string files = line_of_process(process, "limits", "Max open files");
  std::istringstream words(files);
  std::string soft, hard;
  words >> soft >> hard;
  EXPECT_EQ(soft, hard) << files;
}

// doctor before kirokud runs, doctor beside it and status tell one figure, and what it assumes.
TEST_F(Daemon, HoursOfDiskAreOneFigureThatSaysWhatItAssumes) {
  const auto by_doctor = [this] {
    const nlohmann::json examined = nlohmann::json::parse(kiroku({"doctor", "--json"}).out);
    for (const nlohmann::json& check : examined["checks"]) {
      if (check["subject"] == "hours of disk") return check["finding"].get<std::string>();
    }
    return "no such check: " + examined.dump();
  };
  const auto hours_of = [](const std::string& text) { return std::stod(text.substr(std::strlen("about "))); };
  const std::string before = by_doctor();
  EXPECT_THAT(before,
              testing::MatchesRegex("about .* if every room records .or-1 by the bit rate in kiroku.toml."));

  Process daemon(kirokud());
  ASSERT_TRUE(daemon.wait_for("recording for 1 room"));
  const nlohmann::json disk = kiroku_json({"status", "--json"})["disk"];
  EXPECT_EQ(disk["hours_assume"], "or-1 by the bit rate in kiroku.toml");
  // Others write to the disk meanwhile.
  EXPECT_NEAR(disk["hours_left"].get<double>() / hours_of(before), 1, 0.2);
  EXPECT_NEAR(disk["hours_left"].get<double>() / hours_of(by_doctor()), 1, 0.2);
  EXPECT_THAT(kiroku({"status"}).out,
              HasSubstr("if every room records (or-1 by the bit rate in kiroku.toml)"));

  EXPECT_EQ(kiroku({"case", "start"}).status, 0);
  const auto assumes_now = [this] {
    return kiroku_json({"status", "--json"})["disk"]["hours_assume"] == "or-1 as it records now";
  };
  EXPECT_TRUE(until([&](const nlohmann::json& /*room*/) { return assumes_now(); }));
  EXPECT_THAT(by_doctor(), HasSubstr("or-1 as it records now"));
  EXPECT_EQ(kiroku({"case", "stop"}).status, 0);
  EXPECT_EQ(kiroku_json({"status", "--json"})["disk"]["hours_assume"], "or-1 as its last case");
}

// A room between two cases holds no camera: whether one would be there nobody knows before it is tried.
TEST_F(Daemon, DoctorTriesWhatAnIdleRoomWouldRecordAndTellsOfProcedureData) {
  std::string configuration = read_text(home() / "kiroku.toml");
  constexpr std::string_view kCamera = "synthetic:endoscope?size=64x48&rate=10";
  configuration.replace(configuration.find(kCamera), kCamera.size(), "/dev/video-of-nobody");
  // Nobody has that address.
  write_text(home() / "kiroku.toml",
             configuration + "[room.procedure.hl7]\nlisten = \"mllp://192.0.2.1:2576?allow=192.0.2.7\"\n");
  Process daemon(kirokud());
  ASSERT_TRUE(daemon.wait_for("recording for 1 room"));
  const ProcessResult doctor = kiroku({"doctor", "--json"});
  EXPECT_EQ(doctor.status, 1);
  const nlohmann::json examined = nlohmann::json::parse(doctor.out);
  std::map<std::string, std::string> health;
  for (const nlohmann::json& check : examined["checks"]) health[check["subject"]] = check["health"];
  EXPECT_EQ(health["kirokud"], "good");
  EXPECT_EQ(health["source or-1/endoscope"], "bad");
  EXPECT_EQ(health["source or-1/vitals"], "good");
  EXPECT_EQ(health["hl7 of or-1"], "bad");
}

// A room that records ahead holds its sources, and says which are dead before a case begins.
TEST_F(Daemon, ARoomThatRecordsAheadTellsOfDeadSources) {
  std::string configuration = read_text(home() / "kiroku.toml");
  constexpr std::string_view kCamera = "synthetic:endoscope?size=64x48&rate=10";
  configuration.replace(configuration.find(kCamera), kCamera.size(), "/dev/video-of-nobody");
  constexpr std::string_view kRoom = "name = \"or-1\"\n";
  configuration.insert(configuration.rfind(kRoom) + kRoom.size(), "pre_roll = \"2s\"\n");
  write_text(home() / "kiroku.toml", configuration);
  Process daemon(kirokud());
  ASSERT_TRUE(daemon.wait_for("recording for 1 room"));
  EXPECT_TRUE(until([](const nlohmann::json& room) {
    return room["state"] == "standby" && room["streams"][0]["age_ms"].get<int>() >= 3000 &&
           room["streams"][1]["live"].get<bool>();
  }));
  EXPECT_THAT(kiroku_json({"status", "--json"})["rooms"][0]["problem"].get<std::string>(),
              HasSubstr("video-of-nobody"));
  EXPECT_THAT(kiroku({"status"}).out, testing::ContainsRegex("endoscope +SILENT"));
  const ProcessResult doctor = kiroku({"doctor", "--json"});
  EXPECT_EQ(doctor.status, 1);
  std::map<std::string, std::string> health;
  const nlohmann::json examined = nlohmann::json::parse(doctor.out);
  for (const nlohmann::json& check : examined["checks"]) health[check["subject"]] = check["health"];
  EXPECT_EQ(health["source or-1/endoscope"], "bad");
  EXPECT_EQ(health["source or-1/vitals"], "good");
}

TEST_F(Daemon, RecordsAPlannedCaseThatCanBeComparedByItsMarks) {
  write_text(folder() / "cube.msh",
             "$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$Nodes\n8\n1 0 0 0\n2 10 0 0\n3 0 10 0\n4 10 10 0\n5 0 "
             "0 10\n6 10 0 10\n7 0 10 10\n8 10 10 10\n$EndNodes\n$Elements\n6\n1 4 2 1 1 1 2 4 8\n2 4 2 1 "
             "1 1 3 7 8\n3 4 2 1 1 1 5 6 8\n4 4 2 1 1 1 2 8 6\n5 4 2 1 1 1 5 8 7\n6 4 2 1 1 1 3 8 4\n"
             "$EndElements\n");
  write_text(folder() / "plan.json",
             R"({"name": "cube", "mesh": "cube.msh", "length_unit": "mm",
      "materials": [{"region": "all", "young_modulus_pa": 5000, "poisson_ratio": 0.45}],
      "fixed": [{"box": [[0, 0, 0], [10, 10, 0]]}], "tools": {},
      "steps": [{"do": "hold", "name": "Look around", "duration_s": 1}, {"do": "hold", "name": "Wait", "duration_s": 1}]})");
  Process daemon(kirokud());
  ASSERT_TRUE(daemon.wait_for("recording for 1 room"));
  EXPECT_REFUSED(kiroku({"case", "start", "--plan", "plan.json"}), "is no sealed plan");
  const std::string seal = kiroku_json({"plan", "seal", "plan.json", "--json"})["sha256"];
  const std::string id = kiroku_json({"case", "start", "--plan", "plan.seal.json", "--json"})["case"];
  const std::string folder_of_case = (home() / "archive" / id).string();
  EXPECT_TRUE(until([](const nlohmann::json& room) { return room["streams"][0]["frames"].get<int>() > 0; }));
  for (const char* mark : {"wait", "done", "now look around"})
    EXPECT_EQ(kiroku({"case", "mark", mark}).status, 0);
  EXPECT_TRUE(
      until([](const nlohmann::json& room) { return room["streams"][0]["segments"].get<int>() > 1; }));
  EXPECT_EQ(kiroku_json({"case", "stop", "--json"})["case"], id);
  EXPECT_EQ(kiroku({"plan", "verify", "plan.seal.json", "--case", folder_of_case}).status, 0);
  const nlohmann::json made = kiroku_json({"compare", id, "plan.seal.json", "-o", "out.json", "--json"});
  EXPECT_EQ(made["steps_found"], 2);
  EXPECT_EQ(made["in_planned_order"], false);
  const nlohmann::json document = nlohmann::json::parse(read_text(folder() / "out.json"));
  EXPECT_EQ(document["plan"]["seal"], seal);
  EXPECT_EQ(document["case"]["names_plan"], true);
  EXPECT_EQ(document["steps"][1]["done"]["end_from"], "mark");
  EXPECT_EQ(document["steps"][0]["done"]["mark"], "now look around");
}

TEST_F(Daemon, RecordsWithoutWhatRecordingDoesNotNeed) {
  boost::asio::io_context context;
  boost::asio::ip::tcp::acceptor taken(context, {boost::asio::ip::make_address("127.0.0.1"), 0});
  ASSERT_EQ(::fcntl(taken.native_handle(), F_SETFD, FD_CLOEXEC), 0);  // the recorder must not hold it, too
  write_text(home() / "kiroku.toml", read_text(home() / "kiroku.toml") + "listen = \"127.0.0.1:" +
                                         std::to_string(taken.local_endpoint().port()) +
                                         "\"\nhook_token_file = \"hook-token\"\n");
  write_text(home() / "authority" / "serial", "");
  write_text(home() / "own-authority.pem", "-----BEGIN CERTIFICATE-----\ndamaged\n");
  const ProcessResult checked = run_process(kirokud({"--check"}));
  EXPECT_EQ(checked.status, 2) << checked.out;
  EXPECT_THAT(checked.err, HasSubstr("hook-token"));

  Process daemon(kirokud());
  ASSERT_TRUE(daemon.wait_for("recording for 1 room")) << daemon.out();
  const nlohmann::json problems = kiroku_json({"status", "--json"})["problems"];
  EXPECT_THAT(problems.get<std::vector<std::string>>(),
              testing::UnorderedElementsAre(HasSubstr("own-authority.pem"), HasSubstr("serial"),
                                            HasSubstr("without the hook: "),
                                            HasSubstr("without metrics and the hook: ")))
      << problems;
  EXPECT_THAT(kiroku({"status"}).out, HasSubstr("recording goes on without the hook"));
  const std::string id = kiroku_json({"case", "start", "--json"})["case"];
  EXPECT_TRUE(until([](const nlohmann::json& room) { return room["missed"].get<int>() > 0; }));
  EXPECT_EQ(kiroku_json({"case", "stop", "--json"})["case"], id);

  // The port is free after all.
  taken.close();
  EXPECT_TRUE(daemon.wait_for("no more: recording goes on without metrics and the hook"));
  EXPECT_EQ(kiroku_json({"status", "--json"})["problems"].size(), 3U);
}

// One that accepts connections and never answers is the worst.
TEST_F(Daemon, IsThereAtOnceAfterACrashThoughAnAuthorityDoesNotAnswer) {
  boost::asio::io_context context;
  const boost::asio::ip::tcp::acceptor silent(context, {boost::asio::ip::make_address("127.0.0.1"), 0});
  write_text(home() / "kiroku.toml", read_text(home() / "kiroku.toml") +
                                         "[[authority]]\nname = \"silent\"\nurl = \"http://127.0.0.1:" +
                                         std::to_string(silent.local_endpoint().port()) +
                                         "/\"\ntotal_timeout = \"5m\"\n");
  std::string id;
  {
    Process daemon(kirokud());
    ASSERT_TRUE(daemon.wait_for("recording for 1 room")) << daemon.out();
    id = kiroku_json({"case", "start", "--json"})["case"];
    EXPECT_TRUE(
        until([](const nlohmann::json& room) { return room["streams"][0]["segments"].get<int>() > 0; }));
    daemon.signal(SIGKILL);
    daemon.wait();
  }
  Process daemon(kirokud());
  EXPECT_TRUE(daemon.wait_for("case " + id + " was cut off by a crash and is closed now"));
  EXPECT_TRUE(daemon.wait_for("recording for 1 room"));
  EXPECT_TRUE(eventually([&] { return kiroku({"case", "start"}).status == 0; }));
}

TEST_F(Daemon, SealsWhatTheHospitalSaysOfAProcedureAndTellsItNowhereElse) {
  if (!has_worklist_server()) GTEST_SKIP() << "wlmscpfs is not installed (Debian package dcmtk)";
  WorklistServer server(folder() / "worklist");
  const std::uint16_t hl7_port = reserved_port();
  write_text(home() / "kiroku.toml", read_text(home() / "kiroku.toml") + R"(
[[room]]
name = "or-2"
[room.procedure.hl7]
listen = "mllp://127.0.0.1:)" + std::to_string(hl7_port) +
                                         R"("
locations = ["OR2"]
[room.procedure.worklist]
address = "127.0.0.1:)" + std::to_string(server.port()) +
                                         R"("
called_ae = "RIS"
timeout = "10s"
refresh = "5s"
[[room.stream]]
name = "endoscope"
source = "synthetic:endoscope?size=64x48&rate=10"
)");
  Process daemon(kirokud());
  ASSERT_TRUE(daemon.wait_for("recording for 2 room"));
  ASSERT_TRUE(daemon.wait_for("it is asked again"));
  const auto room = [this] { return kiroku_json({"status", "--json"})["rooms"][1]; };
  const auto until_subject = [&](const std::string& wanted) {
    return eventually([&] { return room()["subject"] == wanted; });
  };
  const auto opened = [&](const std::string& case_id) {
    return kiroku({"unseal", "-i", (home() / "identity.txt").string(),
                   (home() / "archive" / case_id / "subject.json.age").string()})
        .out;
  };

  // No worklist yet: recording begins all the same, and says so; then it comes, while the case runs.
  const std::string late = kiroku_json({"case", "start", "--room", "or-2", "--json"})["case"];
  EXPECT_EQ(room()["subject"], "none");
  // By the log: the status tells the newest problem, which on a busy machine may be another by now.
  EXPECT_TRUE(daemon.wait_for("begins without procedure data"));
  EXPECT_FALSE(room()["procedure"][1]["well"].get<bool>());
  EXPECT_THAT(kiroku({"doctor"}).out, testing::ContainsRegex("WARNING +worklist of or-2"));
  server.add("11", "Listed^Lisa", compact_local_time("%Y%m%d"), compact_local_time("%H%M"));
  server.start();
  EXPECT_THAT(kiroku({"doctor"}).out, HasSubstr("lists 1 steps of these days"));
  EXPECT_TRUE(until_subject("late"));
  EXPECT_THAT(kiroku({"case", "stop", "--room", "or-2", "--no-wait"}).out,
              HasSubstr("room or-2: ending " + late));
  ASSERT_TRUE(eventually([&] { return room()["state"] == "idle"; }));
  EXPECT_EQ(kiroku_json({"verify", "--json", (home() / "archive" / late).string()})["verdict"], "intact");
  EXPECT_THAT(kiroku({"export", late, "--stream", "events", "-o", path("events.jsonl")}).err, testing::_);
  EXPECT_THAT(read_text(path("events.jsonl")), HasSubstr("Listed^Lisa"));

  // Known ahead: the worklist's; then a message's, which goes before it.
  const std::string listed = kiroku_json({"case", "start", "--room", "or-2", "--json"})["case"];
  EXPECT_EQ(room()["subject"], "found");
  EXPECT_EQ(kiroku({"case", "stop", "--room", "or-2"}).status, 0);
  EXPECT_THAT(opened(listed), HasSubstr("Listed^Lisa"));
  MllpClient hospital("127.0.0.1", hl7_port);
  hospital.send_message(
      "MSH|^~\\&|ADT|HOSP|||20260805080000||ADT^A02|77|P|2.5||||||8859/1\r"
      "PID|1||KH4711JM^^^HOSP^MR||M\xFCller^J\xF6rg\rPV1|1|I|SURGERY^OR2\r");
  EXPECT_THAT(hospital.receive().value_or(""), HasSubstr("MSA|AA|77"));
  const std::string placed = kiroku_json({"case", "start", "--room", "or-2", "--json"})["case"];
  EXPECT_EQ(kiroku({"case", "stop", "--room", "or-2"}).status, 0);
  EXPECT_EQ(nlohmann::json::parse(opened(placed))["patient"]["family"], "Müller");
  EXPECT_EQ(kiroku_json({"verify", "--json", (home() / "archive" / placed).string()})["verdict"], "intact");

  const std::string status = kiroku({"status", "--json"}).out;
  daemon.signal(SIGTERM);
  const ProcessResult ended = daemon.wait();
  EXPECT_EQ(ended.status, 0);
  for (const std::string said : {"Listed", "Müller", "KH4711JM"}) {
    EXPECT_THAT(ended.err + ended.out + status, testing::Not(HasSubstr(said)));
    EXPECT_THAT(read_text(home() / "archive" / placed / "ledger.jsonl"), testing::Not(HasSubstr(said)));
  }
}

TEST_F(Daemon, OnlyOneOnAHome) {
  Process daemon(kirokud());
  ASSERT_TRUE(daemon.wait_for("recording for 1 room"));
  const ProcessResult second = run_process(kirokud());
  EXPECT_EQ(second.status, 2);
  EXPECT_THAT(second.err, HasSubstr("another recorder (process "));
}

// One bit of the appliance log is wrong: what it proves suffers, and the operation is recorded.
TEST_F(Daemon, ALogWithADamagedLineIsToldAndRecordedOn) {
  const std::filesystem::path log = home() / "archive/log/ledger.jsonl";
  {
    Process daemon(kirokud());
    ASSERT_TRUE(daemon.wait_for("recording for 1 room"));
    EXPECT_EQ(kiroku({"case", "start"}).status, 0);
    EXPECT_EQ(kiroku({"case", "stop"}).status, 0);
    daemon.signal(SIGTERM);
    EXPECT_EQ(daemon.wait().status, 0);
  }
  std::string text = read_text(log);
  const std::size_t at = text.find("\"case-opened\"");
  ASSERT_NE(at, std::string::npos);
  text[at] = '#';
  write_text(log, text);
  Process daemon(kirokud());
  ASSERT_TRUE(
      daemon.wait_for("the appliance log is damaged, or a newer version wrote it: cannot read line "));
  ASSERT_TRUE(daemon.wait_for("recording for 1 room"));
  const std::string id = kiroku_json({"case", "start", "--json"})["case"];
  EXPECT_TRUE(until([](const nlohmann::json& room) { return room["streams"][0]["frames"].get<int>() > 0; }));
  EXPECT_EQ(kiroku({"case", "stop"}).status, 0);
  daemon.signal(SIGTERM);
  EXPECT_EQ(daemon.wait().status, 0);
  EXPECT_THAT(read_text(home() / "archive" / id / "ledger.jsonl"), HasSubstr(R"("type":"close")"));
  const ProcessResult recorded = kiroku({"record", "--duration", "00:00:01", "--endoscope",
                                         "synthetic:endoscope?size=64x48&rate=10&speed=max"});
  EXPECT_EQ(recorded.status, 0);
  EXPECT_THAT(recorded.err, HasSubstr("warning: the appliance log is damaged"));
  EXPECT_NE(kiroku({"log", "--verify"}).status, 0) << "and nobody is told that it is whole";
}

// An upgrade while a mistake stands in the configuration, which nobody noticed as the recorder ran on.
TEST_F(Daemon, StaysWhereANewerVersionRefusesTheConfiguration) {
  const std::filesystem::path programs = folder() / "programs", program = programs / "kirokud";
  std::filesystem::create_directory(programs);
  std::filesystem::copy_file(built_file("kirokud"), program);
  std::filesystem::copy_file(built_file("kiroku-decoder"), programs / "kiroku-decoder");
  Process::Options started = kirokud();
  started.command.front() = program;
  Process daemon(started);
  ASSERT_TRUE(daemon.wait_for("recording for 1 room"));
  const std::string good = read_text(home() / "kiroku.toml");
  write_text(home() / "kiroku.toml", good + "longest_cas = \"8h\"\n");
  const auto upgrade = [&] {
    std::filesystem::copy_file(built_file("kirokud"), programs / "new");
    std::filesystem::rename(programs / "new", program);
  };
  upgrade();
  ASSERT_TRUE(daemon.wait_for("--check does not take the configuration"));
  write_text(home() / "kiroku.toml", good);
  ASSERT_TRUE(daemon.wait_for("a newer version was installed and nothing is being recorded"));
  EXPECT_EQ(daemon.wait().status, 0);
}

// What few may see is named by a stream, or nobody is told that all may.
TEST_F(Daemon, SealsMarksAndPatientToWhomTheyAreFor) {
  const std::string good = read_text(home() / "kiroku.toml");
  write_text(home() / "kiroku.toml", "[recipients]\nendoscop = \"few.txt\"\n" + without_recipients(good));
  EXPECT_THAT(run_process(kirokud({"--check"})).err,
              HasSubstr("[recipients] names the stream 'endoscop', which nothing here records"));
  const std::string few = kiroku({"init", "--demo", "--home", path("few")}).out;
  std::filesystem::copy_file(path("few/recipients.txt"), home() / "few.txt");
  write_text(home() / "kiroku.toml",
             "[[retention]]\nstream = \"rom\"\nafter = \"1d\"\npolicy = \"p\"\n"
             "[recipients]\nevents = \"few.txt\"\n" +
                 without_recipients(good));
  const ProcessResult checked = run_process(kirokud({"--check"}));
  EXPECT_EQ(checked.status, 0);
  EXPECT_THAT(checked.err, HasSubstr("warning: "));
  EXPECT_THAT(checked.err, HasSubstr("[[retention]] is for the stream 'rom'"));
  Process daemon(kirokud());
  ASSERT_TRUE(daemon.wait_for("recording for 1 room"));
  write_text(path("subject.json"), R"({"patient":{"id":"7"}})");
  const std::string id = kiroku_json({"case", "start", "--subject", path("subject.json"), "--json"})["case"];
  EXPECT_EQ(kiroku({"case", "stop"}).status, 0);
  daemon.signal(SIGTERM);
  daemon.wait();
  const std::string subject = (home() / "archive" / id / "subject.json.age").string();
  EXPECT_NE(kiroku({"unseal", subject, "--identity", (home() / "identity.txt").string(), "-o", "-"}).status,
            0);
  EXPECT_THAT(kiroku({"unseal", subject, "--identity", path("few/identity.txt"), "-o", "-"}).out,
              HasSubstr("\"7\""));
}

// The file of a name that no room records was never looked at, and nobody heard that it sealed nothing.
TEST_F(Daemon, TellsOfRecipientsThatNoRoomUses) {
  const std::string good = without_recipients(read_text(home() / "kiroku.toml"));
  const auto with = [&](const std::string& name) {
    write_text(home() / "kiroku.toml", "[recipients]\n" + name + " = \"few.txt\"\n" + good);
    return run_process(kirokud({"--check"}));
  };
  for (const char* const name : {"fluoroscopy", "training", "vitals"}) {
    const ProcessResult without_file = with(name);
    EXPECT_EQ(without_file.status, 2) << name;
    EXPECT_THAT(without_file.err, HasSubstr("few.txt")) << name;
    EXPECT_NE(run_process(kirokud()).status, 0) << name;
  }
  EXPECT_THAT(kiroku({"doctor"}).out, testing::ContainsRegex("BAD +recipients: .*few.txt"));
  std::filesystem::copy_file(home() / "recipients.txt", home() / "few.txt");
  EXPECT_EQ(with("training").err, "");
  const ProcessResult told = with("fluoroscopy");
  const std::string sentence = "[recipients] names the stream 'fluoroscopy', which no [[room]] records";
  EXPECT_EQ(told.status, 0);
  EXPECT_THAT(told.err, testing::AllOf(HasSubstr("warning: "), HasSubstr(sentence)));
  EXPECT_THAT(kiroku({"doctor"}).out, HasSubstr("recipients: " + sentence));
  Process daemon(kirokud());
  ASSERT_TRUE(daemon.wait_for(sentence));
  ASSERT_TRUE(daemon.wait_for("recording for 1 room"));
  const nlohmann::json status = kiroku_json({"status", "--json"});
  EXPECT_THAT(status["remarks"].dump(), HasSubstr(sentence));
  EXPECT_EQ(status["problems"].size(), 0U) << "it records as it is told";
  EXPECT_THAT(kiroku({"status"}).out, HasSubstr(sentence));
}

// Its disk is not mounted, and a new log begins below the mount point.
TEST_F(Daemon, AnotherLogInTheArchivesPlaceIsToldAndNothingIsErasedByIt) {
  std::string held;
  {
    Process daemon(kirokud());
    ASSERT_TRUE(daemon.wait_for("recording for 1 room"));
    held = kiroku_json({"case", "start", "--json"})["case"];
    EXPECT_EQ(kiroku({"case", "stop"}).status, 0);
    EXPECT_EQ(kiroku_json({"status", "--json"})["problems"].size(), 0U);
    daemon.signal(SIGTERM);
    EXPECT_EQ(daemon.wait().status, 0);
  }
  EXPECT_EQ(kiroku({"hold", held, "--reason", "court order"}).status, 0);
  EXPECT_EQ(kiroku({"log", "--verify"}).status, 0);
  const auto by_doctor = [this] {
    const nlohmann::json examined = nlohmann::json::parse(kiroku({"doctor", "--json"}).out);
    for (const nlohmann::json& check : examined["checks"]) {
      if (check["subject"] == "appliance log") return check["health"].get<std::string>();
    }
    return "no such check: " + examined.dump();
  };
  EXPECT_EQ(by_doctor(), "good");
  constexpr const char* kAnother = "is not the one that this home wrote last";
  const std::string kept = read_text(home() / "newest-log.note");

  std::filesystem::rename(home() / "archive", folder() / "away");
  std::filesystem::create_directory(home() / "archive");
  const ProcessResult checked = run_process(kirokud({"--check"}));
  EXPECT_EQ(checked.status, 0) << "it would record";
  EXPECT_THAT(checked.err, HasSubstr(kAnother));
  EXPECT_EQ(by_doctor(), "bad");
  std::string theirs;
  {
    Process daemon(kirokud());
    ASSERT_TRUE(daemon.wait_for(kAnother)) << daemon.out();
    ASSERT_TRUE(daemon.wait_for("recording for 1 room"));
    EXPECT_THAT(kiroku({"status"}).out, HasSubstr(kAnother));
    EXPECT_EQ(kiroku_json({"status", "--json"})["problems"].size(), 1U);
    theirs = kiroku_json({"case", "start", "--json"})["case"];
    EXPECT_TRUE(
        until([](const nlohmann::json& room) { return room["streams"][0]["segments"].get<int>() > 0; }));
    EXPECT_EQ(kiroku({"case", "stop"}).status, 0);
    daemon.signal(SIGTERM);
    EXPECT_EQ(daemon.wait().status, 0);
  }
  EXPECT_EQ(read_text(home() / "newest-log.note"), kept) << "the other log is the one to compare with";
  EXPECT_EQ(kiroku_json({"verify", "--json", (home() / "archive" / theirs).string()})["verdict"], "intact");
  EXPECT_NE(kiroku({"log", "--verify"}).status, 0);
  EXPECT_REFUSED(kiroku({"erase", theirs, "--stream", "endoscope", "--policy", "p", "--only-copy"}),
                 kAnother);
  EXPECT_REFUSED(kiroku({"hold", "--list"}), kAnother);
  EXPECT_TRUE(std::filesystem::exists(home() / "archive" / theirs / "segments/endoscope"));

  // The disk is back; an older copy of it is another log, too, though it has the same beginning.
  std::filesystem::rename(home() / "archive", folder() / "below");
  std::filesystem::rename(folder() / "away", home() / "archive");
  EXPECT_EQ(by_doctor(), "good");
  EXPECT_EQ(kiroku({"log", "--verify"}).status, 0);
  EXPECT_THAT(kiroku({"hold", "--list"}).out, HasSubstr("court order"));
  std::filesystem::copy(home() / "archive", folder() / "copy", std::filesystem::copy_options::recursive);
  EXPECT_EQ(kiroku({"release", held, "--reason", "it is over"}).status, 0);
  std::filesystem::rename(home() / "archive", folder() / "away");
  std::filesystem::rename(folder() / "copy", home() / "archive");
  EXPECT_EQ(by_doctor(), "bad");
  EXPECT_REFUSED(kiroku({"release", held, "--reason", "it is over"}), kAnother);
  // Where the newer one is lost for good, somebody says so.
  std::filesystem::remove(home() / "newest-log.note");
  EXPECT_EQ(by_doctor(), "good");
  EXPECT_EQ(kiroku({"release", held, "--reason", "it is over"}).status, 0);
  EXPECT_TRUE(std::filesystem::exists(home() / "newest-log.note"));
}

TEST_F(Daemon, AnArchiveThatGoesWhileItRecordsIsTold) {
  Process daemon(kirokud());
  ASSERT_TRUE(daemon.wait_for("recording for 1 room"));
  EXPECT_EQ(kiroku({"case", "start"}).status, 0);
  std::filesystem::rename(home() / "archive", folder() / "away");
  ASSERT_TRUE(eventually([&] { return kiroku_json({"status", "--json"})["disk"].is_null(); }));
  EXPECT_THAT(kiroku({"status"}).out, HasSubstr("cannot be looked at: No such file"));
  EXPECT_TRUE(daemon.wait_for("cannot be looked at: No such file"));
  EXPECT_TRUE(until([](const nlohmann::json& room) { return room["ended_by_error"].get<bool>(); }));
}

TEST_F(Daemon, ChecksItsConfiguration) {
  EXPECT_EQ(run_process(kirokud({"--check"})).status, 0);
  const std::string good = read_text(home() / "kiroku.toml");
  write_text(
      home() / "kiroku.toml",
      good + "[viewer]\nlisten = \"127.0.0.1:0\"\ncertificate = \"none.pem\"\n" + "key = \"none.key\"\n");
  const ProcessResult without_page = run_process(kirokud({"--check"}));
  EXPECT_EQ(without_page.status, 0);
  EXPECT_THAT(without_page.err, HasSubstr("warning: "));
  EXPECT_THAT(without_page.err, HasSubstr("recording would go on without the viewer: "));
  std::string elsewhere = good;
  elsewhere.replace(elsewhere.find(path("s")), path("s").size(), path("absent/s"));
  write_text(home() / "kiroku.toml", elsewhere);
  const ProcessResult nowhere = run_process(kirokud({"--check"}));
  EXPECT_EQ(nowhere.status, 2);
  EXPECT_THAT(nowhere.err, HasSubstr("there is no folder " + path("absent")));
  write_text(home() / "kiroku.toml", good);
  write_text(path("bad.toml"),
             "[[room]]\nname = \"or-1\"\n[[room.stream]]\nname = \"endoscope\"\nsorce = \"x\"\n");
  const ProcessResult bad = run_process(kirokud({"--check", "--config", path("bad.toml")}));
  EXPECT_EQ(bad.status, 2);
  EXPECT_THAT(bad.err, HasSubstr("bad.toml:5:1: unknown key 'sorce'"));
  write_text(path("none.toml"), "");
  EXPECT_THAT(run_process(kirokud({"--check", "--config", path("none.toml")})).err,
              HasSubstr("names no [[room]]"));
}

TEST_F(Daemon, ReadsNoConsentThatOtherProgramsOfTheHomeDoNotRead) {
  const std::string own = read_text(home() / "kiroku.toml");
  write_text(path("other.toml"), own + "\n[consent]\ndemand_purpose = true\n");
  const ProcessResult refused = run_process(kirokud({"--check", "--config", path("other.toml")}));
  EXPECT_EQ(refused.status, 2);
  EXPECT_THAT(refused.err, HasSubstr("other.toml: [consent] is read from "));
  write_text(home() / "kiroku.toml", own + "\n[consent]\ndemand_purpose = true\n");
  EXPECT_EQ(run_process(kirokud({"--check", "--config", path("other.toml")})).status, 0);
}

}  // namespace
}  // namespace kiroku::test

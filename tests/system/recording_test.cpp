#include <algorithm>
#include <csignal>
#include <thread>

#include "tests/support/eventually.h"
#include "tests/support/worklist_server.h"
#include "tests/system/program_test.h"

namespace kiroku::test {
namespace {

using testing::Contains;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::Not;

class Recording : public ProgramTest {
 protected:
  void SetUp() override { make_demo_home(); }
  /// A recording at its own pace that goes on until it is stopped.
  [[nodiscard]] Process::Options endless() const {
    return options({"record", "--endoscope", "synthetic:endoscope?size=64x48&rate=10", "--segment", "500ms"});
  }
  /// The one case of the archive.
  [[nodiscard]] std::filesystem::path only_case() const {
    std::vector<std::filesystem::path> found;
    for (const auto& entry : std::filesystem::directory_iterator(home() / "archive")) {
      if (entry.is_directory() && entry.path().filename() != "log") found.push_back(entry.path());
    }
    EXPECT_EQ(found.size(), 1U);
    return found.empty() ? std::filesystem::path() : found.front();
  }
  [[nodiscard]] bool recorded_a_segment() const {
    const auto files = files_below(home() / "archive");
    return std::any_of(files.begin(), files.end(),
                       [](const std::string& file) { return file.ends_with("0.ts.age"); });
  }
  /// Until the first segment is whole; false if it never is.
  [[nodiscard]] bool wait_for_segment() const {
    return eventually([this] { return recorded_a_segment(); });
  }
  [[nodiscard]] std::string codes(const nlohmann::json& report) const {
    std::string out;
    for (const auto& finding : report.at("findings")) out += finding.at("code").get<std::string>() + " ";
    return out;
  }
};

TEST_F(Recording, IsIntactListedAndExportedPictureForPicture) {
  const std::filesystem::path recorded = record();
  const auto report =
      kiroku_json({"verify", "--json", "--identity", (home() / "identity.txt").string(), recorded.string()});
  EXPECT_EQ(report["verdict"], "intact");
  EXPECT_EQ(report["time"], "self-issued");
  EXPECT_EQ(report["streams"][0]["frames"], 30);

  const auto row = kiroku_json({"cases", "--json"})["cases"][0];
  EXPECT_EQ(row["case"], recorded.filename().string());
  EXPECT_EQ(row["verdict"], "intact");
  EXPECT_EQ(row["state"], "closed");

  const auto exported = kiroku_json(
      {"export", recorded.filename().string(), "--stream", "endoscope", "-o", "film.ts", "--json"});
  EXPECT_EQ(exported["frames"], 30);
  const auto vitals = kiroku_json(
      {"export", recorded.filename().string(), "--stream", "vitals", "-o", "vitals.csv", "--json"});
  EXPECT_GT(vitals["frames"], 3);
  EXPECT_THAT(read_text(folder() / "vitals.csv"), testing::StartsWith("time,code,value,unit"));

  const auto log = kiroku_json({"log", "--json"});
  std::vector<std::string> types;
  for (const auto& entry : log["entries"]) types.push_back(entry["type"]);
  EXPECT_EQ(std::count(types.begin(), types.end(), "access"), 3);
  EXPECT_THAT(types, Contains("case-closed"));
  EXPECT_EQ(kiroku({"log", "--verify"}).status, 0);
}

TEST_F(Recording, PrintsTheCaseFolderAloneOnStandardOutput) {
  const ProcessResult recorded =
      kiroku({"record", "--vitals", "synthetic:patient?speed=max", "--duration", "2s"});
  ASSERT_EQ(recorded.status, 0) << recorded.err;
  EXPECT_EQ(recorded.out, only_case().string() + "\n");
  EXPECT_THAT(recorded.err, HasSubstr("vitals"));
}

TEST_F(Recording, IsFoundByTheBeginningOfItsIdentifier) {
  const std::string name = record().filename().string();
  EXPECT_EQ(kiroku({"verify", name.substr(0, 10)}).status, 0);
  EXPECT_REFUSED(kiroku({"verify", "1999"}), "'kiroku cases' lists");
  (void)record();
  EXPECT_REFUSED(kiroku({"verify", name.substr(0, 4)}), "2 cases");
}

TEST_F(Recording, OpensWithStockTools) {
  if (!has_tool("age")) GTEST_SKIP() << "age is not installed";
  const auto segment = record() / "segments/vitals/00000000.jsonl.age";
  const ProcessResult opened =
      tool({"age", "-d", "-i", (home() / "identity.txt").string(), segment.string()});
  EXPECT_EQ(opened.status, 0) << opened.err;
  EXPECT_THAT(opened.out, testing::StartsWith("{\"time_ns\":"));
}

TEST_F(Recording, SealsTheSubjectSoThatNothingOfThePatientIsReadable) {
  write_text(folder() / "subject.json", R"({"patient": {"name": "Erika Mustermann"}})");
  const auto recorded = record({"--subject", "subject.json"});
  EXPECT_TRUE(std::filesystem::exists(recorded / "subject.json.age"));
  for (const std::string& file : files_below(home())) {
    if (!std::filesystem::is_regular_file(home() / file)) continue;
    EXPECT_THAT(read_text(home() / file), Not(HasSubstr("Mustermann"))) << file;
  }
  EXPECT_THAT(
      kiroku({"unseal", "-i", (home() / "identity.txt").string(), (recorded / "subject.json.age").string()})
          .out,
      HasSubstr("Erika Mustermann"));
}

TEST_F(Recording, TakesPatientAndProcedureFromTheWorklist) {
  if (!has_worklist_server()) GTEST_SKIP() << "wlmscpfs is not installed (Debian package dcmtk)";
  WorklistServer server(folder() / "worklist");
  write_text(home() / "kiroku.toml", read_text(home() / "kiroku.toml") + R"(
[[room]]
name = "or-2"
[room.procedure.worklist]
address = "127.0.0.1:)" + std::to_string(server.port()) +
                                         R"("
called_ae = "RIS"
timeout = "1s"
[[room.stream]]
name = "endoscope"
source = "synthetic:endoscope"
)");
  const std::vector<std::string> recording = {
      "record", "--endoscope", "synthetic:endoscope?size=64x48&rate=10&speed=max", "--duration", "1s"};
  const auto with = [&](std::vector<std::string> more) {
    more.insert(more.begin(), recording.begin(), recording.end());
    return kiroku(more);
  };
  EXPECT_REFUSED(with({"--worklist", "or-3"}), "these have one: or-2");
  EXPECT_REFUSED(with({"--worklist", "or-2", "--subject", "subject.json"}), "not from both");

  // One that does not answer holds up nothing, but says so.
  const ProcessResult without = with({"--worklist", "or-2"});
  EXPECT_EQ(without.status, 0);
  EXPECT_THAT(without.err, HasSubstr("recording without patient and procedure"));

  server.add("12", "Listed^Lisa", compact_local_time("%Y%m%d"), compact_local_time("%H%M"));
  server.start();
  const ProcessResult listed = with({"--worklist", "or-2"});
  EXPECT_EQ(listed.status, 0);
  EXPECT_THAT(listed.err, HasSubstr("from the worklist: Listed^Lisa, born 1980-01-15, number 12"));
  const std::filesystem::path recorded = listed.out.substr(0, listed.out.find('\n'));
  const auto subject = nlohmann::json::parse(
      kiroku({"unseal", "-i", (home() / "identity.txt").string(), (recorded / "subject.json.age").string()})
          .out);
  EXPECT_EQ(subject["patient"]["family"], "Listed");
  EXPECT_EQ(subject["origin"], "worklist");
}

TEST_F(Recording, SealsOneStreamToOtherRecipients) {
  if (!has_tool("age-keygen")) GTEST_SKIP() << "age-keygen is not installed";
  ASSERT_EQ(tool({"age-keygen", "-o", "nurse.txt"}).status, 0);
  write_text(folder() / "nurses.txt", tool({"age-keygen", "-y", "nurse.txt"}).out);
  const auto recorded = record({"--recipients-for", "vitals=nurses.txt"});
  const auto open = [&](const char* identity, const char* file) {
    return kiroku({"unseal", "-i", identity, "-o", "opened", (recorded / "segments" / file).string()}).status;
  };
  const std::string usual = (home() / "identity.txt").string();
  EXPECT_EQ(open("nurse.txt", "vitals/00000000.jsonl.age"), 0);
  EXPECT_EQ(open("nurse.txt", "endoscope/00000000.ts.age"), 2);
  EXPECT_EQ(open(usual.c_str(), "vitals/00000000.jsonl.age"), 2);
  EXPECT_EQ(open(usual.c_str(), "endoscope/00000000.ts.age"), 0);
  EXPECT_REFUSED(kiroku({"record", "--vitals", "synthetic:patient", "--duration", "1s", "--recipients-for",
                         "room=nurses.txt"}),
                 "'room'");
}

TEST_F(Recording, TakesItsRecipientsAndProfileFromTheConfiguration) {
  write_text(home() / "kiroku.toml",
             "[recording]\nprofile = \"lossless\"\n[[authority]]\nname = \"own\"\nurl = \"embedded\"\n");
  const auto recorded = record();
  const auto report = kiroku_json({"verify", "--json", recorded.string()});
  EXPECT_EQ(report["streams"][0]["profile"], "lossless");
  EXPECT_TRUE(std::filesystem::exists(recorded / "tokens")) << "no tokens";
  EXPECT_THAT(files_below(recorded / "tokens"), Contains(HasSubstr(".own.tsr")));
  std::size_t changes = 0;
  const auto log = kiroku_json({"log", "--json"});
  for (const auto& entry : log["entries"]) changes += entry["type"] == "config-changed" ? 1U : 0U;
  EXPECT_EQ(changes, 2U);
}

TEST_F(Recording, IsClosedProperlyByCtrlC) {
  Process process(endless());
  ASSERT_TRUE(wait_for_segment());
  process.signal(SIGINT);
  const ProcessResult ended = process.wait();
  EXPECT_EQ(ended.status, 0) << ended.err;
  EXPECT_EQ(ended.out, only_case().string() + "\n");
  EXPECT_THAT(ended.err, HasSubstr("closing the case"));
  EXPECT_EQ(kiroku({"verify", only_case().string()}).status, 0);
  EXPECT_THAT(read_text(only_case() / "ledger.jsonl"), HasSubstr(R"("reason":"operator")"));
}

TEST_F(Recording, IsLeftUnclosedByCtrlCTwiceAndSaysSo) {
  Process process(endless());
  ASSERT_TRUE(wait_for_segment());
  // Both while the program cannot run in between.
  process.signal(SIGSTOP);
  process.signal(SIGINT);
  process.signal(SIGTERM);
  process.signal(SIGCONT);
  const ProcessResult ended = process.wait();
  EXPECT_EQ(ended.status, 130) << ended.err;
  EXPECT_EQ(ended.out, "");
  const auto report = nlohmann::json::parse(kiroku({"verify", "--json", only_case().string()}).out);
  EXPECT_EQ(report["verdict"], "incomplete");
  EXPECT_EQ(kiroku({"verify", only_case().string()}).status, 3);
  EXPECT_THAT(kiroku({"cases"}).out, HasSubstr("open"));
}

TEST_F(Recording, ShowsOneLiveLineOnATerminalAndNoneElsewhere) {
  Process::Options run = endless();
  run.terminal = true;
  Process process(run);
  EXPECT_TRUE(process.wait_for("recording 0:01  endoscope "));
  // Ctrl-C as the terminal sends it.
  process.type("\x03");
  const ProcessResult on_terminal = process.wait();
  EXPECT_EQ(on_terminal.status, 0);
  EXPECT_THAT(on_terminal.out, HasSubstr("\r\x1b[K"));

  const ProcessResult piped = kiroku({"record", "--vitals", "synthetic:patient", "--duration", "1s"});
  EXPECT_THAT(piped.out + piped.err, Not(HasSubstr("\x1b")));
  EXPECT_THAT(piped.err, Not(HasSubstr("\r")));
}

TEST_F(Recording, GoesOnWithoutAnAuthorityThatCannotBeReached) {
  write_text(home() / "kiroku.toml",
             "[[authority]]\nname = \"gone\"\nurl = \"http://127.0.0.1:9/\"\nconnect_timeout = \"2s\"\n"
             "[[authority]]\nname = \"own\"\nurl = \"embedded\"\n");
  const auto recorded = record();
  const auto report = kiroku_json({"verify", "--json", recorded.string()});
  EXPECT_EQ(report["verdict"], "intact-with-gaps");
  EXPECT_THAT(codes(report), HasSubstr("token-missed"));
  EXPECT_THAT(read_text(recorded / "ledger.jsonl"), HasSubstr(R"("authority":"gone")"));
}

TEST_F(Recording, GoesOnWhenAnAuthorityAnswersWithAWebPage) {
  if (!has_tool("python3")) GTEST_SKIP() << "python3 is not installed";
  Process::Options page = options({});
  page.command = {
      "python3", "-u", "-c",
      "import http.server\n"
      "class Page(http.server.BaseHTTPRequestHandler):\n"
      "  def do_POST(self):\n"
      "    self.rfile.read(int(self.headers['Content-Length']))\n"
      "    self.send_response(200); self.send_header('Content-Type', 'text/html'); self.end_headers()\n"
      "    self.wfile.write(b'<html>please log in</html>')\n"
      "server = http.server.HTTPServer(('127.0.0.1', 0), Page)\n"
      "print('port', server.server_port, 'ready')\n"
      "server.serve_forever()\n"};
  Process server(page);
  ASSERT_TRUE(server.wait_for(" ready"));
  const std::string port = server.out().substr(5, server.out().find(" ready") - 5);
  write_text(home() / "kiroku.toml",
             "[[authority]]\nname = \"portal\"\nurl = \"http://127.0.0.1:" + port + "/\"\n");
  const auto recorded = record();
  const ProcessResult verified = kiroku({"verify", "--json", recorded.string()});
  EXPECT_EQ(verified.status, 3) << verified.out;
  const auto report = nlohmann::json::parse(verified.out);
  EXPECT_EQ(report["verdict"], "unproven");
  EXPECT_THAT(codes(report), HasSubstr("token-missed"));
}

TEST_F(Recording, CountsATokenUnderAnUnknownRootAsMissed) {
  // The home of another recorder: its authority's root is not among the trusted ones here.
  Process::Options other = options({"init", "--demo", "--home", path("other")});
  ASSERT_EQ(run_process(other).status, 0);
  Process authority(options({"tsa", "serve", "--home", path("other"), "--listen", "127.0.0.1:0", "--json"}));
  ASSERT_TRUE(authority.wait_for("}\n"));
  const std::string url = nlohmann::json::parse(authority.out()).at("url");
  write_text(home() / "kiroku.toml", "[[authority]]\nname = \"foreign\"\nurl = \"" + url + "\"\n");
  const auto recorded = record();
  EXPECT_THAT(files_below(recorded / "tokens"), ElementsAre());
  EXPECT_THAT(read_text(recorded / "ledger.jsonl"), HasSubstr("token-missed"));
  EXPECT_EQ(kiroku({"verify", recorded.string()}).status, 3);
}

TEST_F(Recording, AsksOnlyTheAuthoritiesThatAreNamed) {
  write_text(home() / "kiroku.toml",
             "[[authority]]\nname = \"gone\"\nurl = \"http://127.0.0.1:9/\"\n"
             "[[authority]]\nname = \"own\"\nurl = \"embedded\"\n");
  const auto recorded = record({"--authority", "own"});
  EXPECT_EQ(kiroku_json({"verify", "--json", recorded.string()})["verdict"], "intact");
  EXPECT_REFUSED(kiroku({"record", "--vitals", "synthetic:patient", "--authority", "own2"}),
                 "there are: gone, own");
}

TEST_F(Recording, NeverShowsASecret) {
  const std::string identity_file = read_text(home() / "identity.txt");
  const std::string secret = identity_file.substr(identity_file.find("AGE-SECRET-KEY-1"), 74);
  const std::string key = read_text(home() / "device.key").substr(30, 40);
  const auto recorded = record();
  std::string said;
  for (const Arguments& arguments : std::vector<Arguments>{
           {"verify", "-i", (home() / "identity.txt").string(), recorded.string()},
           {"verify", "--json", recorded.string()},
           {"export", recorded.string(), "--stream", "vitals", "-o", "vitals.jsonl"},
           {"unseal", "-i", (home() / "identity.txt").string(), (home() / "kiroku.toml").string()},
           {"seal", "-r", secret, "-o", "sealed", "film"},
           {"cases", "--json"},
           {"log"}}) {
    const ProcessResult result = kiroku(arguments);
    if (arguments[0] != "seal") said += result.out + result.err;
  }
  EXPECT_THAT(said, Not(HasSubstr(secret)));
  for (const std::string& file : files_below(home())) {
    if (!std::filesystem::is_regular_file(home() / file)) continue;
    const std::string bytes = read_text(home() / file);
    if (file != "identity.txt") {
      EXPECT_THAT(bytes, Not(HasSubstr(secret))) << file;
    }
    if (file != "device.key") {
      EXPECT_THAT(bytes, Not(HasSubstr(key))) << file;
    }
  }
}

}  // namespace
}  // namespace kiroku::test

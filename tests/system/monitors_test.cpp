// Vital signs of monitors through the whole program: delivered over MLLP by a player, recorded, verified,
// exported.
#include <csignal>
#include <map>
#include <sstream>

#include "tests/support/build_paths.h"
#include "tests/support/reserved_port.h"
#include "tests/support/shared_data.h"
#include "tests/system/program_test.h"

namespace kiroku::test {
namespace {

using testing::HasSubstr;

std::string free_address() { return "127.0.0.1:" + std::to_string(reserved_port()); }

class Monitors : public ProgramTest {
 protected:
  void SetUp() override { make_demo_home(); }

  [[nodiscard]] Process::Options recording(const std::string& source) const {
    return options({"record", "--vitals", source, "--json", "--segment", "1s"});
  }
  [[nodiscard]] ProcessResult play(const Arguments& arguments) const {
    Arguments command{built_file("mllp_player")};
    command.insert(command.end(), arguments.begin(), arguments.end());
    return tool(command);
  }
  /// Stops a recording; the case folder.
  [[nodiscard]] static std::string stop(Process& recorder) {
    recorder.signal(SIGINT);
    const ProcessResult result = recorder.wait();
    EXPECT_EQ(result.status, 0) << result.err;
    const auto answer = nlohmann::json::parse(result.out, nullptr, false);
    return answer.is_object() ? answer.value("case", "") : "";
  }
  /// Its vital signs, after it was found intact with every segment opened.
  [[nodiscard]] std::vector<nlohmann::json> lines_of(const std::string& recorded) const {
    const auto report =
        kiroku_json({"verify", "--json", "--identity", (home() / "identity.txt").string(), recorded});
    EXPECT_EQ(report["verdict"], "intact") << report.dump(1);
    const auto exported =
        kiroku_json({"export", recorded, "--stream", "vitals", "-o", "vitals.jsonl", "--json"});
    EXPECT_EQ(exported["stream"], "vitals");
    std::vector<nlohmann::json> lines;
    std::istringstream text(read_text(folder() / "vitals.jsonl"));
    for (std::string line; std::getline(text, line);) {
      lines.push_back(nlohmann::json::parse(line));
    }
    return lines;
  }
};

TEST_F(Monitors, EightWaveformsAt500HertzAreRecordedWithoutLoss) {
  const std::string address = free_address();
  Process recorder(recording("mllp://" + address));
  const ProcessResult played = play({address, "--waves", "8x500x6"});
  EXPECT_EQ(played.status, 0) << played.err;
  EXPECT_EQ(played.out, "sent 6, AA 6, AE 0, AR 0, wrong 0\n");
  std::map<std::string, std::vector<double>> waves;
  std::size_t messages = 0, samples = 0;
  for (const nlohmann::json& line : lines_of(stop(recorder))) {
    messages += line.value("kind", "") == "message" ? 1U : 0U;
    if (line.contains("values")) {
      // Eight channels of one code: in the order of each message.
      const std::string channel = std::to_string(samples++ % 8);
      for (const auto& value : line["values"]) waves[channel].push_back(value.get<double>());
      EXPECT_EQ(line["rate_hz"], 500);
      EXPECT_EQ(line["unit"], "mV");
    }
  }
  EXPECT_EQ(messages, 6U);
  ASSERT_EQ(waves.size(), 8U);
  for (const auto& [channel, values] : waves) {
    ASSERT_EQ(values.size(), 3000U) << channel;
    for (std::size_t i = 0; i < values.size(); ++i) ASSERT_EQ(values[i], static_cast<double>(i)) << channel;
  }
}

TEST_F(Monitors, AMessageOfEachKindStandsInTheCase) {
  write_text(folder() / "monitor.hl7",
             "MSH|^~\\&|MON||||20260101120000+0530||ORU^R01|1|P|2.6\r"
             "OBX|1|NM|150456^MDC_PULS_OXIM_SAT_O2^MDC|1.3.1.150456|97|262688^MDC_DIM_PERCENT^MDC\r"
             "OBX|2|NM|147842^MDC_ECG_HEART_RATE^MDC|1.7.4.147842|-999|264864^MDC_DIM_BEAT_PER_MIN^MDC\r"
             "OBX|3|ST|2267^COMEN_ACVPU^99COMEN||Alert\rZZZ|1\r"
             "MSH|^~\\&|MON||||20260101120001+0530||ORU^R40|2|P|2.6\r"
             "OBX|1|CWE|196616^MDC_EVT_ALARM^MDC|1.1.0.0.1|196670^MDC_EVT_HI^MDC\r"
             "MSH|^~\\&|MON||||20260101120002+0530||ADT^A08|3|P|2.6\r"
             "MSH|^~\\&|MON||||20260101120000+0530||ORU^R01|4|P|2.6||||||8859/1\r"
             "NTE|1||M\xFCller\rOBX|1|NM|1^MDC_X^MDC||5\r"
             "MSH|^~\\&|MON||||20260101120000+0530||ORU^R01|4|P|2.6||||||8859/1\r"
             "NTE|1||M\xFCller\rOBX|1|NM|1^MDC_X^MDC||5\r");
  const std::string address = free_address();
  Process recorder(recording("mllp://" + address));
  const ProcessResult played = play({address, "--pipeline", "monitor.hl7"});
  EXPECT_EQ(played.out, "sent 5, AA 4, AE 0, AR 1, wrong 0\n") << played.err;
  std::map<std::string, std::vector<nlohmann::json>> by_kind;
  for (const nlohmann::json& line : lines_of(stop(recorder)))
    by_kind[line.value("kind", "sample")].push_back(line);
  ASSERT_EQ(by_kind["sample"].size(), 3U);
  EXPECT_EQ(by_kind["sample"][0]["value"], 97);
  EXPECT_EQ(by_kind["sample"][0]["device_time"], "2026-01-01T06:30:00.000000Z");
  EXPECT_EQ(by_kind["sample"][0]["source"], "MON@127.0.0.1");
  EXPECT_EQ(by_kind["sample"][1]["quality"], "missing");
  EXPECT_EQ(by_kind["text"].at(0)["text"], "Alert");
  EXPECT_EQ(by_kind["alarm"].at(0)["code"], "MDC_EVT_HI");
  for (const char* kind : {"text", "alarm"}) EXPECT_EQ(by_kind[kind][0]["quality"], "questionable") << kind;
  EXPECT_EQ(by_kind["message"].size(), 4U);
  EXPECT_TRUE(by_kind["message"].at(3).contains("base64"));
  // Its times are of another day, as those of a queue are: nobody can know its clock yet.
  EXPECT_EQ(by_kind["sample"][0]["quality"], "questionable");
  EXPECT_EQ(by_kind["device-clock"].size(), 0U);
  std::string notices;
  for (const nlohmann::json& notice : by_kind["notice"]) notices += notice["notice"].get<std::string>() + " ";
  EXPECT_EQ(notices, "segment-unknown measured-before message-refused message-repeated ");
}

TEST_F(Monitors, DeliverOverTls) {
  ASSERT_TRUE(has_tool("openssl"));
  ASSERT_EQ(tool({"openssl", "req", "-x509", "-newkey", "ed25519", "-nodes", "-days", "2", "-subj",
                  "/CN=kiroku", "-keyout", "key.pem", "-out", "certificate.pem"})
                .status,
            0);
  write_text(folder() / "monitor.hl7",
             "MSH|^~\\&|MON||||20260101120000+0000||ORU^R01|1|P|2.6\rOBX|1|NM|1^MDC_X^MDC||5\r");
  const std::string address = free_address();
  Process recorder(recording("mllps://" + address + "?certificate=certificate.pem&key=key.pem"));
  EXPECT_EQ(play({address, "--tls", "monitor.hl7"}).out, "sent 1, AA 1, AE 0, AR 0, wrong 0\n");
  const std::string recorded = stop(recorder);
  EXPECT_FALSE(lines_of(recorded).empty());
  EXPECT_THAT(read_text(std::filesystem::path(recorded) / "ledger.jsonl"),
              HasSubstr("certificate.pem&key=***"));
}

TEST_F(Monitors, AreRecordedForTheTimeAskedForThoughTheySayNothing) {
  const auto recorded = kiroku_json(
      {"record", "--vitals", "mllp://" + free_address(), "--duration", "2s", "--segment", "500ms", "--json"});
  EXPECT_TRUE(lines_of(recorded.value("case", "")).empty());
}

TEST_F(Monitors, ARealLaboratorysMessagesAreRecordedOrNamed) {
  KIROKU_NEEDS_SHARED_DATA("recording/hl7");
  Arguments arguments{"--pipeline"};
  for (const auto& entry : std::filesystem::recursive_directory_iterator(shared_data("recording/hl7"))) {
    if (entry.path().extension() == ".hl7") arguments.push_back(entry.path().string());
  }
  const std::string address = free_address();
  arguments.insert(arguments.begin(), address);
  Process recorder(recording("mllp://" + address));
  const ProcessResult played = play(arguments);
  EXPECT_EQ(played.status, 0) << played.out << played.err;
  std::size_t messages = 0, refusals = 0, repeated = 0;
  for (const nlohmann::json& line : lines_of(stop(recorder))) {
    messages += line.value("kind", "") == "message" ? 1U : 0U;
    refusals += line.value("notice", "") == "message-refused" ? 1U : 0U;
    repeated += line.value("notice", "") == "message-repeated" ? 1U : 0U;
  }
  EXPECT_THAT(played.out, HasSubstr("sent " + std::to_string(messages + repeated) + ","));
  EXPECT_GE(refusals, 20U);
}

TEST_F(Monitors, AFileOfMessagesIsASource) {
  write_text(folder() / "monitor.hl7",
             "MSH|^~\\&|MON||||20260101120000+0000||ORU^R01|1|P|2.6\rOBX|1|NM|1^MDC_X^MDC||5\r"
             "MSH|^~\\&|MON||||20260101120009+0000||ORU^R01|2|P|2.6\rOBX|1|NM|1^MDC_X^MDC||6\r");
  const auto recorded = kiroku_json({"record", "--vitals", "monitor.hl7?speed=max", "--json"});
  const auto lines = lines_of(recorded.value("case", ""));
  ASSERT_FALSE(lines.empty());
  EXPECT_EQ(lines.back()["value"], 6);
  EXPECT_EQ(lines.back()["time_ns"], 9'000'000'000);
}

TEST_F(Monitors, ARealRecordOfSignalsIsASource) {
  KIROKU_NEEDS_SHARED_DATA("recording/vitals/03700181.hea");
  const std::string header = shared_data("recording/vitals/03700181.hea").string();
  const auto recorded = kiroku_json({"record", "--vitals", header + "?speed=max", "--json"});
  std::size_t values = 0;
  for (const nlohmann::json& line : lines_of(recorded.value("case", ""))) {
    values += line.contains("values") ? line["values"].size() : 0U;
  }
  EXPECT_EQ(values, (4 + 1 + 1) * 75'000U);
}

TEST_F(Monitors, APortThatIsTakenIsToldBeforeThereIsACase) {
  const std::string address = free_address();
  Process recorder(recording("mllp://" + address));
  write_text(folder() / "monitor.hl7", "MSH|^~\\&|MON||||||ORU^R01|1|P|2.6\rOBX|1|NM|1^MDC_X^MDC||5\r");
  ASSERT_EQ(play({address, "monitor.hl7"}).status, 0);  // now it listens
  // Another home, since one recorder alone may record into an archive.
  ASSERT_EQ(kiroku({"init", "--demo", "--home", path("other")}).status, 0);
  EXPECT_REFUSED(kiroku({"record", "--home", path("other"), "--vitals", "mllp://" + address}),
                 "cannot wait for monitors at " + address);
  EXPECT_NE(stop(recorder), "");
}

}  // namespace
}  // namespace kiroku::test

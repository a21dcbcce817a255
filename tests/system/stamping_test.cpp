// Authorities that cannot be reached while a case is recorded, and come back later.
#include <chrono>
#include <csignal>

#include "tests/support/reserved_port.h"
#include "tests/system/program_test.h"

namespace kiroku::test {
namespace {

using testing::HasSubstr;
using testing::SizeIs;

class Stamping : public ProgramTest {
 protected:
  void SetUp() override {
    make_demo_home();
    url_ = "http://127.0.0.1:" + std::to_string(reserved_port()) + "/";  // nobody listens there yet
    configure("outside");
  }
  void configure(const std::string& name) const {
    write_text(home() / "kiroku.toml", "[[authority]]\nname = \"" + name + "\"\nurl = \"" + url_ + "\"\n");
  }
  [[nodiscard]] std::unique_ptr<Process> authority(const std::string& listen) const {
    auto process = std::make_unique<Process>(options({"tsa", "serve", "--listen", listen, "--json"}));
    EXPECT_TRUE(process->wait_for("}\n"));
    return process;
  }
  /// The authority at the address that the home is configured for.
  [[nodiscard]] std::unique_ptr<Process> authority_returns() const {
    std::string address = url_.substr(std::string("http://").size());
    address.pop_back();
    return authority(address);
  }
  [[nodiscard]] nlohmann::json verify(const std::filesystem::path& folder) const {
    return nlohmann::json::parse(kiroku({"verify", "--json", folder.string()}).out);
  }
  std::string url_;
};

TEST_F(Stamping, ACaseRecordedDuringAnOutageIsStampedWhenTheAuthorityIsBack) {
  const auto folder = record();
  EXPECT_EQ(verify(folder).at("verdict"), "unproven");

  const ProcessResult still_down = kiroku({"stamp", "--json"});
  EXPECT_EQ(still_down.status, 3) << still_down.err;
  const auto waiting = nlohmann::json::parse(still_down.out).at("waiting");
  ASSERT_THAT(waiting, SizeIs(1));
  EXPECT_EQ(waiting[0].at("case"), folder.filename().string());
  EXPECT_EQ(waiting[0].at("authority"), "outside");
  EXPECT_THAT(waiting[0].at("reason").get<std::string>(), HasSubstr("is unreachable"));

  const auto server = authority_returns();
  const auto stamped = kiroku_json({"stamp", "--json"});
  ASSERT_THAT(stamped.at("stamped"), SizeIs(1));
  EXPECT_EQ(stamped.at("stamped")[0].at("path"), "directly");
  const auto report = verify(folder);
  EXPECT_EQ(report.at("verdict"), "intact-with-gaps") << report.at("findings");
  EXPECT_EQ(report.at("tokens"), 1);
  EXPECT_EQ(kiroku({"log", "--verify"}).status, 0);
  EXPECT_EQ(kiroku_json({"cases", "--json"}).at("cases")[0].at("tokens"), 1);
  const ProcessResult nothing = kiroku({"stamp"});
  EXPECT_EQ(nothing.status, 0);
  EXPECT_EQ(nothing.out, "No time-stamp is wanted.\n");
}

TEST_F(Stamping, WatchingStampsWhatIsWantedUntilItIsStopped) {
  const auto folder = record();
  // Another name is another authority, which nobody has failed to reach yet.
  configure("second");
  const auto server = authority_returns();
  Process watch(options({"stamp", "--watch", "--case", folder.filename().string()}));
  EXPECT_TRUE(watch.wait_for("stamped by second"));
  watch.signal(SIGTERM);
  const ProcessResult ended = watch.wait();
  EXPECT_EQ(ended.status, 0) << ended.err;
  EXPECT_THAT(ended.out, HasSubstr("not wanted from outside any more: no authority of that name"));
  EXPECT_EQ(verify(folder).at("verdict"), "intact-with-gaps");
}

TEST_F(Stamping, ACaseThatIsBeingRecordedWaitsForItsRecorder) {
  Process recording(
      options({"record", "--endoscope", "synthetic:endoscope?size=64x48&rate=10", "--segment", "500ms"}));
  const auto wanted = [&] {
    const auto answer = nlohmann::json::parse(kiroku({"stamp", "--json"}).out, nullptr, false);
    return answer.is_object() && !answer.at("waiting").empty() ? answer.at("waiting")[0].at("reason")
                                                               : nlohmann::json();
  };
  nlohmann::json reason;
  // A disk that others write to may hold up a recorder's first writes for many seconds.
  const auto patience = std::chrono::steady_clock::now() + std::chrono::seconds(60);
  while (!reason.is_string() && std::chrono::steady_clock::now() < patience) reason = wanted();
  if (!reason.is_string()) {
    recording.signal(SIGINT);
    FAIL() << "nothing waits; the recorder said: " << recording.wait().err;
  }
  EXPECT_THAT(reason.get<std::string>(), HasSubstr("another process is writing"));
  recording.signal(SIGINT);
  EXPECT_EQ(recording.wait().status, 0);
}

TEST_F(Stamping, ReportsHowTheAuthoritysClockStoodToTheRecorders) {
  const auto server = authority_returns();
  const auto folder =
      record({"--stamp-every", "1s", "--room", "synthetic:room?size=64x48&rate=10"}, "00:00:03");
  const auto report = verify(folder);
  EXPECT_EQ(report.at("verdict"), "intact") << report.at("findings");
  ASSERT_THAT(report.at("clocks"), SizeIs(1));
  const auto& clock = report.at("clocks")[0];
  EXPECT_EQ(clock.at("authority"), "outside");
  EXPECT_GE(clock.at("comparisons").get<int>(), 3);
  // Both are this machine's clock.
  for (const char* which : {"first", "last"}) {
    const auto& comparison = clock.at(which);
    EXPECT_LE(std::abs(comparison.at("offset_ns").get<double>()),
              comparison.at("half_width_ns").get<double>() + 1e6);
    EXPECT_LT(comparison.at("half_width_ns").get<double>(), 5e9);
  }
  EXPECT_LE(std::abs(clock.at("drift_ns").get<double>()),
            clock.at("drift_half_width_ns").get<double>() + 1e6);
  EXPECT_THAT(kiroku({"verify", folder.string()}).out, HasSubstr("outside's clock "));
}

TEST_F(Stamping, RefusesWhatItCannotDo) {
  EXPECT_REFUSED(kiroku({"stamp", "--case", "1999"}), "'kiroku cases' lists");
  const auto elsewhere = folder() / "20260101T000000Z-00000000";
  std::filesystem::create_directory(elsewhere);
  EXPECT_REFUSED(kiroku({"stamp", "--case", elsewhere.string()}), "only the recorder that recorded a case");
  write_text(home() / "kiroku.toml", "[recording]\n");
  EXPECT_REFUSED(kiroku({"stamp"}), "names no time-stamping authority");
}

}  // namespace
}  // namespace kiroku::test

// What is plugged in, as a technician asks for it: a played camera (tests/support/played_camera.cpp) and
// a played monitor.
#include <csignal>

#include "tests/support/build_paths.h"
#include "tests/support/mllp_client.h"
#include "tests/support/reserved_port.h"
#include "tests/system/program_test.h"

namespace kiroku::test {
namespace {

using testing::HasSubstr;
using testing::Not;

constexpr const char* kDevice = "/dev/full";

class Devices : public ProgramTest {
 protected:
  [[nodiscard]] Process::Options with_camera(const Arguments& arguments,
                                             const std::string& pictures = "40") const {
    Process::Options started = options(arguments);
    started.environment["LD_PRELOAD"] = built_file("played_camera");
    started.environment["KIROKU_CAMERA_DEVICE"] = kDevice;
    write_text(folder() / "given", std::string(8, '\0'));
    started.environment["KIROKU_CAMERA_GIVEN"] = (folder() / "given").string();
    started.environment["KIROKU_CAMERA_PICTURES"] = pictures;
    started.environment["KIROKU_CAMERA_THEN"] = "silent";
    return started;
  }
  static bool can_preload() { return std::string(KIROKU_SANITIZERS).empty(); }
};

TEST_F(Devices, AreListedOnAMachineWithoutAHome) {
  const auto all = kiroku_json({"devices", "--json"});
  for (const char* kind : {"cameras", "sound", "serial", "monitors"}) EXPECT_TRUE(all[kind].is_array());
  const ProcessResult told = kiroku({"devices"});
  EXPECT_EQ(told.status, 0) << told.err;
  for (const char* kind : {"Cameras\n", "Sound\n", "Serial ports\n", "Monitors\n"}) {
    EXPECT_THAT(told.out, HasSubstr(kind));
  }
}

TEST_F(Devices, ShowWhatACameraGivesAndSees) {
  if (!can_preload()) GTEST_SKIP() << "a sanitizer's library must be the first one that is loaded";
  const ProcessResult looked =
      run_process(with_camera({"devices", "--camera", kDevice, "--stills", "looks", "--json"}));
  ASSERT_EQ(looked.status, 0) << looked.out << looked.err;
  const auto camera = nlohmann::json::parse(looked.out)["cameras"][0];
  EXPECT_EQ(camera["name"], "played camera");
  EXPECT_EQ(camera["driver"], "played");
  EXPECT_EQ(camera["gives_pictures"], true);
  EXPECT_EQ(camera["modes"][0]["format"], "yuyv422");
  EXPECT_EQ(camera["modes"][0]["width"], 64);
  EXPECT_EQ(camera["modes"][0]["rate"], 20);
  EXPECT_EQ(camera["source"], "/dev/full?size=64x48&rate=20&format=yuyv422");
  EXPECT_EQ(camera["still"]["file"], "looks/full.png");
  EXPECT_EQ(camera["still"]["input"], "64x48 yuyv422, 20 a second");
  const std::string picture = read_text(folder() / "looks/full.png");
  EXPECT_EQ(picture.substr(0, 8), "\x89PNG\r\n\x1a\n");
  EXPECT_EQ(picture.substr(16, 8), std::string("\0\0\0\x40\0\0\0\x30", 8)) << "64 x 48";
  EXPECT_REFUSED(run_process(with_camera({"devices", "--camera", kDevice, "--stills", "looks"})), "--force");
  EXPECT_EQ(run_process(with_camera({"devices", "--camera", kDevice, "--stills", "looks", "--force"})).status,
            0);
}

TEST_F(Devices, SayWhichRoomRecordsACamera) {
  if (!can_preload()) GTEST_SKIP() << "a sanitizer's library must be the first one that is loaded";
  make_demo_home();
  write_text(home() / "kiroku.toml", read_text(home() / "kiroku.toml") + R"(
[[room]]
name = "or-1"
[[room.stream]]
name = "endoscope"
source = "/dev/full?size=64x48"
[[room.stream]]
name = "vitals"
kind = "vitals"
source = "mllp://0.0.0.0:2575?allow=192.168.7.20"
)");
  const ProcessResult told = run_process(with_camera({"devices", "--camera", kDevice, "--json"}));
  ASSERT_EQ(told.status, 0) << told.err;
  EXPECT_EQ(nlohmann::json::parse(told.out)["cameras"][0]["stream"], "or-1/endoscope");
  EXPECT_THAT(kiroku({"devices"}).out, HasSubstr("or-1/vitals: mllp://0.0.0.0:2575?allow=192.168.7.20"));
}

TEST_F(Devices, SayWhatIsWrongWithACamera) {
  const ProcessResult none = kiroku({"devices", "--camera", "/dev/null"});
  EXPECT_EQ(none.status, 1);
  EXPECT_THAT(none.out, HasSubstr("/dev/null is no camera: it does not answer as a V4L2 device"));
  if (!can_preload()) GTEST_SKIP() << "a sanitizer's library must be the first one that is loaded";
  const ProcessResult dark =
      run_process(with_camera({"devices", "--camera", kDevice, "--stills", "looks"}, "0"));
  EXPECT_EQ(dark.status, 1) << dark.out << dark.err;
  EXPECT_THAT(dark.out, HasSubstr("problem"));
  EXPECT_FALSE(std::filesystem::exists(folder() / "looks/full.png"));
  EXPECT_FALSE(std::filesystem::exists(folder() / "looks/full.png.part"));
}

TEST_F(Devices, HearMonitorsAndAcknowledgeNothing) {
  const std::uint16_t port = reserved_port();
  const std::string address = "mllp://127.0.0.1:" + std::to_string(port);
  Process listening(options({"devices", "--monitors", address, "--for", "10m", "--json"}));
  ASSERT_TRUE(listening.wait_for("waiting for monitors at " + address));
  MllpClient monitor("127.0.0.1", port);
  monitor.send_message(
      "MSH|^~\\&|MON|OR1|||20260101120000+0000||ORU^R01|1|P|2.6\rPID|1||4711||DOE^JANE\rPV1|1|I|SURG^OR1\r"
      "OBX|1|NM|147842^MDC_ECG_HEART_RATE^MDC||72\r");
  ASSERT_TRUE(listening.wait_for("heard 127.0.0.1, MON/OR1"));
  listening.signal(SIGINT);
  const ProcessResult ended = listening.wait();
  ASSERT_EQ(ended.status, 0) << ended.err;
  EXPECT_EQ(monitor.receive(), std::nullopt) << "acknowledged";
  const auto heard = nlohmann::json::parse(ended.out)["heard"]["monitors"];
  ASSERT_EQ(heard.size(), 1U) << ended.out;
  EXPECT_EQ(heard[0]["address"], "127.0.0.1");
  EXPECT_EQ(heard[0]["types"], nlohmann::json::array({"ORU^R01"}));
  EXPECT_EQ(heard[0]["quantities"], nlohmann::json::array({"MDC_ECG_HEART_RATE"}));
  EXPECT_EQ(heard[0]["places"], nlohmann::json::array({"SURG^OR1"}));
  EXPECT_THAT(ended.out + ended.err, Not(HasSubstr("DOE")));
  EXPECT_EQ(heard[0]["source"], address + "?allow=127.0.0.1&sender=MON/OR1");
}

}  // namespace
}  // namespace kiroku::test

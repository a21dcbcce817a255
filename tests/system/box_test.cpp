// Programs where the decoder's box is there, is not there, or is what the systemd unit leaves of it.
#include <array>
#include <csignal>
#include <fcntl.h>
#include <functional>
#include <iterator>
#include <map>
#include <set>
#include <spawn.h>
#include <sstream>
#include <sys/wait.h>
#include <unistd.h>

#include <boost/asio/ip/tcp.hpp>

#include "base/descriptor.h"
#include "tests/support/build_paths.h"
#include "tests/support/child_processes.h"
#include "tests/support/eventually.h"
#include "tests/support/reserved_port.h"
#include "tests/system/program_test.h"

namespace kiroku::test {
namespace {

using testing::HasSubstr;
using testing::Not;

constexpr const char* kUnboxed = "is decoded without a box, beside the device key: ";

class Box : public ProgramTest {
 protected:
  void SetUp() override { make_demo_home(); }

  /// Three seconds of 10 pictures each.
  [[nodiscard]] std::string film() const {
    std::string text = "YUV4MPEG2 W64 H48 F10:1 Ip A1:1 C420jpeg\n";
    for (int i = 0; i < 30; ++i) text += "FRAME\n" + std::string(64 * 48 * 3 / 2, static_cast<char>(i));
    write_text(folder() / "film.y4m", text);
    return path("film.y4m");
  }
  /// Makes a room of one film that is repeated.
  void make_room() const {
    write_text(home() / "kiroku.toml", read_text(home() / "kiroku.toml") + "\n[[room]]\nname = \"or-1\"\n" +
                                           "[[room.stream]]\nname = \"endoscope\"\nsource = \"" + film() +
                                           "?loop=1\"\n[daemon]\nsocket = \"" + path("s") +
                                           "\"\nlisten = \"127.0.0.1:" + std::to_string(port_) + "\"\n");
  }
  [[nodiscard]] std::string metrics() const {
    boost::asio::ip::tcp::iostream connection("127.0.0.1", std::to_string(port_));
    connection << "GET /metrics HTTP/1.1\r\nHost: localhost\r\nConnection: close\r\n\r\n" << std::flush;
    return {std::istreambuf_iterator<char>(connection), {}};
  }
  /// Records a case until it has pictures; what kirokud wrote to standard error.
  [[nodiscard]] std::string record_with(const Arguments& kirokud, bool is_unboxed) const {
    Process::Options started = options({});
    started.command = kirokud;
    Process daemon(started);
    EXPECT_TRUE(daemon.wait_for("recording for 1 room")) << daemon.out();
    const std::string id = kiroku_json({"case", "start", "--json"})["case"];
    const auto frames = [&] {
      return kiroku_json({"status", "--json"})["rooms"][0]["streams"][0]["frames"].get<int>();
    };
    EXPECT_TRUE(eventually([&] { return frames() > 0; })) << daemon.out();
    const nlohmann::json stream = kiroku_json({"status", "--json"})["rooms"][0]["streams"][0];
    EXPECT_EQ(stream["unboxed"], is_unboxed) << stream;
    EXPECT_EQ(kiroku({"status"}).out.find("endoscope: decoded without a box") != std::string::npos,
              is_unboxed);
    EXPECT_THAT(metrics(), HasSubstr("kiroku_stream_unboxed{room=\"or-1\",stream=\"endoscope\"} " +
                                     std::string(is_unboxed ? "1" : "0")));
    EXPECT_EQ(kiroku({"case", "stop"}).status, 0);
    daemon.signal(SIGTERM);
    const ProcessResult ended = daemon.wait();
    EXPECT_EQ(ended.status, 0) << ended.err;
    const ProcessResult verified = kiroku({"verify", (home() / "archive" / id).string()});
    EXPECT_EQ(verified.status, 0) << verified.out << verified.err;
    return ended.err;
  }
  const std::uint16_t port_ = reserved_port();
  /// The program alone, where no decoder is beside it.
  [[nodiscard]] std::string alone(const std::string& program) const {
    const std::filesystem::path there = folder() / "alone" / program;
    std::filesystem::create_directories(there.parent_path());
    const std::filesystem::path built =
        program == "kiroku-full" ? std::filesystem::path(built_file("kiroku")).parent_path() / program
                                 : std::filesystem::path(built_file(program));
    std::error_code other_disk;
    std::filesystem::create_hard_link(built, there, other_disk);
    if (other_disk) std::filesystem::copy_file(built, there);
    return there.string();
  }
};

TEST_F(Box, ARecorderHoldsNothingForOthers) {
  make_room();
  Process::Options started = options({});
  started.command = {built_file("kirokud")};
  Process daemon(started);
  ASSERT_TRUE(daemon.wait_for("recording for 1 room"));
  const std::vector<pid_t> found = child_processes();
  ASSERT_EQ(found.size(), 1U);
  EXPECT_EQ(line_of_process(found[0], "status", "NoNewPrivs:"), "1");
  EXPECT_THAT(line_of_process(found[0], "limits", "Max core file size"), testing::StartsWith("0 "));
  EXPECT_THAT(daemon.out(), Not(HasSubstr("without a box")));
}

// Each opens segments with an identity, or signs.
TEST(ProgramsThatHoldKeys, LeaveNoCoreAndGainNoRights) {
  for (const char* const name : {"kiroku", "kirokud", "kiroku-verify"}) {
    // It has begun once a byte comes, and waits for the rest to be read.
    std::array<int, 2> ends{};
    ASSERT_EQ(::pipe2(ends.data(), O_CLOEXEC), 0);
    const Descriptor reading(ends[0]);
    Descriptor writing(ends[1]);
    ASSERT_GE(::fcntl(writing.number(), F_SETPIPE_SZ, 4096), 0);
    posix_spawn_file_actions_t actions;
    ASSERT_EQ(::posix_spawn_file_actions_init(&actions), 0);
    ASSERT_EQ(::posix_spawn_file_actions_adddup2(&actions, writing.number(), STDOUT_FILENO), 0);
    std::string program = built_file(name), help = "--help";
    std::array<char*, 3> arguments{program.data(), help.data(), nullptr};
    pid_t started = 0;
    ASSERT_EQ(::posix_spawn(&started, program.c_str(), &actions, nullptr, arguments.data(), environ), 0);
    ::posix_spawn_file_actions_destroy(&actions);
    writing = Descriptor();
    char first = 0;
    EXPECT_EQ(::read(reading.number(), &first, 1), 1) << name;
    EXPECT_EQ(line_of_process(started, "status", "NoNewPrivs:"), "1") << name;
    EXPECT_THAT(line_of_process(started, "limits", "Max core file size"), testing::StartsWith("0 ")) << name;
    ::kill(started, SIGKILL);
    ASSERT_EQ(::waitpid(started, nullptr, 0), started);
  }
}

TEST_F(Box, TheUnitLetsTheDecoderCloseItsBox) {
  if (std::string(KIROKU_SANITIZERS) != "") GTEST_SKIP() << "a sanitizer makes calls that no unit allows";
  if (!has_tool("systemd-analyze")) GTEST_SKIP() << "the unit's groups of calls are systemd's";
  std::map<std::string, std::set<std::string>> groups;
  const std::function<std::set<std::string>(const std::string&)> calls_of = [&](const std::string& item) {
    if (item[0] != '@') return std::set{item};
    if (groups.contains(item)) return groups[item];
    const ProcessResult listed = tool({"systemd-analyze", "syscall-filter", "--no-pager", item});
    EXPECT_EQ(listed.status, 0) << listed.err;
    std::set<std::string> calls;
    std::istringstream words(listed.out);
    std::string line;
    for (std::getline(words, line); std::getline(words, line);) {
      const std::size_t begin = line.find_first_not_of(' ');
      if (begin == std::string::npos || line[begin] == '#') continue;
      calls.merge(calls_of(line.substr(begin)));
    }
    return groups[item] = calls;
  };
  std::set<std::string> allowed = calls_of("@default");
  std::istringstream unit(read_text(source_folder() / "deploy/systemd/kirokud.service"));
  for (std::string line; std::getline(unit, line);) {
    if (!line.starts_with("SystemCallFilter=")) continue;
    line.erase(0, line.find('=') + 1);
    const bool without = line.starts_with("~");
    std::istringstream items(line.substr(without ? 1 : 0));
    for (std::string item; items >> item;) {
      for (const std::string& call : calls_of(item)) {
        if (without) {
          allowed.erase(call);
        } else {
          allowed.insert(call);
        }
      }
    }
  }
  ASSERT_TRUE(allowed.contains("read"));
  std::string text;
  for (const std::string& call : allowed) text += call + "\n";
  write_text(folder() / "calls", text);
  make_room();
  EXPECT_THAT(record_with({built_file("under_filter"), "allow", path("calls"), built_file("kirokud")}, false),
              Not(HasSubstr("without a box")));
}

TEST_F(Box, AKernelWithoutSeccompRecordsAndSaysSo) {
  make_room();
  const std::string said =
      record_with({built_file("under_filter"), "refuse", "seccomp", built_file("kirokud")}, true);
  EXPECT_THAT(said, HasSubstr("error    sources are decoded without a box, beside the device key: a decoder "
                              "cannot be boxed here: "));
  EXPECT_THAT(said, HasSubstr(kUnboxed));
}

TEST_F(Box, ARecorderWithoutItsDecoderRecordsAndSaysSo) {
  make_room();
  const std::string said = record_with({alone("kirokud")}, true);
  EXPECT_THAT(said,
              HasSubstr("error    sources are decoded without a box, beside the device key: cannot start "
                        "the decoder"));
  EXPECT_THAT(said, HasSubstr("install Kiroku anew"));
  EXPECT_THAT(said, HasSubstr(kUnboxed));
}

TEST_F(Box, TheDoctorSaysWhetherThereIsOne) {
  Process::Options doctor = options({"doctor"});
  EXPECT_THAT(run_process(doctor).out, HasSubstr("decoders: each source is decoded in a box"));
  const std::string program = alone("kiroku-full");
  doctor.command = {program, "doctor"};
  EXPECT_THAT(run_process(doctor).out, testing::ContainsRegex("BAD *decoders: .*install Kiroku anew"));
}

TEST_F(Box, WhoOnlyLooksIsRefusedWhereThereIsNone) {
  ASSERT_EQ(kiroku({"record", "--room", film()}).status, 0);
  std::string case_folder;
  for (const auto& entry : std::filesystem::directory_iterator(home() / "archive")) {
    if (std::filesystem::exists(entry.path() / "segments")) case_folder = entry.path().string();
  }
  Process::Options verifying =
      options({"verify", "--identity", (home() / "identity.txt").string(), case_folder});
  verifying.command.front() = alone("kiroku-full");
  const ProcessResult verified = run_process(verifying);
  EXPECT_NE(verified.status, 0);
  EXPECT_NE(verified.status, 1) << "that says nothing against the case";
  EXPECT_THAT(verified.out + verified.err, HasSubstr("install Kiroku anew"));
}

}  // namespace
}  // namespace kiroku::test

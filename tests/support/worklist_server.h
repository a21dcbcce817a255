// DCMTK's own worklist server on a port of this machine, with steps that a test states; for tests.
#pragma once

#include <cstdint>
#include <ctime>
#include <filesystem>
#include <fstream>
#include <memory>
#include <string>
#include <thread>

#include <boost/asio/io_context.hpp>
#include <boost/asio/ip/tcp.hpp>

#include "tests/support/process.h"
#include "tests/support/reserved_port.h"

namespace kiroku::test {

/// Whether dump2dcm and wlmscpfs (Debian package dcmtk) are installed.
inline bool has_worklist_server() {
  return std::filesystem::exists("/usr/bin/wlmscpfs") && std::filesystem::exists("/usr/bin/dump2dcm");
}

/// Now as strftime writes it, by the machine's zone, which worklists mean: "%Y%m%d", "%H%M".
inline std::string compact_local_time(const char* format) {
  const std::time_t now = std::time(nullptr);
  std::tm here{};
  localtime_r(&now, &here);
  char text[16];
  std::strftime(text, sizeof text, format, &here);
  return text;
}

class WorklistServer {
 public:
  /// Keeps its steps below `folder`; its application entity title is RIS.
  explicit WorklistServer(const std::filesystem::path& folder)
      : steps_(folder / "RIS"), port_(reserved_port()) {
    std::filesystem::create_directories(steps_);
    std::ofstream(steps_ / "lockfile");
  }

  void start() {
    server_ = std::make_unique<Process>(
        Process::Options{{"/usr/bin/wlmscpfs", "--keep-char-set", "--data-files-path",
                          steps_.parent_path().string(), std::to_string(port_)},
                         {},
                         {},
                         "",
                         false});
    for (int i = 0; i < 200 && !answers(); ++i) std::this_thread::sleep_for(std::chrono::milliseconds(50));
  }

  /// It is away, and can be started again.
  void stop() { server_.reset(); }

  /// `date` as "20260805", `time` as "0915"; `name` in `charset` ("ISO_IR 100").
  void add(const std::string& id, const std::string& name, const std::string& date, const std::string& time,
           const std::string& station = "ENDO1", const std::string& charset = "ISO_IR 192") const {
    const std::filesystem::path dump = steps_ / (id + ".dump");
    std::ofstream(dump) << "(0008,0005) CS [" << charset << "]\n(0008,0050) SH [A" << id
                        << "]\n(0010,0010) PN [" << name << "]\n(0010,0020) LO [" << id
                        << "]\n(0010,0030) DA [19800115]\n(0010,0040) CS [F]\n"
                           "(0020,000d) UI [1.2.826.0.1."
                        << id << "]\n(0032,1032) PN [Asks^Ann]\n(0032,1060) LO [Colonoscopy " << id
                        << "]\n(0040,1001) SH [P" << id
                        << "]\n(0040,0100) SQ\n  (fffe,e000) -\n"
                           "    (0008,0060) CS [ES]\n    (0040,0001) AE ["
                        << station << "]\n    (0040,0002) DA [" << date << "]\n    (0040,0003) TM [" << time
                        << "]\n    (0040,0006) PN [Cutter^Carla^M]\n    (0040,0007) LO [step]\n"
                           "    (0040,0009) SH [S"
                        << id << "]\n    (0040,0011) SH [Room 1]\n  (fffe,e00d) -\n(fffe,e0dd) -\n";
    run_process(
        {{"/usr/bin/dump2dcm", "--quiet", "--line", "65536", dump.string(), (steps_ / (id + ".wl")).string()},
         {},
         {},
         "",
         false});
    std::filesystem::remove(dump);
  }

  [[nodiscard]] std::uint16_t port() const { return port_; }

 private:
  [[nodiscard]] bool answers() const {
    boost::asio::io_context context;
    boost::asio::ip::tcp::socket socket(context);
    boost::system::error_code error;
    socket.connect({boost::asio::ip::make_address("127.0.0.1"), port_}, error);
    return !error;
  }

  std::filesystem::path steps_;
  std::uint16_t port_;
  std::unique_ptr<Process> server_;
};

}  // namespace kiroku::test

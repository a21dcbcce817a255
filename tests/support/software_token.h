// A PKCS#11 token in files, by SoftHSM 2, whose library a test loads.
#pragma once

#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <string>

#include "tests/support/process.h"

namespace kiroku::test {

class SoftwareToken {
 public:
  static constexpr const char* kLibrary = "/usr/lib/softhsm/libsofthsm2.so";
  static bool is_installed() {
    return std::filesystem::exists(kLibrary) && std::filesystem::exists("/usr/bin/softhsm2-util");
  }
  static constexpr const char* kWhySkipped = "it needs softhsm2 (deploy/dependencies, group test)";

  /// Its files lie in `folder`. Sets SOFTHSM2_CONF for this process.
  explicit SoftwareToken(const std::filesystem::path& folder) : folder_(folder) {
    std::filesystem::create_directories(folder / "tokens");
    std::ofstream(folder / "softhsm2.conf")
        << "directories.tokendir = " << (folder / "tokens").string() << "\nlog.level = ERROR\n";
    std::ofstream(folder / "pin") << "12345678\n";
    ::setenv("SOFTHSM2_CONF", (folder / "softhsm2.conf").c_str(), 1);
    Process::Options run;
    run.command = {"/usr/bin/softhsm2-util",
                   "--init-token",
                   "--free",
                   "--label",
                   "kiroku",
                   "--so-pin",
                   "87654321",
                   "--pin",
                   "12345678"};
    made_ = run_process(run);
  }
  ~SoftwareToken() { ::unsetenv("SOFTHSM2_CONF"); }
  SoftwareToken(const SoftwareToken&) = delete;
  SoftwareToken& operator=(const SoftwareToken&) = delete;
  [[nodiscard]] const ProcessResult& made() const { return made_; }
  [[nodiscard]] std::string uri() const {
    return "pkcs11:token=kiroku?module-path=" + std::string(kLibrary) +
           "&pin-source=file:" + (folder_ / "pin").string();
  }

 private:
  std::filesystem::path folder_;
  ProcessResult made_;
};

}  // namespace kiroku::test

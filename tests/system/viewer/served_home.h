// `kiroku view` before a home, asked over HTTPS as a browser asks. Of Google Test's one thread.
#pragma once

#include <chrono>
#include <csignal>
#include <filesystem>
#include <map>
#include <optional>
#include <sstream>
#include <string>
#include <unistd.h>
#include <vector>

#include <gtest/gtest.h>

#include "tests/support/build_paths.h"
#include "tests/support/https_client.h"
#include "tests/system/program_test.h"

namespace kiroku::test {

inline const std::vector<std::string> kRoles{"operator", "surgeon", "auditor", "administrator"};
inline constexpr const char* kPassword = "correct horse battery";

/// A home with a user of each role, and `kiroku view` before it.
class ServedHome : public ProgramTest {
 protected:
  /// The passwords are hashed once for all tests of a build, which takes two seconds of a processor: the
  /// users' database is kept beside the tests and made anew where a program is younger.
  void add_users() {
    namespace fs = std::filesystem;
    const fs::path kept = binary_folder() / "tests/system/users-of-each-role.sqlite";
    const fs::path users = home() / "users.sqlite";
    std::error_code absent;
    const auto made = fs::last_write_time(kept, absent);
    if (!absent && made > fs::last_write_time(built_file("kiroku"))) {
      fs::copy_file(kept, users);
      return;
    }
    for (const std::string& role : kRoles) {
      Process::Options adding = options({"user", "add", "a-" + role, "--role", role});
      adding.environment["KIROKU_PASSPHRASE"] = kPassword;
      ASSERT_EQ(run_process(adding).status, 0);
    }
    // Of this process alone until it is whole: other tests run at the same time.
    const fs::path copy = kept.string() + "." + std::to_string(::getpid());
    fs::copy_file(users, copy);
    fs::rename(copy, kept);
  }
  void TearDown() override {
    if (!server_) return;
    server_->signal(SIGTERM);
    EXPECT_EQ(server_->wait(std::chrono::seconds(60)).status, 0)
        << "ends by itself, and finds no error (sanitizers)";
  }

  void start(const Arguments& more = {}) {
    Arguments arguments{"view", "--listen", "127.0.0.1:0", "--json"};
    arguments.insert(arguments.end(), more.begin(), more.end());
    server_.emplace(options(arguments));
    ASSERT_TRUE(server_->wait_for("\"fingerprint\"")) << server_->wait(std::chrono::seconds(1)).err;
    ASSERT_TRUE(server_->wait_for("}"));
    started_ = nlohmann::json::parse(server_->out());
    const std::string url = started_["url"];
    port_ = static_cast<std::uint16_t>(std::stoul(url.substr(url.rfind(':') + 1)));
  }

  [[nodiscard]] HttpResponse ask(const std::string& method, const std::string& target,
                                 const std::string& cookie = "", const std::string& body = "",
                                 std::map<std::string, std::string> headers = {}) const {
    if (!cookie.empty()) headers["Cookie"] = cookie;
    return ask_once(port_, http_request(method, target, headers, body));
  }
  /// "__Host-kiroku=…" of who signs in.
  [[nodiscard]] std::string sign_in(const std::string& user, const std::string& password = kPassword) const {
    const HttpResponse answer =
        ask("POST", "/api/session", "", nlohmann::json{{"user", user}, {"password", password}}.dump());
    EXPECT_EQ(answer.status, 200) << answer.body;
    return cookie_of(answer);
  }
  static std::string cookie_of(const HttpResponse& answer) {
    const auto found = answer.headers.find("set-cookie");
    return found == answer.headers.end() ? "" : found->second.substr(0, found->second.find(';'));
  }
  [[nodiscard]] std::string case_path(const std::string& rest) const {
    return "/api/cases/" + case_id_ + rest;
  }
  /// What the appliance log says of accesses, newest last.
  [[nodiscard]] std::vector<std::string> accesses() const {
    std::vector<std::string> out;
    std::istringstream lines(read_text(home() / "archive/log/ledger.jsonl"));
    for (std::string line; std::getline(lines, line);) {
      const nlohmann::json entry = nlohmann::json::parse(line);
      if (entry["type"] == "access") {
        out.push_back(entry["case"].get<std::string>() + " " + entry["what"].get<std::string>() + " " +
                      entry["who"].get<std::string>());
      }
    }
    return out;
  }

  std::string case_id_;
  std::optional<Process> server_;
  nlohmann::json started_;
  std::uint16_t port_ = 0;
};

}  // namespace kiroku::test

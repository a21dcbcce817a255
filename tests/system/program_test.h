// What the tests of whole programs share: a folder of their own, a home in it, and the programs' answers.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "tests/support/flipped_byte.h"
#include "tests/support/process.h"
#include "tests/support/temporary_folder.h"

namespace kiroku::test {

using Arguments = std::vector<std::string>;

class ProgramTest : public testing::Test {
 protected:
  ProgramTest();
  /// Options to run kiroku with, KIROKU_HOME set to home().
  [[nodiscard]] Process::Options options(const Arguments& arguments) const;
  [[nodiscard]] ProcessResult kiroku(const Arguments& arguments) const;
  /// Runs, expects success with nothing but one JSON object on standard output, and returns it.
  [[nodiscard]] nlohmann::json kiroku_json(const Arguments& arguments) const;
  /// Another program of the machine, by name.
  [[nodiscard]] ProcessResult tool(const Arguments& command, const std::string& input = "") const;
  /// `kiroku init --demo`.
  void make_demo_home() const;
  /// Records tiny synthetic pictures and vital signs as fast as it goes; the case folder.
  [[nodiscard]] std::filesystem::path record(const Arguments& more = {},
                                             const std::string& duration = "00:00:03") const;

  [[nodiscard]] std::filesystem::path home() const { return folder_ / "home"; }
  [[nodiscard]] std::filesystem::path folder() const { return folder_.path(); }
  [[nodiscard]] std::string path(const std::string& name) const { return (folder_ / name).string(); }

 private:
  TemporaryFolder folder_;
};

std::string read_text(const std::filesystem::path& file);
void write_text(const std::filesystem::path& file, const std::string& text);
/// Everything below a folder, relative, sorted.
std::vector<std::string> files_below(const std::filesystem::path& folder);
bool has_tool(const std::string& name);

}  // namespace kiroku::test

/// One sentence on standard error with the program's name before it, nothing on standard output, exit 2.
#define EXPECT_REFUSED(result, part)                                               \
  do {                                                                             \
    const auto& refused = (result);                                                \
    EXPECT_EQ(refused.status, 2) << refused.out << refused.err;                    \
    EXPECT_EQ(refused.out, "");                                                    \
    EXPECT_THAT(refused.err, testing::MatchesRegex("kiroku(-verify)?: [^\n]+\n")); \
    EXPECT_THAT(refused.err, testing::HasSubstr(part));                            \
  } while (false)

#include "tests/system/program_test.h"

#include <algorithm>
#include <fstream>
#include <sstream>

#include "tests/support/build_paths.h"

namespace kiroku::test {

namespace fs = std::filesystem;

ProgramTest::ProgramTest() = default;

Process::Options ProgramTest::options(const Arguments& arguments) const {
  Process::Options options;
  options.command = {built_file("kiroku")};
  options.command.insert(options.command.end(), arguments.begin(), arguments.end());
  options.environment = {{"KIROKU_HOME", home().string()},
                         {"KIROKU_PASSPHRASE", {}},
                         {"NO_COLOR", {}},
                         {"TERM", "xterm"},
                         {"TZ", "Europe/Berlin"}};
  options.folder = folder();
  return options;
}

ProcessResult ProgramTest::kiroku(const Arguments& arguments) const {
  return run_process(options(arguments));
}

nlohmann::json ProgramTest::kiroku_json(const Arguments& arguments) const {
  const ProcessResult result = kiroku(arguments);
  EXPECT_EQ(result.status, 0) << result.out << result.err;
  const auto parsed = nlohmann::json::parse(result.out, nullptr, false);
  EXPECT_TRUE(parsed.is_object()) << "no single JSON object: " << result.out;
  return parsed;
}

ProcessResult ProgramTest::tool(const Arguments& command, const std::string& input) const {
  Process::Options options;
  options.command = command;
  options.folder = folder();
  options.input = input;
  return run_process(options);
}

void ProgramTest::make_demo_home() const {
  const ProcessResult made = kiroku({"init", "--demo"});
  ASSERT_EQ(made.status, 0) << made.err;
}

fs::path ProgramTest::record(const Arguments& more, const std::string& duration) const {
  Arguments arguments{"record",      "--json",
                      "--duration",  duration,
                      "--endoscope", "synthetic:endoscope?size=64x48&rate=10&speed=max",
                      "--vitals",    "synthetic:patient?speed=max"};
  arguments.insert(arguments.end(), more.begin(), more.end());
  const nlohmann::json answer = kiroku_json(arguments);
  return answer.is_object() ? answer.value("case", "") : "";
}

std::string read_text(const fs::path& file) {
  std::ifstream in(file, std::ios::binary);
  std::ostringstream text;
  text << in.rdbuf();
  return text.str();
}

void write_text(const fs::path& file, const std::string& text) {
  std::ofstream(file, std::ios::binary) << text;
}

std::vector<std::string> files_below(const fs::path& folder) {
  std::vector<std::string> names;
  std::error_code ignored;
  for (const auto& entry : fs::recursive_directory_iterator(folder, ignored)) {
    names.push_back(entry.path().lexically_relative(folder).string());
  }
  std::sort(names.begin(), names.end());
  return names;
}

bool has_tool(const std::string& name) {
  Process::Options options;
  options.command = {"sh", "-c", "command -v " + name};
  return run_process(options).status == 0;
}

}  // namespace kiroku::test

#include "apps/kiroku/stated_mending.h"

#include <array>
#include <string_view>
#include <utility>

#include <nlohmann/json.hpp>

#include "archive/writing/log_reading.h"

namespace kiroku::apps {
namespace {

constexpr std::string_view kCouldNot = "could not mend ";

/// The file that it is about; "" where it is no such statement.
std::string file_of(std::string_view what) {
  for (const std::string_view verb : std::array<std::string_view, 3>{kCouldNot, "mends ", "mended "}) {
    if (!what.starts_with(verb)) continue;
    const std::string_view rest = what.substr(verb.size());
    return std::string(rest.substr(0, rest.find_first_of(": ")));
  }
  return "";
}

}  // namespace

StatedMending::StatedMending(std::filesystem::path log, std::string case_name)
    : log_(std::move(log)), case_name_(std::move(case_name)) {}

bool StatedMending::is_news(const std::string& what) {
  const bool could_not = what.starts_with(kCouldNot);
  if (could_not && !newest_) read();
  if (!newest_) return true;
  std::string& newest = (*newest_)[file_of(what)];
  return std::exchange(newest, what) != what || !could_not;
}

void StatedMending::read() {
  newest_.emplace();
  archive::for_each_readable_log_line(log_, [&](const archive::LogLine& line) {
    if (line.type != "access" || line.json.find("mend") == std::string::npos) return;
    const nlohmann::json entry = nlohmann::json::parse(line.json, nullptr, false);
    if (!entry.is_object() || entry.value("case", "") != case_name_) return;
    const std::string what = entry.value("what", "");
    if (const std::string file = file_of(what); !file.empty()) (*newest_)[file] = what;
  });
}

}  // namespace kiroku::apps

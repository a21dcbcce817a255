#include "apps/kiroku/witnessed_note.h"

#include <filesystem>
#include <string>

#include "apps/common/command_line.h"
#include "apps/verify/outside_note.h"
#include "base/error.h"

namespace kiroku::apps {

namespace fs = std::filesystem;

std::optional<archive::OutsideNote> home_witnessed_note(const Home& home) {
  const fs::path file = home.newest_witnessed_note();
  std::error_code ignored;
  if (!fs::exists(file, ignored)) return std::nullopt;
  try {
    if (fs::is_regular_file(file, ignored)) return load_outside_note(file);
    print_error("kiroku", "warning: " + file.string() + " is no file, so the log was not compared with it");
  } catch (const Error& error) {
    print_error("kiroku", std::string("warning: the log was not compared: ") + error.what());
  }
  return std::nullopt;
}

}  // namespace kiroku::apps

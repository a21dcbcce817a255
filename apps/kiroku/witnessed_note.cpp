#include "apps/kiroku/witnessed_note.h"

#include <filesystem>
#include <string>

#include "apps/common/command_line.h"
#include "apps/verify/outside_note.h"
#include "apps/verify/witness_judgement.h"
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

std::optional<crypto::Checkpoint> home_witnessed_checkpoint(const Home& home) {
  const auto note = home_witnessed_note(home);
  if (!note || !is_of_log(*note, home.device())) return std::nullopt;
  return crypto::Checkpoint::parse(crypto::open_note(note->text, {home.device()}).text);
}

}  // namespace kiroku::apps

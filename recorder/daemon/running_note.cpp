#include "recorder/daemon/running_note.h"

#include <fstream>

#include <nlohmann/json.hpp>

#include "archive/format/case_layout.h"

namespace kiroku::recorder {
namespace {

using nlohmann::json;

std::optional<RunningCase> read_note(const std::filesystem::path& file) {
  std::ifstream in(file);
  const json note = json::parse(in, nullptr, false);
  if (!note.is_object()) return {};
  const auto text = [&](const char* key) {
    const auto found = note.find(key);
    return found != note.end() && found->is_string() ? found->get<std::string>() : std::string();
  };
  RunningCase running{text("case"), text("carries_on"), text("reason"), true};
  if (!archive::is_case_id(running.case_id)) return {};
  if (!archive::is_case_id(running.carries_on)) running.carries_on.clear();
  // What cannot be read is not taken for leave to record.
  if (const auto ending = note.find("ending"); ending != note.end() && ending->is_boolean()) {
    running.ending = ending->get<bool>();
  }
  return running;
}

}  // namespace

RunningNote::RunningNote(archive::FileSystem& files, const std::filesystem::path& archive, std::string room)
    : files_(files), file_(archive / ".running" / (std::move(room) + ".json")) {}

std::optional<RunningCase> RunningNote::read() const {
  const std::lock_guard guard(mutex_);
  return read_note(file_);
}

void RunningNote::write(const RunningCase& running) {
  if (!std::filesystem::exists(file_.parent_path())) {
    files_.make_folder(file_.parent_path());
    files_.sync_folder(file_.parent_path().parent_path());
  }
  const json note{{"case", running.case_id},
                  {"carries_on", running.carries_on},
                  {"reason", running.reason},
                  {"ending", running.ending}};
  files_.write_durably(file_, bytes_of(note.dump() + "\n"));
}

void RunningNote::begins(const RunningCase& running) {
  const std::lock_guard guard(mutex_);
  write(running);
}

void RunningNote::ends(const std::string& case_id) {
  const std::lock_guard guard(mutex_);
  std::optional<RunningCase> running = read_note(file_);
  if (!running || running->case_id != case_id || running->ending) return;
  running->ending = true;
  write(*running);
}

void RunningNote::clear(const std::string& case_id) {
  const std::lock_guard guard(mutex_);
  const std::optional<RunningCase> running = read_note(file_);
  if (!running || running->case_id != case_id) return;
  files_.remove(file_);
  files_.sync_folder(file_.parent_path());
}

}  // namespace kiroku::recorder

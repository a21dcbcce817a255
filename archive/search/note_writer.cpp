#include "archive/search/note_writer.h"

#include "archive/format/case_folder.h"
#include "archive/format/case_layout.h"

namespace kiroku::search {
namespace {

namespace fs = std::filesystem;

constexpr std::string_view kExtension = ".json";

}  // namespace

fs::path note_file(const fs::path& folder, const std::string& case_id) {
  return folder / (case_id + std::string(kExtension));
}

std::string case_of_note(const std::string& name) {
  if (!name.ends_with(kExtension)) return "";
  std::string case_id = name.substr(0, name.size() - kExtension.size());
  return archive::is_case_id(case_id) ? case_id : "";
}

void NoteWriter::write(const std::string& case_id, const SearchWords& words) {
  const std::lock_guard guard(mutex_);
  keep(make_note(take_step(key_), case_id, words));
}

void NoteWriter::carry_over(const std::string& case_id, const std::string& earlier) {
  const std::lock_guard guard(mutex_);
  const fs::path file = note_file(folder_, earlier);
  if (!files_.exists(file)) return;
  const std::optional<std::string> text = archive::read_small(files_.open_to_read(file), kMostNoteBytes);
  const std::optional<SearchNote> note = text ? SearchNote::parse(*text) : std::nullopt;
  if (!note || note->of.case_id != earlier)
    throw Error(file.string() + " is no search note of its case: the case that carries it on gets none");
  keep(search::carry_over(take_step(key_), case_id, *note));
}

void NoteWriter::keep(const SearchNote& note) {
  if (!files_.exists(folder_)) {
    files_.make_folder(folder_);
    files_.sync_folder(folder_.parent_path());
  }
  files_.write_durably(note_file(folder_, note.of.case_id), bytes_of(note.text()));
}

}  // namespace kiroku::search

#include "apps/verify/outside_note.h"

#include "apps/common/file.h"
#include "archive/format/case_folder.h"
#include "archive/format/case_layout.h"
#include "archive/verify/checkpoint_rules.h"
#include "base/error.h"

namespace kiroku::apps {

archive::OutsideNote load_outside_note(const std::filesystem::path& file_or_copy) {
  std::error_code ignored;
  if (!std::filesystem::is_directory(file_or_copy, ignored)) {
    return {file_or_copy.string(), std::string(text_of(read_small_file(file_or_copy, "the note")))};
  }
  const archive::CaseFolder copy = archive::CaseFolder::open(file_or_copy);
  const std::vector<std::uint64_t> sizes = archive::note_sizes(copy.list());
  if (sizes.empty()) {
    throw UsageError("there is no checkpoint in " + file_or_copy.string() +
                     ": give a note, or a copy of a case or an appliance log");
  }
  const std::string newest = archive::note_path(sizes.back());
  const archive::FileOpening opening = copy.open_file(newest);
  std::optional<std::string> text =
      opening.file ? archive::read_small(*opening.file, archive::kMaximumNoteBytes) : std::nullopt;
  if (!text) {
    throw UsageError("cannot take the newest checkpoint of " + file_or_copy.string() + ": " + newest + " " +
                     (opening.file ? "is far too long" : opening.explanation));
  }
  return {(file_or_copy / newest).string(), std::move(*text)};
}

}  // namespace kiroku::apps

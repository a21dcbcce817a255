#include "archive/verify/outside_copy.h"

#include <algorithm>
#include <map>
#include <utility>

#include "archive/format/case_folder.h"
#include "archive/format/case_layout.h"
#include "archive/format/limits.h"
#include "archive/verify/checkpoint_rules.h"
#include "base/error.h"
#include "base/number_text.h"

namespace kiroku::archive {

namespace {

// Origins are kept of all notes, and those of devices are far shorter.
constexpr std::size_t kLongestOrigin = 512;

std::optional<crypto::Checkpoint> checkpoint_in(const std::string& note) {
  return crypto::Checkpoint::parse(crypto::open_note(note, {}).text);
}

}  // namespace

OutsideCopy read_outside_copy(const std::filesystem::path& folder) {
  const CaseFolder opened = CaseFolder::open(folder);
  const std::vector<std::uint64_t> named = note_sizes(opened.list());
  if (named.empty()) {
    throw UsageError("there is no checkpoint in " + folder.string() +
                     ": give a note, or a copy of a case or an appliance log");
  }
  OutsideCopy copy;
  copy.folder = folder;
  for (const std::uint64_t size : named) {
    const std::string file = note_path(size);
    const FileOpening opening = opened.open_file(file);
    if (!opening.file && opening.problem == FileProblem::kUnreadable) {
      throw UsageError("cannot take the checkpoints of " + folder.string() + ": " + file + " " +
                       opening.explanation);
    }
    const auto text = opening.file ? read_small(*opening.file, kMaximumNoteBytes) : std::nullopt;
    auto checkpoint = text ? checkpoint_in(*text) : std::nullopt;
    if (!checkpoint || checkpoint->size != size || checkpoint->origin.size() > kLongestOrigin) {
      if (copy.others++ == 0) copy.first_other = file;
    }
    // One that states another size is compared all the same: what was signed binds under every name.
    if (checkpoint && checkpoint->origin.size() <= kLongestOrigin)
      copy.notes.push_back({file, std::move(*checkpoint)});
  }
  std::ranges::stable_sort(copy.notes, {},
                           [](const OutsideCopy::Note& note) { return note.checkpoint.size; });
  return copy;
}

std::optional<std::string> text_of_note(const OutsideCopy& copy, const OutsideCopy::Note& note) {
  const FileOpening opening = CaseFolder::open(copy.folder).open_file(note.file);
  auto text = opening.file ? read_small(*opening.file, kMaximumNoteBytes) : std::nullopt;
  return text && checkpoint_in(*text) == note.checkpoint ? text : std::nullopt;
}

bool is_origin_of(const std::string& origin, const crypto::VerifierKey& device) {
  const std::string prefix = case_origin(device.name(), "");
  return origin == log_origin(device.name()) ||
         (origin.starts_with(prefix) && is_case_id(std::string_view(origin).substr(prefix.size())));
}

std::optional<OutsideNote> newest_signed_note(const OutsideCopy& copy,
                                              const std::vector<crypto::VerifierKey>& devices) {
  // A log can name as many devices as it has lines.
  std::map<std::string, std::vector<crypto::VerifierKey>> by_name;
  for (const crypto::VerifierKey& device : devices) by_name[log_origin(device.name())].push_back(device);
  for (auto note = copy.notes.rbegin(); note != copy.notes.rend(); ++note) {
    const std::string& origin = note->checkpoint.origin;
    const auto signers = by_name.find(origin.substr(0, origin.rfind('/')) + "/log");
    if (signers == by_name.end() || !is_origin_of(origin, signers->second.front())) continue;
    std::optional<std::string> text = text_of_note(copy, *note);
    const auto failure =
        text ? crypto::open_note(*text, signers->second).failure : crypto::NoteFailure::kUnknownKey;
    if (!failure || failure == crypto::NoteFailure::kLacksMlDsa ||
        failure == crypto::NoteFailure::kLacksHardware) {
      return OutsideNote{(copy.folder / note->file).string(), std::move(*text)};
    }
  }
  return std::nullopt;
}

std::string words_of_others(const OutsideCopy& copy) {
  if (copy.others == 0) return "";
  return "; beside it " + std::string(copy.others == 1 ? "lies " : "lie ") +
         counted(copy.others, "file that is", "files that are") +
         " no checkpoint of the size that its name states: " + copy.first_other;
}

}  // namespace kiroku::archive

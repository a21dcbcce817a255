#include "archive/writing/log_case_begin.h"

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstddef>
#include <string>
#include <utility>
#include <vector>

#include "archive/format/case_folder.h"
#include "archive/format/case_layout.h"
#include "archive/format/ledger_entry.h"
#include "archive/format/limits.h"
#include "archive/format/line_reader.h"
#include "archive/writing/own_checkpoints.h"
#include "base/error.h"

namespace kiroku::archive {

namespace fs = std::filesystem;

namespace {

/// The newest checkpoints in the case's folder that the device signed for it, whatever its lines are.
std::vector<OwnCheckpoint> own_notes_of_case(const FileReading& files, const crypto::VerifierKey& by_ed25519,
                                             const fs::path& case_folder, const std::string& case_id) {
  constexpr std::size_t kMostNotes = 64, kMostLookedAt = 256;
  if (!files.is_folder(case_folder / kCheckpointsFolder)) return {};
  std::size_t looked_at_notes = 0;
  const std::string origin = case_origin(by_ed25519.name(), case_id);
  const std::vector<std::uint64_t> sizes = note_sizes_in(files, case_folder);
  std::vector<OwnCheckpoint> notes;
  for (auto size = sizes.rbegin(); size != sizes.rend() && notes.size() < kMostNotes; ++size) {
    // Files that are none cost whoever puts them there nothing.
    if (++looked_at_notes > kMostLookedAt) break;
    std::optional<std::string> note;
    try {
      note = read_small(files.open_to_read(case_folder / note_path(*size)), kMaximumNoteBytes);
    } catch (const IoError& error) {
      if (!is_cause_in_the_folder(error.error_number())) throw;
    } catch (const Error&) {  // NOLINT(bugprone-empty-catch): no regular file, so no note
    }
    const std::optional<crypto::Checkpoint> text = note ? text_of_note(*note) : std::nullopt;
    if (!text || text->origin != origin || text->size != *size ||
        crypto::open_note(*note, {by_ed25519}).failure) {
      continue;
    }
    notes.push_back({*text, std::move(*note)});
  }
  std::ranges::reverse(notes);
  return notes;
}

/// `notes` by size.
bool is_any_over_its_lines(const FileReading& files, const std::vector<OwnCheckpoint>& notes,
                           const fs::path& case_folder) {
  std::vector<std::uint64_t> sizes;
  for (const OwnCheckpoint& each : notes) sizes.push_back(each.checkpoint.size);
  const std::vector<crypto::Sha256Digest> roots = roots_of_lines(files, case_folder / kLedgerFile, sizes);
  for (std::size_t at = 0; at < roots.size(); ++at)
    if (notes[at].checkpoint.root == roots[at]) return true;
  return false;
}

}  // namespace

bool is_cause_in_the_folder(int error) {
  constexpr std::array kCauses{
      ENOENT, ENOTDIR, EISDIR,    ELOOP,        EACCES,     EPERM,
      ENXIO,  EINVAL,  EOVERFLOW, ENAMETOOLONG, EWOULDBLOCK};  // of a lease, the last
  return std::ranges::find(kCauses, error) != kCauses.end();
}

CaseBegin begin_of_case(const FileReading& files, const fs::path& archive, const std::string& device,
                        const crypto::VerifierKey& by_ed25519, const CaseOpenedEntry& opened) {
  try {
    const fs::path case_folder = archive / opened.case_id;
    if (!files.is_folder(case_folder)) return {};
    const std::vector<OwnCheckpoint> notes =
        own_notes_of_case(files, by_ed25519, case_folder, opened.case_id);
    if (notes.empty()) return {};
    const auto line = first_whole_line(files.open_to_read(case_folder / kLedgerFile));
    if (!line || crypto::sha256(bytes_of(*line)) != opened.sha256) return {};
    const EntryParse first = parse_case_entry(*line);
    const auto* const open = first.entry ? std::get_if<OpenEntry>(&first.entry->body) : nullptr;
    if (open == nullptr || open->case_id != opened.case_id || open->device != device ||
        !is_any_over_its_lines(files, notes, case_folder)) {
      return {};
    }
    if (open->appliance_log_size == 0) return {true, {}};  // every log goes on from none
    return {false, LogState{open->appliance_log_size, open->appliance_log_root}};
  } catch (const IoError& error) {
    return {!is_cause_in_the_folder(error.error_number()), {}};
  } catch (const Error&) {
    return {};
  }
}

}  // namespace kiroku::archive

#include "archive/writing/own_checkpoints.h"

#include <algorithm>
#include <utility>

#include "archive/format/case_folder.h"
#include "archive/format/case_layout.h"
#include "archive/format/limits.h"
#include "archive/format/line_reader.h"
#include "crypto/merkle_tree.h"

namespace kiroku::archive {

namespace fs = std::filesystem;

std::optional<crypto::Checkpoint> text_of_note(std::string_view note) {
  const std::size_t end = note.find("\n\n");
  return end == std::string_view::npos ? std::nullopt : crypto::Checkpoint::parse(note.substr(0, end + 1));
}

std::optional<OwnCheckpoint> as_own(std::string note, const crypto::VerifierKey& device) {
  const crypto::OpenedNote opened = crypto::open_note(note, {device});
  std::optional<crypto::Checkpoint> checkpoint = crypto::Checkpoint::parse(opened.text);
  if (!checkpoint || checkpoint->origin != log_origin(device.name()) ||
      !crypto::is_signed_for_log(opened, device, checkpoint->size)) {
    return std::nullopt;
  }
  return OwnCheckpoint{std::move(*checkpoint), std::move(note)};
}

std::optional<OwnCheckpoint> checkpoint_of(const fs::path& folder, const crypto::VerifierKey& device,
                                           std::uint64_t size, const FileReading& files,
                                           const crypto::Sha256Digest* root) {
  const FileOpening opening = CaseFolder::open(folder, files).open_file(note_path(size));
  std::optional<std::string> note =
      opening.file ? read_small(*opening.file, kMaximumNoteBytes) : std::nullopt;
  if (!note) {
    return std::nullopt;
  }
  if (root != nullptr) {
    // Signatures of thousands of notes that are over other lines anyway need not be looked at.
    const std::optional<crypto::Checkpoint> said = text_of_note(*note);
    if (!said || said->root != *root) return std::nullopt;
  }
  std::optional<OwnCheckpoint> own = as_own(std::move(*note), device);
  return own && own->checkpoint.size == size ? std::move(own) : std::nullopt;
}

std::vector<crypto::Sha256Digest> roots_of_lines(const FileReading& files, const fs::path& file,
                                                 const std::vector<std::uint64_t>& sizes) {
  const ReadableFile input = files.open_to_read(file);
  crypto::MerkleFrontier tree;
  LineReader reader(input);
  std::vector<crypto::Sha256Digest> roots;
  for (LedgerLine line; roots.size() < sizes.size() && reader.next(line) && !line.torn && !line.too_long;) {
    tree.append(crypto::merkle_leaf_hash(bytes_of(line.text)));
    if (tree.size() == sizes[roots.size()]) roots.push_back(tree.root());
  }
  return roots;
}

std::vector<std::uint64_t> note_sizes_in(const FileReading& files, const fs::path& folder) {
  std::vector<std::uint64_t> sizes;
  for (const std::string& name : files.names_in(folder / kCheckpointsFolder)) {
    const std::uint64_t size = size_of_note_name(name).value_or(0);
    if (size > 0) sizes.push_back(size);
  }
  std::ranges::sort(sizes);
  return sizes;
}

std::uint64_t newest_that_fits(const FileReading& files, const fs::path& folder,
                               const crypto::VerifierKey& device, const std::vector<std::uint64_t>& sizes) {
  const std::vector<crypto::Sha256Digest> roots = roots_of_lines(files, folder / kLedgerFile, sizes);
  for (std::size_t at = roots.size(); at-- > 0;) {
    if (checkpoint_of(folder, device, sizes[at], files, &roots[at])) return sizes[at];
  }
  return 0;
}

}  // namespace kiroku::archive

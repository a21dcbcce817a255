// Cases, excerpts and logs that somebody made so that verifying them is dear: what an owner of any device key
// can write. Each form is one way; all grow with the bytes asked for. Used by tests, a fuzz target and a
// measurement. Not thread-safe.
#pragma once

#include <cstdint>
#include <filesystem>
#include <fstream>
#include <functional>
#include <string>
#include <string_view>
#include <vector>

#include "archive/format/excerpt_document.h"
#include "archive/format/ledger_entry.h"
#include "archive/format/log_entry.h"
#include "archive/verify/verifier.h"
#include "crypto/merkle_tree.h"
#include "crypto/signed_note.h"
#include "crypto/signing_key.h"

namespace kiroku::test {

/// A case below `parent`, written line by line. finish() makes it whole.
class HostileCase {
 public:
  static constexpr const char* kCaseId = "20260805T091502Z-3f9c21ab";
  static constexpr const char* kDeviceName = "or3";
  /// note() writes so many of one case at most, beside that of finish(): with more only Ed25519 is measured.
  static inline std::uint64_t most_notes = ~std::uint64_t{0};

  /// Writes `open` with streams s0, s1 … whose source is `source`.
  HostileCase(const std::filesystem::path& parent, std::size_t streams, const std::string& source = "x");

  /// Appends an entry with its right seq and a time after the one before; its number.
  std::uint64_t add(archive::CaseEntryBody body);
  void raw(std::string_view line);
  /// A signed checkpoint over all lines so far.
  void note();
  /// The bytes of such a checkpoint.
  [[nodiscard]] std::string signed_note();
  /// The same with `signatures` lines of signatures, all but the first wrong.
  void note_signed(std::size_t signatures);
  void file(const std::string& path, std::string_view bytes);
  /// A segment entry of stream s0 with the next index. Its file is written if `present`.
  archive::SegmentEntry next_segment(bool present);
  /// Lines from here on are the excerpt's; those before are left out, all but the first.
  void begin_excerpt();
  void finish();

  [[nodiscard]] std::uint64_t size() const { return tree_.size(); }
  [[nodiscard]] std::uint64_t bytes() const { return bytes_; }
  [[nodiscard]] crypto::Sha256Digest root() const { return tree_.root(tree_.size()); }
  [[nodiscard]] const std::filesystem::path& folder() const { return folder_; }
  [[nodiscard]] archive::Moment now();
  /// Of the excerpt; changed by those who want another one than the right one.
  std::function<void(archive::ExcerptDocument&)> change_document;

 private:
  std::filesystem::path folder_;
  crypto::SigningKey key_ = crypto::SigningKey::generate();
  crypto::MerkleTree tree_;
  std::vector<std::uint64_t> notes_;
  std::string first_line_;
  std::ofstream lines_;
  std::uint64_t bytes_ = 0, first_entry_ = 0, segments_ = 0;
  std::int64_t mono_ns_ = 0;
};

/// A log below `parent`, likewise.
class HostileLog {
 public:
  explicit HostileLog(const std::filesystem::path& parent);
  std::uint64_t add(archive::LogEntryBody body);
  [[nodiscard]] std::uint64_t bytes() const { return bytes_; }
  /// Another device than before.
  static std::string new_device();

 private:
  std::ofstream lines_;
  std::uint64_t bytes_ = 0, size_ = 0;
};

/// One way to make a case's lines dear: appends about `bytes` of them.
struct HostileLines {
  std::string name;
  void (*append)(HostileCase& of, std::uint64_t bytes);
};
const std::vector<HostileLines>& hostile_lines();

/// One folder to verify.
struct HostileForm {
  std::string name;
  std::function<void(const std::filesystem::path& parent, std::uint64_t bytes)> write;
};
const std::vector<HostileForm>& hostile_forms();

/// The case below `parent`, against the log there if there is one; the log itself where there is no case.
archive::VerificationReport verify_hostile(const std::filesystem::path& parent, unsigned threads = 1);
/// What lies below `parent`: bytes of files, of sparse ones what the disk holds; and names, of which each
/// costs whoever sends them 512 bytes in a tar file.
struct Contents {
  std::uint64_t bytes = 0, names = 0;
  [[nodiscard]] std::uint64_t sent() const { return bytes + 512 * names; }
};
Contents contents_below(const std::filesystem::path& parent);

}  // namespace kiroku::test

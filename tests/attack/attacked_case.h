// A copy of a sound case, and of the appliance log that knows it, for somebody to tamper with. Not
// thread-safe.
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <string>
#include <vector>

#include "archive/format/ledger_entry.h"
#include "archive/verify/verifier.h"
#include "tests/support/sample_case.h"
#include "tests/support/temporary_folder.h"

namespace kiroku::test {

/// Two sound cases of one device and their log, made once for all tests of a program.
struct SoundCases {
  SampleArchive archive;
  std::filesystem::path first = SampleCase::write(archive);
  std::filesystem::path second = SampleCase::write(archive);
  static SoundCases& get();
};

std::string read_file(const std::filesystem::path& file);
void write_file(const std::filesystem::path& file, const std::string& bytes);

class AttackedCase {
 public:
  /// A fresh copy of the first sound case.
  AttackedCase();
  /// Of another case of the same archive.
  explicit AttackedCase(const std::filesystem::path& source);

  [[nodiscard]] const std::filesystem::path& folder() const { return folder_; }
  [[nodiscard]] std::filesystem::path operator/(const std::string& file) const { return folder_ / file; }
  [[nodiscard]] std::filesystem::path log() const { return temporary_ / "log"; }
  /// Somewhere outside the case.
  [[nodiscard]] std::filesystem::path outside(const std::string& name) const { return temporary_ / name; }

  [[nodiscard]] std::vector<std::string> lines() const;
  void set_lines(const std::vector<std::string>& lines);
  /// Changes one entry and writes its line anew; nothing else is made to fit.
  void edit(std::uint64_t entry, const std::function<void(archive::CaseEntry&)>& change);
  /// Replaces text in one line.
  void edit_text(std::uint64_t entry, const std::string& from, const std::string& to);
  void remove_line(std::uint64_t entry);
  /// Takes away all entries from `entry` on, with the notes and tokens that tell of them.
  void cut(std::uint64_t entry);
  void append(archive::CaseEntryBody body);
  /// Writes `seq` anew in all lines.
  void renumber();

  /// Signs every note anew over the tree as it is, with the device's own key; notes beyond the end go.
  void sign_again() { forge(SoundCases::get().archive.key(), false); }
  /// The same with any key, and, if asked, new tokens of the sound authority at the times of the old ones:
  /// a forgery that is consistent in itself.
  void forge(const crypto::SigningKey& key, bool stamp_again);
  void write_note(std::uint64_t size, const std::string& origin, std::uint64_t stated_size,
                  const crypto::Sha256Digest& root, const crypto::SigningKey& key, const std::string& name);
  [[nodiscard]] crypto::Sha256Digest root(std::uint64_t size) const;
  [[nodiscard]] std::string origin() const;

  /// Trusted device, trusted authority, and the log unless `with_log` is false.
  [[nodiscard]] archive::VerificationReport verify(bool with_log = true) const;

 private:
  TemporaryFolder temporary_;
  std::filesystem::path folder_;
};

}  // namespace kiroku::test

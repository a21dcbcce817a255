// What a test needs to write a case: keys, recipients and a folder, and a check that the disk never says more
// than it holds.
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "archive/writing/case_writer.h"
#include "crypto/age_recipient.h"
#include "crypto/signing_key.h"

namespace kiroku::test {

/// "2026-08-05T09:15:02Z" and a case-clock time beside it.
archive::Moment moment(std::int64_t mono_ns);

class CaseKit {
 public:
  explicit CaseKit(std::filesystem::path archive);

  /// Streams "room" (MPEG-TS) and "vitals" (JSON Lines), a subject, device "theatre-1", no log.
  [[nodiscard]] archive::CaseWriter::Options options() const;
  [[nodiscard]] const crypto::SigningKey& key() const { return key_; }
  [[nodiscard]] const crypto::AgeIdentities& identities() const { return identities_; }
  [[nodiscard]] const std::filesystem::path& archive() const { return archive_; }

 private:
  std::filesystem::path archive_;
  crypto::SigningKey key_ = crypto::SigningKey::generate();
  crypto::AgeKeyPair pair_ = crypto::generate_age_key();
  crypto::AgeRecipients recipients_{crypto::parse_recipient(pair_.recipient)};
  crypto::AgeIdentities identities_{crypto::parse_identity(pair_.identity_text.text())};
};

/// Seals `plaintext` as segment `index` of stream number `stream` and commits it; the entry that names it.
archive::SegmentEntry commit_segment(archive::CaseWriter& writer, std::size_t stream, const std::string& name,
                                     std::uint64_t index, const std::string& plaintext);

/// Looks at a case folder as a power cut or a kill left it: every whole line of the ledger must be an entry
/// in order whose file is there with the stated size and hash, every note must be signed over a prefix of the
/// ledger. Each problem is one sentence.
std::vector<std::string> lies_of(const std::filesystem::path& folder, const CaseKit& kit);

/// Whole lines of the case's ledger.
std::vector<archive::CaseEntry> entries_of(const std::filesystem::path& folder);

std::string contents(const std::filesystem::path& file);

}  // namespace kiroku::test

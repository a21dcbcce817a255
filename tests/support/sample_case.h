// A small real case on disk, made with the real writer, the appliance log and an embedded authority whose
// clock is the test's: verified, it is `intact` under options(). Two streams: "endoscope" (video by name
// only: its segments hold noise) and "vitals". About 7 s of case clock, three tokens. Deterministic except
// for keys, identifiers and signatures. Not thread-safe.
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <optional>
#include <string>

#include "archive/storage/file_system.h"
#include "archive/verify/verifier.h"
#include "archive/writing/appliance_log.h"
#include "archive/writing/case_writer.h"
#include "crypto/signing_key.h"
#include "tests/support/temporary_folder.h"
#include "timestamp/authority.h"
#include "timestamp/token_verifier.h"

namespace kiroku::test {

/// Everything around cases: device, authority, recipients, archive with its log.
class SampleArchive {
 public:
  SampleArchive();
  [[nodiscard]] std::filesystem::path folder() const { return temporary_ / "archive"; }
  [[nodiscard]] std::filesystem::path log_folder() const { return folder() / "log"; }
  /// An empty archive again; keys, recipients and authority stay.
  void clear() const;
  [[nodiscard]] const crypto::SigningKey& key() const { return key_; }
  [[nodiscard]] crypto::VerifierKey device() const;
  [[nodiscard]] const crypto::AgeRecipients& recipients() const { return recipients_; }
  [[nodiscard]] const crypto::AgeIdentities& identities() const { return identities_; }
  timestamp::Authority& authority() { return authority_; }
  /// Where the authority's keys lie, for whoever misuses them.
  [[nodiscard]] std::filesystem::path authority_folder() const { return temporary_ / "authority"; }
  /// Device, authority's root and log, without identities.
  [[nodiscard]] archive::VerifyOptions options() const;

  /// The authority's answer over a note, at its clock's time, and what the entry says of it.
  Bytes stamp(const std::string& note);
  static archive::TokenEntry facts_of(ByteView response);
  /// What the authority's clock says of UTC at this time of the case clock; may be replaced.
  std::function<UtcTime(std::int64_t mono_ns)> authority_time;
  /// Answers in the authority's place, if set: whoever holds its keys.
  std::function<Bytes(const std::string& note, UtcTime time)> authority_answer;

  std::int64_t now_ns = 0;  // case clock
  [[nodiscard]] archive::Moment now() const;
  static UtcTime opened_at();

  static constexpr const char* kDeviceName = "or3";
  static constexpr const char* kAuthorityName = "embedded";

 private:
  TemporaryFolder temporary_{quick_parent()};
  crypto::SigningKey key_;
  crypto::AgeRecipients recipients_;
  crypto::AgeIdentities identities_;
  timestamp::Authority authority_;
  timestamp::TrustStore trust_;
};

/// Steps of writing a case, so that a test can stop or go astray between them.
class SampleCase {
 public:
  /// `log` makes the archive's appliance log take part. `files` must outlive the object.
  explicit SampleCase(SampleArchive& archive, bool log = true,
                      archive::FileSystem& files = archive::real_file_system());
  ~SampleCase();

  /// The whole story: record(), close(), finish().
  static std::filesystem::path write(SampleArchive& archive);

  /// Segment `index` of stream 0 (endoscope) or 1 (vitals), sealed and committed; not entered yet.
  archive::SegmentEntry segment(std::size_t stream, std::uint64_t index, archive::Span span);
  /// Checkpoint and token.
  void stamp();
  /// Everything up to 6 s: three segments of endoscope, one of vitals, a mark, clock entries, two tokens.
  void record();
  /// Segments of each stream from the case's beginning until now, entered now: nothing of them is missing.
  void record_at_once();
  /// `close` at 7 s or now, its checkpoint and token, the last checkpoint.
  void close();

  archive::CaseWriter& writer() { return *writer_; }
  archive::ApplianceLog* log() { return log_.get(); }
  [[nodiscard]] const std::filesystem::path& folder() const { return writer_->folder(); }

 private:
  SampleArchive* archive_;
  std::unique_ptr<archive::ApplianceLog> log_;
  std::unique_ptr<archive::CaseWriter> writer_;
};

}  // namespace kiroku::test

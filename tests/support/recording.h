// A recorder's surroundings for tests: device key, recipient, embedded authority and archive in a folder of
// their own, and what comes out of a session, opened.
#pragma once

#include <map>
#include <string>
#include <vector>

#include "archive/reading/case_reader.h"
#include "crypto/age_recipient.h"
#include "recorder/session.h"
#include "tests/support/temporary_folder.h"
#include "timestamp/authority.h"

namespace kiroku::test {

/// A recorded case, read back.
class RecordedCase {
 public:
  RecordedCase(const std::filesystem::path& folder, crypto::AgeIdentities identities);

  [[nodiscard]] std::vector<archive::SegmentEntry> segments(const std::string& stream) const;
  [[nodiscard]] std::vector<archive::GapEntry> gaps(const std::string& stream) const;
  /// Those that something else than a busy machine is the cause of: a test that shares its cores asserts no
  /// speed.
  [[nodiscard]] std::vector<archive::GapEntry> gaps_but_overload(const std::string& stream) const;
  /// Entries of one type, in order.
  template <typename Entry>
  [[nodiscard]] std::vector<Entry> all() const {
    std::vector<Entry> found;
    for (const archive::CaseEntry& entry : entries_) {
      if (const auto* body = std::get_if<Entry>(&entry.body)) found.push_back(*body);
    }
    return found;
  }
  [[nodiscard]] const std::vector<archive::CaseEntry>& entries() const { return entries_; }
  [[nodiscard]] Bytes plaintext(const archive::SegmentEntry& segment) const;
  /// Of all segments of the stream, one after the other.
  [[nodiscard]] Bytes joined(const std::string& stream) const;
  [[nodiscard]] std::vector<std::string> lines(const std::string& stream) const;
  /// The subject file's text; "" where there is none.
  [[nodiscard]] std::string subject() const;
  /// One sentence for each rule of streams that does not hold: spans in order and joined by nothing but
  /// stated gaps, at most ten seconds, indexes without a hole, no frame in two segments.
  [[nodiscard]] std::vector<std::string> broken_rules() const;

 private:
  std::filesystem::path folder_;
  crypto::AgeIdentities identities_;
  std::vector<archive::CaseEntry> entries_;
};

class RecorderBench {
 public:
  RecorderBench();

  /// Segments of 200 ms, tokens from the embedded authority each second. Sources are added by the caller.
  [[nodiscard]] recorder::SessionOptions options() const;
  [[nodiscard]] recorder::StreamRequest stream(const std::string& name, const std::string& source,
                                               recorder::Profile profile = recorder::Profile::kMpeg2) const;
  [[nodiscard]] RecordedCase read(const std::filesystem::path& folder) const { return {folder, identities_}; }
  [[nodiscard]] RecordedCase record(recorder::SessionOptions options) const;
  [[nodiscard]] const crypto::AgeIdentities& identities() const { return identities_; }
  [[nodiscard]] std::filesystem::path operator/(const std::string& name) const { return folder_ / name; }
  /// Case folders in the archive.
  [[nodiscard]] std::size_t cases() const;

 private:
  TemporaryFolder folder_;
  crypto::SigningKey key_;
  crypto::AgeRecipients recipients_;
  crypto::AgeIdentities identities_;
  timestamp::Authority authority_;
  timestamp::TrustStore trust_;
  std::shared_ptr<timestamp::StampSource> stamps_;
};

}  // namespace kiroku::test

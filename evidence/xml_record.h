// Evidence records in XML (RFC 6283), which other archives write: read and judged, never written. What
// differs from RFC 4998: renewals are over canonical XML, and a hash-tree renewal has one value for the
// chains before and one for each object. Judging reads the record's document; one thread at a time.
#pragma once

#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "evidence/record.h"
#include "evidence/record_verifier.h"

namespace kiroku::evidence {

/// Bytes of the longest record that is read.
inline constexpr std::size_t kLongestXmlRecord = std::size_t{4} << 20U;

/// Whether a file begins as XML does: an angle bracket behind a byte order mark and white space, or the byte
/// order mark of UTF-16, which may be XML and is not read.
bool begins_as_xml(ByteView file);

class XmlRecord {
 public:
  /// Throws kiroku::Error, one sentence with the place in the record, for what is none, has another version,
  /// tokens other than RFC 3161's, a canonicalization other than those of evidence/xml_canonical.h, or more
  /// of anything than evidence/record.h allows.
  static XmlRecord parse(std::string_view xml);
  ~XmlRecord();
  XmlRecord(XmlRecord&&) noexcept;
  XmlRecord& operator=(XmlRecord&&) noexcept;

  /// Chains, hash values and tokens, as a record of RFC 4998 would have them.
  [[nodiscard]] const EvidenceRecord& record() const;
  /// As judge_record(). An object with `content` that is XML is covered by its canonical form, as the chain
  /// makes it, or by its bytes; where that form cannot be made and the bytes are not covered, it could not be
  /// read.
  [[nodiscard]] RecordJudgement judge(const std::vector<DataObject>& objects,
                                      const JudgingRules& rules) const;

 private:
  struct State;
  explicit XmlRecord(std::unique_ptr<State> state);
  std::unique_ptr<State> state_;
};

}  // namespace kiroku::evidence

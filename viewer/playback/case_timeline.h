// What a case's ledger says about time, for drawing: no verdict, which is verification's. Functions;
// thread-safe.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "archive/reading/case_reader.h"
#include "archive/verify/report.h"
#include "base/utc_time.h"
#include "timestamp/token_verifier.h"
#include "viewer/playback/case_media.h"

namespace kiroku::playback {

struct TimelineSegment {
  std::string stream;
  std::uint64_t index = 0;
  archive::Span span;
  bool complete = true;
  bool erased = false;  // by retention
};
struct TimelineToken {
  std::int64_t time_ns = 0;  // of its entry
  UtcTime gen_time;
  std::string authority;
  std::uint64_t checkpoint = 0;
  /// Judged by itself, over the checkpoint that lies there, under the roots that were given; whether both
  /// belong to this ledger is verification's to say. kNotJudged: the token does not hold, says another time
  /// than its entry, or no given root knows it.
  enum class Kind { kExternal, kSelfIssued, kNotJudged };
  Kind kind = Kind::kNotJudged;
};
struct TimelineCheckpoint {
  std::int64_t time_ns = 0;  // of the last entry it covers
  std::uint64_t size = 0;
};
/// What was entered in [start_ns, end_ns) was written after not_before and before not_after, if the tokens'
/// checkpoints are this ledger's. By external tokens alone where there are any, else by self-issued ones;
/// those that could not be judged make none.
struct TimelineBracket {
  std::int64_t start_ns = 0, end_ns = 0;
  std::optional<UtcTime> not_before, not_after;
  std::string authority_before, authority_after;
  archive::TimeProof time = archive::TimeProof::kNone;  // as of archive::Bracket
};
struct Timeline {
  std::vector<TimelineSegment> segments;
  std::vector<archive::GapEntry> gaps;
  std::vector<TimelineToken> tokens;
  std::vector<TimelineCheckpoint> checkpoints;  // in order of size
  std::vector<TimelineBracket> brackets;
};

/// Throws kiroku::Error if the ledger cannot be read.
Timeline timeline_of(const archive::CaseReader& recording, const timestamp::TrustStore& trust);

/// A moment that somebody marked.
struct TimelineMark {
  std::int64_t time_ns = 0;
  std::string text;
};
struct TimelineMarks {
  std::vector<TimelineMark> marks;  // in order of time
  std::size_t events_lacking = 0;   // to which the ledger commits, and which are not there: marks, or others
};
/// The marks of the events stream. Each is what the ledger's commitments say was marked: others are left out.
/// Throws kiroku::Error as media::SealedSegment::open.
TimelineMarks marks_of(const CaseMedia& media);

}  // namespace kiroku::playback

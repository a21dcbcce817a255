// The qualified time-stamping services of an EU trusted list (Regulation (EU) No 910/2014, article 22; ETSI
// TS 119 612 v2.1.1 and later), and whether a token is of one of them. The list's own signature (XAdES) is
// not verified: whoever gives a list vouches for it. Plain values; functions are pure and thread-safe.
#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "base/bytes.h"
#include "base/utc_time.h"
#include "timestamp/token_verifier.h"

namespace kiroku::timestamp {

/// What a service was from a moment on (TS 119 612, 5.5.4 and 5.5.5).
struct ServiceStatus {
  UtcTime since;
  bool granted = false;  // as qualified time-stamping service; false: withdrawn, or listed otherwise
  std::string name;      // the last part of the status URI: "granted", "withdrawn", "accredited"
};

/// A service of type QTST (TS 119 612, 5.5.1.1).
struct QualifiedService {
  std::string provider, name;          // in English where the list has that
  std::vector<Bytes> certificates;     // DER: of the signer of tokens, or of an authority above it (5.5.3)
  std::vector<ServiceStatus> history;  // newest first, never empty
};

struct TrustedList {
  std::string territory;  // "SK"
  std::uint64_t sequence = 0;
  UtcTime issued;
  std::optional<UtcTime> next_update;  // nothing: the scheme was closed
  std::vector<QualifiedService> services;
};

/// Throws kiroku::Error naming `name` for what is no trusted list of a member state, or one that breaks the
/// standard where it matters here.
TrustedList parse_trusted_list(std::string_view xml, const std::string& name);
/// Bytes of the longest list that is read.
inline constexpr std::size_t kLongestTrustedList = std::size_t{64} << 20U;

struct Qualification {
  /// kUnknown: the lists do not tell. No list names anything of the token's path, or its time is past what
  /// they tell of.
  enum class Answer { kQualified, kNotQualified, kUnknown };
  Answer answer = Answer::kUnknown;
  std::string sentence;
};

/// Whether a valid token is a qualified electronic time stamp (Regulation, article 3 (34)) by these lists: a
/// service whose certificate has the name and key of one in the token's path was granted at the token's time.
/// A token that is not valid is kUnknown.
Qualification judge_qualification(const TokenJudgement& token, const std::vector<TrustedList>& lists);

}  // namespace kiroku::timestamp

// The questions that a verification answers for people, made from its findings. Pure functions, thread-safe.
#pragma once

#include <array>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "archive/verify/report.h"
#include "archive/verify/verify_options.h"
#include "crypto/hash.h"
#include "viewer/report/document.h"
#include "viewer/report/language.h"

namespace kiroku::report {

/// Every finding code belongs to one of these.
enum class Check { kLedger, kFiles, kStreams, kEnd, kDevice, kTime, kLog, kContents };
inline constexpr auto kChecks = std::to_array({Check::kLedger, Check::kFiles, Check::kStreams, Check::kEnd,
                                               Check::kDevice, Check::kTime, Check::kLog, Check::kContents});

/// "Could not be checked" (something that was needed is missing) is an answer of its own, and so is "not
/// checked" (nobody asked for it).
enum class Answer { kYes, kWithGaps, kInPart, kInsideOnly, kUnknown, kUnfinished, kNotAsked, kNo };
Tone tone_of(Answer answer);
std::string answer_words(Language language, Answer answer);

/// The finding that takes every other answer along.
inline constexpr std::string_view kAlgorithmEnded = "algorithm-ended";

/// What the person who ordered the verification gave it.
struct GivenFile {
  std::string name;
  std::optional<crypto::Sha256Digest> sha256;  // of its bytes; nothing for an identity and for folders
};
struct Given {
  std::vector<GivenFile> devices, roots, log, identities;
  std::vector<GivenFile> own_roots;         // of the recorder's own authority
  std::vector<GivenFile> evidence, policy;  // one at most: the record that had to hold, the algorithms' ends
  std::vector<GivenFile> proof, witnesses;  // likewise: a proof from the log, a policy of witnesses
  std::vector<GivenFile> against;           // notes that somebody kept elsewhere
};
/// By name and hash.
std::vector<GivenFile> given_notes(const std::vector<archive::OutsideNote>& notes);

/// How the question stands. `notes` counts the findings of it that change nothing.
struct CheckAnswer {
  Check check = Check::kLedger;
  Answer answer = Answer::kYes;
  std::size_t notes = 0;
};
/// One for each of kChecks, in their order. `excerpt`: of an excerpt, whose end nobody can ask for.
std::vector<CheckAnswer> answer_checks(const archive::VerificationReport& verification, const Given& given,
                                       bool excerpt);

/// Whether the question asks what the ledger's lines say, or what others know of them.
bool rests_on_lines(Check check);
/// Of what its answer means nothing where nobody signed anything.
bool is_vouched_for(Check check);
/// Whether files were not looked for, since the entries that list them cannot be read or may not name them.
bool leaves_files_unasked(const archive::VerificationReport& verification);
/// Whether no stream of pictures or vital signs has a segment: then no gap makes it a recording.
bool nothing_recorded(const archive::VerificationReport& verification);

/// Which question a finding of this code belongs to; nothing for a code that is none.
std::optional<Check> check_of(std::string_view code);
/// The same of a finding: what is found of the log that lies beside a case says nothing of the case's own
/// files.
std::optional<Check> check_of(const archive::Finding& finding);
/// What the code means, as a sentence; the code itself where it is none of the format's.
std::string meaning_of(Language language, std::string_view code);
std::string severity_words(Language language, archive::Severity severity);
Tone tone_of(archive::Severity severity);

}  // namespace kiroku::report

#include "viewer/report/checks.h"

#include <algorithm>
#include <array>

#include "archive/verify/finding_codes.h"
#include "viewer/report/finding_texts.h"
#include "viewer/report/texts.h"

namespace kiroku::report {
namespace {

using archive::Severity;
using archive::TimeProof;

const FindingText* find_text(std::string_view code) {
  const auto* found = std::ranges::find(kFindingTexts, code, &FindingText::code);
  return found == kFindingTexts.end() ? nullptr : found;
}

Answer answer_of(Severity worst) {
  switch (worst) {
    case Severity::kNote:
      return Answer::kYes;
    case Severity::kGap:
      return Answer::kWithGaps;
    case Severity::kUnproven:
      return Answer::kUnknown;
    case Severity::kIncomplete:
      return Answer::kUnfinished;
    case Severity::kTampered:
      break;
  }
  return Answer::kNo;
}

/// Of which files were not looked for, since the entries that list them cannot be read or may not name them.
constexpr auto kLeavesFilesUnasked = std::to_array<std::string_view>(
    {"entry-malformed", "entry-too-long", "ledger-unreadable", "stream-unknown", "segment-name-differs",
     "token-name-differs", "token-repeated", "token-covers-later"});

/// That no finding speaks against the contents says nothing of what nobody opened.
Answer contents_answer(const std::optional<archive::OpenedContents>& contents, bool are_events_uncompared) {
  if (!contents || contents->opened == 0) return Answer::kNotAsked;
  const bool is_all = contents->decoded == contents->segments && !are_events_uncompared;
  return is_all ? Answer::kYes : Answer::kInPart;
}

/// What the log that was given, or a proof from it, knows of the case or excerpt.
Answer log_answer(const archive::VerificationReport& verification) {
  const archive::CaseInLog log = verification.in_log.value_or(archive::CaseInLog{});
  // Of a whole case its end must be among them.
  const bool may_reach = verification.excerpt || verification.close_entry;
  const std::uint64_t wanted =
      verification.excerpt ? verification.excerpt->size : verification.close_entry.value_or(0) + 1;
  const std::uint64_t by_log = verification.excerpt || log.end ? log.entries : 0;
  if (may_reach && std::max(verification.proved_entries, by_log) >= wanted) return Answer::kYes;
  return verification.proved_entries > 0 || log.opening || log.entries > 0 ? Answer::kInPart
                                                                           : Answer::kUnknown;
}

/// What no finding says: that nobody asked, or that only the recorder itself answers.
Answer without_findings(Check check, const archive::VerificationReport& verification, const Given& given,
                        bool excerpt) {
  const auto found = [&](std::string_view code) {
    return std::ranges::find(verification.findings, code, &archive::Finding::code) !=
           verification.findings.end();
  };
  switch (check) {
    case Check::kLedger:
      if (verification.signed_entries == 0) return Answer::kUnknown;
      return !excerpt && verification.signed_entries < verification.entries ? Answer::kInPart : Answer::kYes;
    case Check::kFiles:
      return leaves_files_unasked(verification) ? Answer::kUnknown : Answer::kYes;
    case Check::kLog:
      if (given.log.empty() && given.proof.empty()) return Answer::kNotAsked;
      if (found("log-algorithm-ended")) return Answer::kUnknown;
      return log_answer(verification);
    case Check::kStreams:
      if (!excerpt && nothing_recorded(verification)) return Answer::kNo;
      // What nobody signed says nothing of how it ended.
      if (!excerpt && (!verification.close_entry || verification.signed_entries <= *verification.close_entry))
        return Answer::kInPart;
      return found("stream-shorter") || found("segments-sparse") || found("monitor-silent") ? Answer::kInPart
                                                                                            : Answer::kYes;
    case Check::kContents:
      if (given.identities.empty()) return Answer::kNotAsked;
      return contents_answer(verification.contents, found("events-not-compared"));
    case Check::kEnd:
      return excerpt ? Answer::kNotAsked : Answer::kYes;
    case Check::kTime:
      return verification.time == TimeProof::kSelfIssued       ? Answer::kInsideOnly
             : verification.time == TimeProof::kNone           ? Answer::kUnknown
             : verification.time == TimeProof::kExternalInPart ? Answer::kInPart
                                                               : Answer::kYes;
    default:
      return Answer::kYes;
  }
}

/// Of an excerpt that cannot be read nothing else was looked at; and where its lines do not hold, they do not
/// show that nothing lacks between them either.
void withhold(std::vector<CheckAnswer>& answers, bool read) {
  const Answer ledger = std::ranges::find(answers, Check::kLedger, &CheckAnswer::check)->answer;
  for (CheckAnswer& each : answers) {
    const bool rests_on_lines = each.check == Check::kStreams && ledger != Answer::kYes;
    const bool positive = each.answer == Answer::kYes || each.answer == Answer::kWithGaps ||
                          each.answer == Answer::kInsideOnly ||
                          (rests_on_lines && each.answer == Answer::kInPart);
    if (positive && each.check != Check::kLedger && (!read || rests_on_lines)) each.answer = Answer::kUnknown;
  }
}

/// Of a ledger that was changed nobody signed which files there were, what is missing, or an end; nor is what
/// log and authorities know of the same lines.
void withhold_what_lines_say(std::vector<CheckAnswer>& answers) {
  if (std::ranges::find(answers, Check::kLedger, &CheckAnswer::check)->answer != Answer::kNo) return;
  for (CheckAnswer& each : answers) {
    const bool positive = each.answer == Answer::kYes || each.answer == Answer::kWithGaps ||
                          each.answer == Answer::kInPart || each.answer == Answer::kInsideOnly;
    if (rests_on_lines(each.check) && positive) each.answer = Answer::kUnknown;
  }
}

/// What nobody signed, anybody can have written.
void withhold_what_nobody_signed(std::vector<CheckAnswer>& answers) {
  for (CheckAnswer& each : answers) {
    const bool positive =
        each.answer == Answer::kYes || each.answer == Answer::kWithGaps || each.answer == Answer::kInPart;
    if (is_vouched_for(each.check) && positive) each.answer = Answer::kUnknown;
  }
}

/// Of what is not here as it was listed nobody saw what it holds.
void withhold_contents(std::vector<CheckAnswer>& answers, const archive::VerificationReport& verification) {
  const Answer files = std::ranges::find(answers, Check::kFiles, &CheckAnswer::check)->answer;
  CheckAnswer& contents = *std::ranges::find(answers, Check::kContents, &CheckAnswer::check);
  const bool has_other_files =
      verification.excerpt.has_value() && files != Answer::kYes && files != Answer::kWithGaps;
  const bool lacks_some =
      has_other_files ||
      (verification.contents && archive::listed_segments(verification) > verification.contents->segments);
  if (lacks_some && contents.answer == Answer::kYes) contents.answer = Answer::kInPart;
}

/// Who can find another text with the same hash, or sign in the device's name, can write all of it anew.
void withhold_what_ended(std::vector<CheckAnswer>& answers) {
  for (CheckAnswer& each : answers) {
    const bool rests_on_files = each.check != Check::kTime && each.check != Check::kContents;
    const bool positive =
        each.answer == Answer::kYes || each.answer == Answer::kWithGaps || each.answer == Answer::kInPart;
    if (rests_on_files && positive) each.answer = Answer::kUnknown;
  }
}

}  // namespace

bool is_vouched_for(Check check) { return check != Check::kTime && check != Check::kContents; }

bool rests_on_lines(Check check) {
  return check != Check::kLedger && check != Check::kDevice && check != Check::kContents;
}

bool leaves_files_unasked(const archive::VerificationReport& verification) {
  return std::ranges::any_of(verification.findings, [](const archive::Finding& finding) {
    return std::ranges::find(kLeavesFilesUnasked, finding.code) != kLeavesFilesUnasked.end();
  });
}

bool nothing_recorded(const archive::VerificationReport& verification) {
  const auto is_recorded = [](const archive::StreamReport& stream) {
    return stream.info.kind != "events" && stream.segments > 0;
  };
  return !verification.streams.empty() && std::ranges::none_of(verification.streams, is_recorded);
}

Tone tone_of(Answer answer) {
  switch (answer) {
    case Answer::kYes:
    case Answer::kWithGaps:
      return Tone::kGood;
    case Answer::kInPart:
    case Answer::kInsideOnly:
    case Answer::kUnknown:
    case Answer::kUnfinished:
      return Tone::kCaution;
    case Answer::kNotAsked:
      return Tone::kPlain;
    case Answer::kNo:
      break;
  }
  return Tone::kBad;
}

std::string answer_words(Language language, Answer answer) {
  switch (answer) {
    case Answer::kYes:
      return say(language, "answer.yes");
    case Answer::kWithGaps:
      return say(language, "answer.with-gaps");
    case Answer::kInPart:
      return say(language, "answer.in-part");
    case Answer::kInsideOnly:
      return say(language, "answer.inside-only");
    case Answer::kUnknown:
      return say(language, "answer.unknown");
    case Answer::kUnfinished:
      return say(language, "answer.unfinished");
    case Answer::kNotAsked:
      return say(language, "answer.not-asked");
    case Answer::kNo:
      break;
  }
  return say(language, "answer.no");
}

std::vector<GivenFile> given_notes(const std::vector<archive::OutsideNote>& notes) {
  std::vector<GivenFile> given;
  for (const archive::OutsideNote& note : notes)
    given.push_back({note.name, crypto::sha256(bytes_of(note.text))});
  return given;
}

std::vector<CheckAnswer> answer_checks(const archive::VerificationReport& verification, const Given& given,
                                       bool excerpt) {
  std::vector<CheckAnswer> answers;
  for (const Check check : kChecks) {
    Severity worst = Severity::kNote;
    std::size_t notes = 0;
    for (const archive::Finding& finding : verification.findings) {
      if (check_of(finding).value_or(Check::kLedger) != check) continue;
      worst = std::max(worst, finding.severity);
      notes += finding.severity == Severity::kNote ? 1 : 0;
    }
    const Answer quiet = without_findings(check, verification, given, excerpt);
    // A stated gap of time stamps does not make the recorder's own authority an outside one, and one of a
    // stream does not explain what else is missing of it.
    const bool gap_says_less = quiet != Answer::kYes;
    const bool kept = worst == Severity::kNote || (worst == Severity::kGap && gap_says_less);
    answers.push_back({check, kept ? quiet : answer_of(worst), notes});
  }
  withhold_contents(answers, verification);
  if (verification.signed_entries == 0) withhold_what_nobody_signed(answers);
  if (excerpt) withhold(answers, verification.excerpt.has_value());
  withhold_what_lines_say(answers);
  if (std::ranges::find(verification.findings, kAlgorithmEnded, &archive::Finding::code) !=
      verification.findings.end())
    withhold_what_ended(answers);
  return answers;
}

std::optional<Check> check_of(std::string_view code) {
  const FindingText* text = find_text(code);
  return text == nullptr ? std::nullopt : std::optional(text->check);
}

std::optional<Check> check_of(const archive::Finding& finding) {
  return finding.of_log ? Check::kLog : check_of(std::string_view(finding.code));
}

std::string meaning_of(Language language, std::string_view code) {
  const auto* known = std::ranges::find(archive::kFindingCodes, code, &archive::FindingCode::name);
  const FindingText* text = find_text(code);
  if (known == archive::kFindingCodes.end() || text == nullptr) return std::string(code);
  if (language == Language::kJapanese) return std::string(text->japanese);
  // What a byte offset means stands in the format's own table.
  std::string meaning(known->meaning.substr(0, known->meaning.find("; offset")));
  // Names of the format stay as they are written there.
  const std::string word = meaning.substr(0, meaning.find(' '));
  const bool plain =
      word.find_first_not_of("abcdefghijklmnopqrstuvwxyz") == std::string::npos && word != "seq";
  if (plain) meaning[0] = static_cast<char>(meaning[0] - 'a' + 'A');
  return meaning + ".";
}

std::string severity_words(Language language, Severity severity) {
  switch (severity) {
    case Severity::kNote:
      return say(language, "severity.note");
    case Severity::kGap:
      return say(language, "severity.gap");
    case Severity::kUnproven:
      return say(language, "severity.unproven");
    case Severity::kIncomplete:
      return say(language, "severity.incomplete");
    case Severity::kTampered:
      break;
  }
  return say(language, "severity.tampered");
}

Tone tone_of(Severity severity) {
  switch (severity) {
    case Severity::kNote:
    case Severity::kGap:
      return Tone::kPlain;
    case Severity::kUnproven:
    case Severity::kIncomplete:
      return Tone::kCaution;
    case Severity::kTampered:
      break;
  }
  return Tone::kBad;
}

}  // namespace kiroku::report

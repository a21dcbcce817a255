#include "viewer/report/document_parts.h"

#include <algorithm>
#include <chrono>
#include <optional>
#include <utility>

#include "base/utc_time.h"
#include "viewer/report/figures_in_words.h"
#include "viewer/report/texts.h"

namespace kiroku::report {
namespace {

using archive::Severity;
using archive::TimeProof;
using archive::Verdict;

std::string verdict_sentence(const ReportInput& input, Brackets brackets) {
  const Language language = input.language;
  if (is_of_later_version(input.verification)) return say(language, "verdict.newer.sentence");
  switch (input.verification.verdict) {
    case Verdict::kIntact:
      return say(language, input.verification.left_by_systems == 0
                               ? TextKey("verdict.intact.sentence")
                               : TextKey("verdict.intact.sentence.beside"));
    case Verdict::kIntactWithGaps:
      return say(language, brackets == Brackets::kBelow ? TextKey("verdict.gaps.sentence")
                                                        : TextKey("verdict.gaps.sentence.elsewhere"));
    case Verdict::kIntactExcerpt:
      return say(language, "verdict.excerpt.sentence");
    case Verdict::kUnproven:
      return say(language, "verdict.unproven.sentence");
    case Verdict::kIncomplete:
      return say(language, "verdict.incomplete.sentence");
    case Verdict::kTampered:
      break;
  }
  return say(language, "verdict.tampered.sentence");
}

/// One behind the other. Japanese has no space between two.
std::string sentences(Language language, const std::vector<std::string>& all) {
  std::string out;
  for (const std::string& each : all)
    out += (out.empty() || language == Language::kJapanese ? "" : " ") + each;
  return out;
}

/// What decided the verdict, in words, each code once.
std::vector<std::string> gravest_meanings(const ReportInput& input) {
  Severity worst = Severity::kNote;
  for (const auto& finding : input.verification.findings) worst = std::max(worst, finding.severity);
  std::vector<std::string> meanings;
  if (worst == Severity::kNote) return meanings;
  constexpr std::size_t kMost = 4;
  for (const auto& finding : input.verification.findings) {
    if (finding.severity != worst || meanings.size() == kMost) continue;
    // Here the device is the case's.
    if (finding.of_log && finding.code == "device-not-trusted") continue;
    std::string meaning = meaning_of(input.language, finding.code);
    if (std::ranges::find(meanings, meaning) == meanings.end()) meanings.push_back(std::move(meaning));
  }
  return meanings;
}

}  // namespace

std::string verdict_words(Language language, Verdict verdict) {
  switch (verdict) {
    case Verdict::kIntact:
      return say(language, "verdict.intact");
    case Verdict::kIntactWithGaps:
      return say(language, "verdict.gaps");
    case Verdict::kIntactExcerpt:
      return say(language, "verdict.excerpt");
    case Verdict::kUnproven:
      return say(language, "verdict.unproven");
    case Verdict::kIncomplete:
      return say(language, "verdict.incomplete");
    case Verdict::kTampered:
      break;
  }
  return say(language, "verdict.tampered");
}

Tone tone_of(Verdict verdict) {
  switch (verdict) {
    case Verdict::kIntact:
    case Verdict::kIntactWithGaps:
    case Verdict::kIntactExcerpt:
      return Tone::kGood;
    case Verdict::kUnproven:
    case Verdict::kIncomplete:
      return Tone::kCaution;
    case Verdict::kTampered:
      break;
  }
  return Tone::kBad;
}

namespace {

std::string remark_sentence(const ReportInput& input, archive::TimeRemark remark) {
  using archive::TimeRemark;
  switch (remark) {
    case TimeRemark::kThereByThen:
      return say(input.language, "time.remark.there-by-then");
    case TimeRemark::kFirstStampedLate:
      return say(input.language, "time.remark.first-late",
                 {case_time(input.verification.age_at_first_stamp_ns.value_or(0), false)});
    case TimeRemark::kEnteredLate:
      return say(input.language, "time.remark.entered-late",
                 {case_time(input.verification.entered_late_ns.value_or(0), false)});
    case TimeRemark::kEndStampedLate:
      return say(input.language, "time.remark.end-late");
    case TimeRemark::kClockDiffers:
      return say(input.language, "time.remark.clock-differs");
    case TimeRemark::kLengthDiffers:
      break;
  }
  return say(input.language, "time.remark.length-differs");
}

/// What proves the time, whatever limits the worth of that.
std::string proof_sentence(const ReportInput& input, Brackets brackets) {
  if (input.verification.time == TimeProof::kNone) {
    const auto found = [&](std::string_view code) {
      return std::ranges::find(input.verification.findings, code, &archive::Finding::code) !=
             input.verification.findings.end();
    };
    if (is_proved_by_record(input.verification)) return say(input.language, "time.none.record");
    if (found(kAlgorithmEnded)) return say(input.language, "time.ended");
    return found("ledger-changed") || found("excerpt-no-later-token")
               ? say(input.language, "time.other-entries")
               : say(input.language, "time.none");
  }
  if (input.verification.time == TimeProof::kSelfIssued) return say(input.language, "time.self-issued");
  if (input.verification.time == TimeProof::kExternalInPart) {
    return say(input.language, "time.external-in-part",
               {std::to_string(input.verification.outside_entries - 1)});
  }
  std::optional<UtcTime> earliest, latest;
  for (const archive::Bracket& bracket : input.verification.brackets) {
    if (bracket.not_before)
      earliest = earliest ? std::min(*earliest, *bracket.not_before) : bracket.not_before;
    if (bracket.not_after) latest = latest ? std::max(*latest, *bracket.not_after) : bracket.not_after;
  }
  const std::vector<archive::TimeRemark> remarks = archive::time_remarks(input.verification);
  const bool only_afterwards = std::ranges::find(remarks, archive::TimeRemark::kThereByThen) != remarks.end();
  if (earliest && latest && !only_afterwards) {
    std::vector<std::string> all{
        say(input.language, "time.external", {utc_time(*earliest), utc_time(*latest)})};
    if (brackets == Brackets::kBelow) all.push_back(say(input.language, "time.brackets-below"));
    if (brackets == Brackets::kInTheReport) all.push_back(say(input.language, "time.brackets-elsewhere"));
    return sentences(input.language, all);
  }
  return latest ? say(input.language, "time.external-until", {utc_time(*latest)})
                : say(input.language, "time.none");
}

}  // namespace

std::string time_sentence(const ReportInput& input, Brackets brackets) {
  std::vector<std::string> all{proof_sentence(input, brackets)};
  for (const archive::TimeRemark remark : archive::time_remarks(input.verification))
    all.push_back(remark_sentence(input, remark));
  return sentences(input.language, all);
}

std::string evidence_sentence(const ReportInput& input) {
  if (!input.verification.evidence) return {};
  const archive::EvidenceReport& evidence = *input.verification.evidence;
  const auto words = [&](TextKey key, std::initializer_list<std::string> values) {
    return say(input.language, key, values);
  };
  if (evidence.could_not_check) return words("evidence.unknown", {plain_text(evidence.refusal)});
  if (!evidence.holds) return words("evidence.refused", {plain_text(evidence.refusal)});
  const std::string since = utc_time(*evidence.since);
  const std::string chain =
      evidence.time_stamps == 1
          ? words("evidence.one", {})
          : words("evidence.chain", {std::to_string(evidence.time_stamps), utc_time(*evidence.newest)});
  const std::uint64_t entries = input.verification.entries;
  const std::string all = grouped(entries), covered = grouped(evidence.entries);
  // What no outside clock stands behind is said by somebody, and not proved.
  const bool proved = evidence.outside;
  if (input.verification.excerpt) {
    if (evidence.resealed > 0)
      return proved ? words("evidence.holds.resealed", {since, chain})
                    : words("evidence.self-issued", {words("evidence.says.resealed", {since, chain})});
    return proved ? words("evidence.holds.excerpt", {since, chain})
                  : words("evidence.self-issued", {words("evidence.says.excerpt", {since, chain})});
  }
  if (evidence.entries < entries) {
    return proved
               ? words("evidence.holds.part", {since, chain, covered, all})
               : words("evidence.self-issued", {words("evidence.says.part", {since, chain, covered, all})});
  }
  return proved ? words("evidence.holds", {since, chain, all})
                : words("evidence.self-issued", {words("evidence.says", {since, chain, all})});
}

std::string witness_sentence(const ReportInput& input) {
  using Holds = archive::WitnessReport::Holds;
  if (!input.verification.witnesses) return {};
  const archive::WitnessReport& witnesses = *input.verification.witnesses;
  if (witnesses.asks_for_none) return say(input.language, "witness.asks-for-none");
  if (witnesses.note.empty())
    return say(input.language,
               input.verification.excerpt ? TextKey("witness.none.excerpt") : TextKey("witness.none"));
  const std::string entries = grouped(witnesses.entries);
  if (!witnesses.witnessed.quorum) return say(input.language, "witness.not-met", {entries});
  return witnesses.holds == Holds::kEnd ? say(input.language, "witness.met", {entries})
                                        : say(input.language, "witness.beginning", {entries});
}

std::string signed_late_sentence(const ReportInput& input) {
  const archive::VerificationReport& found = input.verification;
  std::vector<std::string> all;
  constexpr std::size_t kMost = 3;
  for (std::size_t i = 0; i < std::min(found.signed_late.size(), kMost); ++i) {
    const archive::SignedLate& late = found.signed_late[i];
    all.push_back(say(input.language,
                      found.excerpt ? TextKey("signed-late.entries.excerpt") : TextKey("signed-late.entries"),
                      {std::to_string(late.first), std::to_string(late.last)}));
  }
  if (const std::size_t count = found.signed_late.size(); count > kMost)
    all.push_back(say(input.language, "signed-late.more", {grouped(count - kMost)}));
  if (found.found_segments > 0) {
    all.push_back(say(input.language, "signed-late.found",
                      {say_count(input.language, found.found_segments, "one.segment", "many.segment")}));
  }
  if (all.empty()) return {};
  all.push_back(say(input.language, "signed-late.who"));
  return sentences(input.language, all);
}

std::string unopened_pictures(const archive::VerificationReport& verification) {
  if (!verification.contents || verification.contents->opened == 0) return {};
  std::string names;
  for (const archive::StreamReport& stream : verification.streams) {
    const bool is_there = stream.info.kind == "video" && stream.segments > stream.erased_segments;
    if (!is_there || verification.contents->opened_of.contains(stream.info.name)) continue;
    names += (names.empty() ? "" : ", ") + plain_text(stream.info.name, kMostBytesOfName);
  }
  return names;
}

bool is_of_later_version(const archive::VerificationReport& verification) {
  return std::ranges::any_of(verification.findings, [](const archive::Finding& finding) {
    return !finding.of_log && finding.code == "format-newer";
  });
}

Statement verdict_statement(const ReportInput& input, Brackets brackets) {
  const Verdict verdict = input.verification.verdict;
  Statement statement{tone_of(verdict), verdict_words(input.language, verdict),
                      verdict_sentence(input, brackets), gravest_meanings(input)};
  if (verdict == Verdict::kTampered || is_of_later_version(input.verification)) return statement;
  if (input.verification.excerpt && input.verification.excerpt->with_gaps)
    statement.remarks.push_back(say(input.language, "verdict.excerpt.gaps"));
  if (const std::uint64_t beside = input.verification.left_by_systems; beside > 0) {
    statement.remarks.push_back(
        say(input.language, beside == 1 ? TextKey("beside.one") : TextKey("beside.many"), {grouped(beside)}));
  }
  if (std::string late = signed_late_sentence(input); !late.empty())
    statement.remarks.push_back(std::move(late));
  statement.remarks.push_back(time_sentence(input, brackets));
  if (std::string evidence = evidence_sentence(input); !evidence.empty()) {
    statement.remarks.push_back(std::move(evidence));
  }
  if (std::string witnesses = witness_sentence(input); !witnesses.empty()) {
    statement.remarks.push_back(std::move(witnesses));
  }
  if (!input.verification.contents || input.verification.contents->opened == 0)
    statement.remarks.push_back(say(input.language, "scope.remark-unopened"));
  if (const std::string names = unopened_pictures(input.verification); !names.empty())
    statement.remarks.push_back(say(input.language, "scope.remark-unopened-of", {names}));
  return statement;
}

std::string identifier_words(const ReportInput& input, const std::string& identifier) {
  constexpr std::size_t kTimeDigits = 16;  // 20260805T091502Z
  constexpr auto kUsual = std::chrono::minutes(10);
  if (!input.facts.opened_at || identifier.size() < kTimeDigits) return identifier;
  const auto part = [&](std::size_t begin, std::size_t count) { return identifier.substr(begin, count); };
  const std::optional<UtcTime> named =
      parse_utc(part(0, 4) + "-" + part(4, 2) + "-" + part(6, 2) + "T" + part(9, 2) + ":" + part(11, 2) +
                ":" + part(13, 2) + ".000000Z");
  const UtcTime opened = input.facts.opened_at->utc;
  if (named && opened - *named <= kUsual && *named - opened <= kUsual) return identifier;
  return say(input.language, "case.id.other-time", {identifier});
}

Document empty_document(const ReportInput& input, std::string title) {
  const std::string verdict = verdict_words(input.language, input.verification.verdict);
  Document document;
  document.language = input.language;
  document.title = std::move(title);
  document.identifier = plain_text(input.verification.case_id);
  document.subtitle = input.facts.excerpt ? say(input.language, "report.of-excerpt", {document.identifier})
                                          : say(input.language, "report.of", {document.identifier});
  document.subject = document.subtitle + ". " + say(input.language, "verdict-of-subject", {verdict});
  document.author = plain_text(input.author);
  document.program = input.program;
  document.running_head = "Kiroku · " + document.title;
  document.running_foot =
      say(input.language, "report.foot", {verdict, utc_time(input.made), document.author});
  document.made = input.made;
  return document;
}

Table facts_table() { return {{{"", 1}, {"", 3.2}}, {}}; }

void add_fact(Table& table, std::string name, std::string value, Face face) {
  table.rows.push_back(
      {{std::move(name), Tone::kPlain, Face::kStrong}, {std::move(value), Tone::kPlain, face}});
}

std::string signature_words(const ReportInput& input) {
  switch (input.verification.signatures) {
    case archive::SignaturesChecked::kBoth:
      return say(input.language, "device.signatures.both");
    case archive::SignaturesChecked::kHardware:
      return say(input.language, "device.signatures.hardware");
    case archive::SignaturesChecked::kAll:
      return say(input.language, "device.signatures.all");
    case archive::SignaturesChecked::kEd25519:
      return say(input.language, "device.signatures.ed25519");
    case archive::SignaturesChecked::kNone:
      break;
  }
  return say(input.language, "device.signatures.none");
}

std::string device_trust_words(const ReportInput& input) {
  if (input.given.devices.empty()) return say(input.language, "device.trusted.none");
  if (input.verification.device.empty()) return say(input.language, "device.trusted.unread");
  // A log of another device that was given beside the case says nothing of the case's own.
  const bool doubted = std::ranges::any_of(input.verification.findings, [](const archive::Finding& finding) {
    return !finding.of_log && (finding.code == "device-not-trusted" || finding.code == "no-trusted-device");
  });
  if (input.verification.signed_entries == 0) return say(input.language, "check.unsigned");
  return doubted ? say(input.language, "device.trusted.no") : say(input.language, "device.trusted.yes");
}

std::string closed_words(const ReportInput& input) {
  const std::string closed = utc_time(input.facts.closed_at->utc);
  return input.facts.clock_set
             ? say(input.language, "case.by-device.set", {closed, signed_seconds(input.facts.clock_set_ns)})
             : say(input.language, "case.by-device", {closed});
}

bool is_proved_by_record(const archive::VerificationReport& verification) {
  return verification.evidence && verification.evidence->holds && verification.evidence->outside;
}

}  // namespace kiroku::report

#include "apps/verify/report_text.h"

#include <algorithm>
#include <array>
#include <cstdio>
#include <string_view>
#include <utility>
#include <vector>

#include "apps/common/command_line.h"
#include "apps/common/format.h"
#include "apps/common/terminal.h"
#include "apps/verify/witness_judgement.h"
#include "archive/verify/report_json.h"
#include "base/number_text.h"

namespace kiroku::apps {
namespace {

using archive::Severity;
using archive::TimeProof;
using archive::TimeRemark;
using archive::Verdict;
using archive::VerificationReport;

std::string verdict_words(Verdict verdict) {
  switch (verdict) {
    case Verdict::kIntact:
      return paint(Colour::kGreen, "INTACT") + ": everything is as it was recorded.";
    case Verdict::kIntactWithGaps:
      return paint(Colour::kGreen, "INTACT, WITH STATED GAPS") +
             ": what is here is as it was recorded; what is missing is stated and signed.";
    case Verdict::kIntactExcerpt:
      return paint(Colour::kGreen, "INTACT EXCERPT") +
             ": a part of a case, not the case; what it holds is as it was recorded.";
    case Verdict::kUnproven:
      return paint(Colour::kYellow, "UNPROVEN") +
             ": consistent in itself, but something that would prove it was not given or is not there.";
    case Verdict::kIncomplete:
      return paint(Colour::kYellow, "INCOMPLETE") + ": still being recorded, or never closed.";
    case Verdict::kTampered:
      break;
  }
  return paint(Colour::kRed, "TAMPERED") + ": something does not hold; the findings say what and where.";
}

bool has(const VerificationReport& report, std::string_view code) {
  return std::ranges::find(report.findings, code, &archive::Finding::code) != report.findings.end();
}

bool is_remarked(const VerificationReport& report, TimeRemark remark) {
  const std::vector<TimeRemark> remarks = archive::time_remarks(report);
  return std::ranges::find(remarks, remark) != remarks.end();
}

std::string time_words(const VerificationReport& report) {
  switch (report.time) {
    case TimeProof::kExternal:
      return is_remarked(report, TimeRemark::kThereByThen)
                 ? "an outside time-stamping authority proves that it was "
                   "there by then, not when it was recorded"
             : is_remarked(report, TimeRemark::kFirstStampedLate)
                 ? "proved by an outside time-stamping authority; how old its beginning is, is not"
             : is_remarked(report, TimeRemark::kEnteredLate)
                 ? "proved by an outside time-stamping authority; how old some of it is, is not"
                 : "proved by an outside time-stamping authority";
    case TimeProof::kExternalInPart:
      return "proved by an outside time-stamping authority as far as entry " +
             std::to_string(report.outside_entries - 1) + " alone; what follows rests on the recorder's word";
    case TimeProof::kSelfIssued:
      return "self-issued: by an embedded authority, no outside clock stands behind it";
    case TimeProof::kNone:
      break;
  }
  const bool by_record = report.evidence && report.evidence->holds && report.evidence->outside;
  if (by_record) return "by no time-stamp of its own; its evidence record proves since when it existed";
  if (has(report, "algorithm-ended"))
    return "not proved: by the policy, an algorithm of its time-stamps counts no more";
  return has(report, "ledger-changed") || has(report, "excerpt-no-later-token")
             ? "not proved: no time-stamp that could be checked is over the entries that are here"
             : "not proved: no time-stamp that could be checked";
}

/// What else is to be known of the times, a line each.
std::string remark_words(const VerificationReport& report, TimeRemark remark) {
  switch (remark) {
    case TimeRemark::kThereByThen:
      return "when it was recorded, and for how long, rests on the recorder's word";
    case TimeRemark::kFirstStampedLate:
      return "by the case clock it began " + format_duration(report.age_at_first_stamp_ns.value_or(0)) +
             " before the first outside time-stamp: that it began no earlier rests on the recorder's word";
    case TimeRemark::kEnteredLate:
      return "by the case clock some of it ended " + format_duration(report.entered_late_ns.value_or(0)) +
             " before the outside time-stamp in front of its entry: that it is no older rests on the "
             "recorder's word";
    case TimeRemark::kEndStampedLate:
      return "that it ended when it says rests on the recorder's word: the time-stamp over its end is later";
    case TimeRemark::kClockDiffers:
      return "the recorder's clock was wrong, and so is every time by it (see the findings)";
    case TimeRemark::kLengthDiffers:
      break;
  }
  return "from opening to closing the recorder's clock went on by another time than the case clock did";
}

/// UTC, and this machine's zone beside it where that is another.
std::string both_times(UtcTime time) {
  const std::string local = format_local(time);
  return format_utc_for_people(time) + (local.ends_with("+0000") ? "" : " (" + local + ")");
}

std::string line(const std::string& name, const std::string& text) {
  std::string label = "  " + name;
  label.resize(13, ' ');
  return label + printable(text) + "\n";
}

std::string entry_words(const archive::Bracket& first, const archive::Bracket& last) {
  return first.first_entry == last.last_entry
             ? "entry " + std::to_string(first.first_entry)
             : "entries " + std::to_string(first.first_entry) + " to " + std::to_string(last.last_entry);
}

/// Where a bracket has one limit alone, it is wider than any that has two. Those without the earlier one come
/// first, those without the later one last.
std::string unlimited_words(const VerificationReport& report, bool earlier) {
  const auto lacks = [&](const archive::Bracket& bracket) {
    return !(earlier ? bracket.not_before : bracket.not_after);
  };
  const auto first = std::ranges::find_if(report.brackets, lacks);
  if (first == report.brackets.end()) return "";
  const auto last = std::ranges::find_if(report.brackets.rbegin(), report.brackets.rend(), lacks);
  return "; " + entry_words(*first, *last) + " without " + (earlier ? "an earlier" : "a later") + " limit";
}

/// Earliest and latest time, with the entries that each is about, and the widest bracket.
std::string bracket_lines(const VerificationReport& report) {
  std::optional<UtcTime> earliest, latest;
  std::uint64_t first = 0, last = 0;
  std::optional<std::chrono::microseconds> widest;
  for (const auto& bracket : report.brackets) {
    if (bracket.not_before && !earliest) first = bracket.first_entry;
    if (bracket.not_before)
      earliest = earliest ? std::min(*earliest, *bracket.not_before) : bracket.not_before;
    if (bracket.not_after) last = bracket.last_entry;
    if (bracket.not_after) latest = latest ? std::max(*latest, *bracket.not_after) : bracket.not_after;
    if (bracket.not_before && bracket.not_after) {
      const auto width = *bracket.not_after - *bracket.not_before;
      widest = widest ? std::max(*widest, width) : width;
    }
  }
  std::string out;
  const std::string whose = report.time == TimeProof::kSelfIssued ? ", by the recorder's own authority" : "";
  if (earliest) {
    out += line(
        "", "not before " + both_times(*earliest) + ", from entry " + std::to_string(first) + " on" + whose);
  }
  if (latest) {
    out += line("", "not after  " + both_times(*latest) + ", up to entry " + std::to_string(last) + whose);
  }
  if (earliest || latest) {
    out += line("", counted(report.brackets.size(), "bracket", "brackets") +
                        (widest ? ", the widest of those with two limits " +
                                      format_duration(std::chrono::nanoseconds(*widest).count())
                                : ", none with two limits") +
                        unlimited_words(report, true) + unlimited_words(report, false));
  }
  return out;
}

/// Who stamped, by certificate; what the ledger calls them stands beside it.
std::string authority_lines(const VerificationReport& report) {
  constexpr std::size_t kMostNames = 4;
  std::string out;
  for (const archive::StampingAuthority& authority : report.authorities) {
    std::string names;
    for (std::size_t i = 0; i < authority.names.size() && i < kMostNames; ++i) {
      names += (i > 0 ? ", " : "") + authority.names[i];
    }
    if (authority.names.size() > kMostNames) names += ", …";
    out +=
        line(out.empty() ? "stamped by" : "",
             authority.subject + (authority.outside ? "" : " (self-issued)") + ": " +
                 counted(authority.tokens, "time-stamp", "time-stamps") + ", in the ledger called " + names);
  }
  return out;
}

/// "+0.013 s".
std::string seconds(std::int64_t ns, bool with_sign) {
  std::array<char, 40> text{};
  const int size = std::snprintf(text.data(), text.size(), with_sign ? "%+.3f s" : "%.3f s",
                                 static_cast<double>(ns) / 1e9);
  return {text.data(), static_cast<std::size_t>(size)};
}

/// How each authority's clock stood to the recorder's.
std::string clock_lines(const VerificationReport& report) {
  std::string out;
  for (const archive::AuthorityClock& clock : report.clocks) {
    std::string text = clock.authority + "'s clock" + (clock.outside ? "" : " (self-issued)");
    if (report.clock_zero) {
      text += " " + seconds(archive::offset_ns(clock.first, *report.clock_zero), true) + " (± " +
              seconds(clock.first.half_width_ns, false) + ") against the recorder's";
    }
    if (clock.comparisons > 1) {
      text += std::string(report.clock_zero ? "," : "") + " drift " + seconds(clock.drift_ns(), true) +
              " (± " + seconds(clock.drift_half_width_ns(), false) + ") in " +
              format_duration(clock.last.case_ns - clock.first.case_ns);
    }
    out += line(out.empty() ? "clocks" : "", text);
  }
  return out;
}

/// What anybody who could write to the disk may have made before the device signed it.
std::string signed_late_lines(const VerificationReport& report) {
  std::string out;
  constexpr std::size_t kMost = 3;
  for (std::size_t i = 0; i < std::min(report.signed_late.size(), kMost); ++i) {
    const archive::SignedLate& late = report.signed_late[i];
    const std::string entries = late.first == late.last ? "entry " + std::to_string(late.first)
                                                        : "entries " + std::to_string(late.first) + " to " +
                                                              std::to_string(late.last);
    out += line("", (report.excerpt ? entries + ": the excerpt shows no signature from before recording was "
                                                "found cut off"
                                    : entries + " NOT until recording was found cut off") +
                        "; whoever could write to the disk by then could have made them");
  }
  if (const std::size_t count = report.signed_late.size(); count > kMost)
    out += line(
        "", "so could " + std::to_string(count - kMost) + " more stretches of entries (see the findings)");
  if (report.found_segments > 0) {
    out += line("", counted(report.found_segments, "segment", "segments") +
                        " had no entry until recording was found cut off; whoever could write to the disk by "
                        "then could have made them");
  }
  return out;
}

/// How far the segments were looked into.
std::string contents_words(const archive::OpenedContents& contents, std::uint64_t listed) {
  const std::string others = listed > contents.segments ? "; " + std::to_string(listed - contents.segments) +
                                                              " more are listed and not here as listed"
                                                        : "";
  if (contents.opened == 0) return "none of " + counted(contents.segments, "segment", "segments") + others;
  return std::to_string(contents.opened) + " of " + counted(contents.segments, "segment", "segments") +
         " decrypted, " + std::to_string(contents.decoded) + " of them decoded to the frames stated" + others;
}

/// What the evidence record proves: "all 42 entries and 17 files proved since 2026 by one time-stamp".
std::string evidence_words(const archive::EvidenceReport& evidence, std::uint64_t entries, bool excerpt) {
  if (evidence.could_not_check) {
    return "whether the record " + evidence.file + " holds could not be checked: " + evidence.refusal;
  }
  if (!evidence.holds) {
    return "the record " + evidence.file + " proves nothing of this " + (excerpt ? "excerpt: " : "case: ") +
           evidence.refusal;
  }
  const bool all = evidence.entries >= entries;
  std::string text = excerpt ? std::string("checkpoint")
                             : (all ? "all " : "the first " + std::to_string(evidence.entries) + " of ") +
                                   counted(entries, "entry", "entries");
  // What no outside clock stands behind is said by the recorder, and proved to nobody.
  text += " and " + counted(evidence.files, "file", "files") +
          (evidence.outside ? " proved since " : " there by the recorder's own word at ") +
          format_utc_for_people(*evidence.since) + (evidence.outside ? " by " : ": ");
  text += evidence.time_stamps == 1
              ? "one time-stamp"
              : "a chain of " + std::to_string(evidence.time_stamps) + " time-stamps, the newest of " +
                    format_utc_for_people(*evidence.newest);
  if (!evidence.outside) text += ", self-issued: no outside clock stands behind it";
  if (evidence.later_since)
    text += "; the first " + counted(evidence.later_entries, "entry", "entries") + " since " +
            format_utc_for_people(*evidence.later_since);
  if (evidence.resealed > 0)
    text += "; it covers none of the " + counted(evidence.resealed, "segment", "segments") +
            " sealed anew for a reader, whose original hashes the checkpoint covers";
  if (evidence.ends) text += "; to be renewed before " + format_utc_for_people(*evidence.ends);
  return text;
}

/// Who cosigned the log's checkpoint that holds the case's end.
std::string witness_lines(const archive::WitnessReport& witnesses, bool excerpt) {
  using Holds = archive::WitnessReport::Holds;
  std::string out;
  if (witnesses.note.empty()) {
    out = line("witnesses", excerpt ? "nothing shows that anybody cosigned a log that holds this excerpt"
                                    : "nothing shows that anybody cosigned what the appliance log says of "
                                      "this case");
  } else {
    const bool is_end = witnesses.holds == Holds::kEnd;
    out = line("witnesses", std::string("the log's first ") + counted(witnesses.entries, "entry", "entries") +
                                (witnesses.entries == 1 ? " is " : " are ") +
                                witnessed_words(witnesses.asks_for_none, witnesses.witnessed.quorum) + " (" +
                                witnesses.note + ")");
    out += line("", is_end ? "the case's end is among them"
                           : "the case's opening is among them, its end is NOT: nobody witnessed that");
    for (const auto& cosigner : witnesses.witnessed.cosigners) out += line("", cosigner_words(cosigner));
  }
  if (witnesses.asks_for_none) out += line("", "the policy asks for no witness, so none is needed");
  for (const std::string& why : witnesses.unused) out += line("", why);
  return out;
}

/// "00:10:02.500" from the case's beginning.
std::string case_time(std::int64_t ns, const archive::ExcerptReport& excerpt) {
  const std::int64_t ms = (ns - excerpt.begins_ns) / 1'000'000;
  const std::int64_t hours = ms / 3'600'000;
  std::array<char, 40> text{};
  const int size = std::snprintf(text.data(), text.size(), "%02lld:%02d:%02d.%03d",
                                 static_cast<long long>(hours), static_cast<int>(ms / 60'000 % 60),
                                 static_cast<int>(ms / 1'000 % 60), static_cast<int>(ms % 1'000));
  return {text.data(), static_cast<std::size_t>(size)};
}

/// "3", or "at least 3" where the excerpt does not show how many the case has.
std::string of_the_case(const archive::ExcerptStream& stream) {
  return stream.case_segments ? std::to_string(*stream.case_segments)
                              : "at least " + std::to_string(stream.known_segments);
}

/// What part of its case an excerpt is, and what it says of itself.
std::string excerpt_lines(const archive::ExcerptReport& excerpt) {
  std::string held, left_out;
  for (const archive::ExcerptStream& stream : excerpt.streams) {
    std::string& names = stream.selected ? held : left_out;
    names += (names.empty() ? "" : ", ") + stream.name;
  }
  std::string out = line("part", case_time(excerpt.from_ns, excerpt) + " to " +
                                     case_time(excerpt.to_ns, excerpt) + " of the case: " + held);
  out += line("left out", (left_out.empty() ? "" : "the streams " + left_out + "; ") +
                              "everything before and after that time; the patient's data");
  if (excerpt.with_gaps) {
    out += line("", "what else is missing in that time was stated when it was recorded (see the findings)");
  }
  const std::string by = excerpt.stated_made_by.empty() ? "" : " by " + excerpt.stated_made_by;
  if (excerpt.stated_made_at || !by.empty()) {
    out += line("made", (excerpt.stated_made_at ? both_times(*excerpt.stated_made_at) : "") + by +
                            ": the excerpt's own words, nothing proves them");
  }
  return out;
}

/// What the excerpt's folder holds of each stream of its case.
std::string excerpt_table(const VerificationReport& report) {
  std::vector<std::vector<std::string>> rows{
      {"stream", "segments held", "of the case's", "frames held", "of the case's", "length held", "size"}};
  for (const archive::ExcerptStream& part : report.excerpt->streams) {
    const auto held = std::find_if(report.streams.begin(), report.streams.end(),
                                   [&](const auto& each) { return each.info.name == part.name; });
    const bool any = held != report.streams.end() && held->segments > 0;
    rows.push_back({printable(part.name), std::to_string(part.held_segments), of_the_case(part),
                    std::to_string(part.held_frames),
                    part.case_frames ? std::to_string(*part.case_frames) : "not known",
                    any ? format_duration(held->span.end_ns - held->span.start_ns) : "-",
                    any ? format_bytes(held->bytes) : "-"});
  }
  return format_table(rows, "lrrrrrr", 2);
}

std::string stream_table(const VerificationReport& report) {
  const bool erased =
      std::ranges::any_of(report.streams, [](const auto& stream) { return stream.erased_segments > 0; });
  std::vector<std::vector<std::string>> rows{
      {"stream", "segments", "frames", "dropped", "length", "gaps", "size"}};
  if (erased) rows[0].insert(rows[0].begin() + 2, "erased since");
  for (const auto& stream : report.streams) {
    rows.push_back(
        {printable(stream.info.name), std::to_string(stream.segments), std::to_string(stream.frames),
         std::to_string(stream.dropped), format_duration(stream.span.end_ns - stream.span.start_ns),
         stream.gap_ns == 0 ? "none" : format_duration(stream.gap_ns), format_bytes(stream.bytes)});
    if (erased) rows.back().insert(rows.back().begin() + 2, std::to_string(stream.erased_segments));
  }
  return format_table(rows, erased ? "lrrrrrrr" : "lrrrrrr", 2);
}

std::string place(const archive::Finding& finding) {
  std::string out = finding.file;
  if (finding.entry) out += (out.empty() ? "entry " : ", entry ") + std::to_string(*finding.entry);
  if (finding.offset) out += (out.empty() ? "byte " : ", byte ") + std::to_string(*finding.offset);
  return out;
}

std::string finding_text(const archive::Finding& finding) {
  const std::string severity = severity_name(finding.severity);
  const Colour colour = finding.severity == Severity::kTampered ? Colour::kRed : Colour::kYellow;
  const bool plain = finding.severity == Severity::kNote || finding.severity == Severity::kGap;
  std::string out = "  " + (plain ? severity : paint(colour, severity)) + " " + printable(finding.code);
  if (const std::string where = place(finding); !where.empty()) out += " (" + printable(where) + ")";
  return out + "\n      " + printable(finding.text) + "\n";
}

std::string signature_words(archive::SignaturesChecked signatures) {
  switch (signatures) {
    case archive::SignaturesChecked::kBoth:
      return "Ed25519 and ML-DSA-65, both checked";
    case archive::SignaturesChecked::kHardware:
      return "Ed25519 and the key in the device's hardware, both checked";
    case archive::SignaturesChecked::kAll:
      return "Ed25519, ML-DSA-65 and the key in the device's hardware, all checked";
    case archive::SignaturesChecked::kEd25519:
    case archive::SignaturesChecked::kNone:
      break;
  }
  return "Ed25519, the only signature that was checked";
}

}  // namespace

std::string no_log_words() {
  return "none was given: whether a whole case, or the end of one, was removed was not checked";
}

namespace {

/// Of a log: whoever can write to it can cut its end off, with the checkpoints of that.
std::string end_words(const VerificationReport& report) {
  const bool compared =
      std::any_of(report.findings.begin(), report.findings.end(),
                  [](const archive::Finding& each) { return each.code == "outside-note-holds"; });
  return compared ? "whether entries behind the checkpoint that was kept were cut off was not checked"
                  : "whether the newest entries were cut off was not checked: that shows only beside a "
                    "checkpoint kept elsewhere (--against)";
}

/// How far a log was compared, which states roots of whole beginnings of a case, a few of each.
std::string compared_words(const VerificationReport& report, const std::string& log) {
  const auto is_found = [&](std::string_view code) {
    return std::ranges::find(report.findings, code, &archive::Finding::code) != report.findings.end();
  };
  if (!report.in_log && is_found("log-of-another-device"))
    return "not " + log + ": it is another device's, and says nothing of this case";
  if (!report.in_log && is_found("log-opening-differs"))
    return log + "; it is another device's, and knows another case by this identifier";
  if (!report.in_log) return "not " + log + ": what begins the case could not be read, or the log could not";
  const archive::CaseInLog& in_log = *report.in_log;
  if (report.excerpt) {
    if (report.verdict != archive::Verdict::kIntactExcerpt) return log;
    const archive::ExcerptReport& part = *report.excerpt;
    const std::uint64_t known = in_log.entries;
    if (known >= part.size) return log + "; it knows all entries of this part";
    const std::uint64_t first = std::max(known, part.first_entry);
    const std::string last = std::to_string(part.size - 1);
    const std::string rest =
        "says nothing of " +
        (first + 1 == part.size ? "entry " + last : "entries " + std::to_string(first) + " to " + last) +
        " of this part" +
        (report.proved_entries >= part.size ? ", which the proof does"
                                            : ": a proof of the case's end does (kiroku log prove)");
    return log +
           (known > part.first_entry
                ? "; it knows this part up to entry " + std::to_string(known - 1) + ", and "
            : in_log.opening ? "; it knows that the case was opened, and "
                             : "; it ") +
           rest;
  }
  if (in_log.end && report.close_entry && in_log.entries > *report.close_entry) return log;
  if (in_log.entries > 0)
    return log + "; it knows the first " + counted(in_log.entries, "entry", "entries") +
           " of the case, and no end of it that was signed";
  return log + (in_log.opening ? "; it knows that the case was opened, and nothing of what followed"
                               : "; it knows nothing of the case that was signed");
}

/// The worst first; within the same severity in the order of the case.
std::string finding_lines(const VerificationReport& report) {
  if (report.findings.empty()) return "";
  std::vector<archive::Finding> findings = report.findings;
  std::stable_sort(findings.begin(), findings.end(),
                   [](const auto& a, const auto& b) { return a.severity > b.severity; });
  std::string out = "\n" + counted(findings.size(), "finding", "findings") + "\n";
  for (const auto& finding : findings) out += finding_text(finding);
  return out;
}

std::string later_version_words() {
  return paint(Colour::kYellow, "UNPROVEN") +
         ": of a later version of the format than this program knows; what its entries say, and its files, "
         "was "
         "not checked.";
}

/// Of something of a later version no more is known than by whom its checkpoints are.
std::string later_version_lines(const VerificationReport& report, bool device_trusted,
                                const std::string& log) {
  std::string out;
  if (!report.device.empty())
    out += line("device", report.device + (device_trusted ? " (trusted)" : " (not among the trusted keys)"));
  if (log == no_log_words() || log.empty()) {
    out += line("log", no_log_words());
  } else {
    out += line("log", (report.in_log ? "" : "not ") + log +
                           (report.in_log ? ", by roots and numbers of entries alone" : ""));
  }
  return out;
}

}  // namespace

namespace {

/// Whose key it is, and whether it was asked about. Of a later format nobody read who made it.
std::string device_words(const VerificationReport& report, bool device_trusted) {
  if (report.device.empty()) return "not known: what names it was not read";
  const bool none_given = std::ranges::any_of(report.findings, [](const archive::Finding& each) {
    return !each.of_log && each.code == "no-trusted-device";
  });
  return report.device + (device_trusted ? " (trusted)"
                          : none_given   ? " (no trusted key was given)"
                                         : " (not among the trusted keys)");
}

}  // namespace

std::string report_text(const VerificationReport& report, const std::string& case_name, bool device_trusted,
                        const std::string& log) {
  const bool is_later = has(report, "format-newer");
  const bool is_later_alone = is_later && report.verdict == Verdict::kUnproven;
  std::string out = printable(case_name) + "\n" +
                    (is_later_alone ? later_version_words() : verdict_words(report.verdict)) + "\n\n";
  out += line("case", report.case_id);
  if (is_later) return out + later_version_lines(report, device_trusted, log) + finding_lines(report);
  if (report.excerpt) out += excerpt_lines(*report.excerpt);
  out += line("device",
              device_words(report, device_trusted) + (report.signed_entries == 0 && !report.device.empty()
                                                          ? "; the ledger names it, and nobody signed it"
                                                          : ""));
  if (report.signatures != archive::SignaturesChecked::kNone) {
    out += line("signed by", signature_words(report.signatures));
  }
  out += signed_late_lines(report);
  if (report.opened) out += line("opened", both_times(*report.opened) + ", by the recorder's clock");
  if (report.closed) out += line("closed", both_times(*report.closed) + ", by the recorder's clock");
  out += line("time", time_words(report));
  for (const TimeRemark remark : archive::time_remarks(report)) out += line("", remark_words(report, remark));
  out += bracket_lines(report);
  out += authority_lines(report);
  out += clock_lines(report);
  out += line("checked", counted(report.entries, "entry", "entries") + ", " +
                             counted(report.files, "file", "files") + " (" + format_bytes(report.bytes) +
                             "), " + counted(report.checkpoints, "checkpoint", "checkpoints") + ", " +
                             counted(report.tokens, "time-stamp", "time-stamps"));
  if (report.left_by_systems > 0) {
    out += line("", std::string(report.left_by_systems == 1 ? "beside these lies " : "beside these lie ") +
                        counted(report.left_by_systems, "file", "files") + " that nobody recorded");
  }
  if (report.evidence)
    out += line("evidence", evidence_words(*report.evidence, report.entries, report.excerpt.has_value()));
  if (log.empty()) {
    out += line("end", end_words(report));
  } else if (log != no_log_words()) {
    out += line("log", compared_words(report, log));
  } else {
    out +=
        line("log", report.proved_entries > 0 ? "none was given; the proof from it shows the case's first " +
                                                    counted(report.proved_entries, "entry", "entries")
                                              : log);
  }
  if (report.witnesses) out += witness_lines(*report.witnesses, report.excerpt.has_value());
  if (report.contents)
    out += line("contents", contents_words(*report.contents, archive::listed_segments(report)));
  if (report.excerpt) {
    out += "\n" + excerpt_table(report);
  } else if (!report.streams.empty()) {
    out += "\n" + stream_table(report);
  }
  return out + finding_lines(report);
}

}  // namespace kiroku::apps

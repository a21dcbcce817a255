#include "archive/verify/report_json.h"

#include <nlohmann/json.hpp>

#include "base/json_or_null.h"

namespace kiroku::archive {
namespace {

using nlohmann::ordered_json;

ordered_json stream_json(const StreamReport& stream) {
  return {{"name", stream.info.name},
          {"kind", stream.info.kind},
          {"media", stream.info.media},
          {"profile", stream.info.profile},
          {"source", stream.info.source},
          {"segments", stream.segments},
          {"erased_segments", stream.erased_segments},
          {"frames", stream.frames},
          {"dropped", stream.dropped},
          {"bytes", stream.bytes},
          {"start_ns", stream.span.start_ns},
          {"end_ns", stream.span.end_ns},
          {"gap_ns", stream.gap_ns}};
}

ordered_json excerpt_json(const ExcerptReport& excerpt) {
  ordered_json streams = ordered_json::array();
  for (const ExcerptStream& stream : excerpt.streams) {
    streams.push_back({{"name", stream.name},
                       {"selected", stream.selected},
                       {"held_segments", stream.held_segments},
                       {"held_frames", stream.held_frames},
                       {"case_segments", or_null(stream.case_segments)},
                       {"case_frames", or_null(stream.case_frames)},
                       {"known_segments", stream.known_segments}});
  }
  return {{"from_ns", excerpt.from_ns},
          {"to_ns", excerpt.to_ns},
          {"begins_ns", excerpt.begins_ns},
          {"first_entry", excerpt.first_entry},
          {"size", excerpt.size},
          {"with_gaps", excerpt.with_gaps},
          {"streams", std::move(streams)},
          {"stated",
           {{"made_utc", or_null(excerpt.stated_made_at)}, {"made_by", or_null(excerpt.stated_made_by)}}}};
}

ordered_json contents_json(const OpenedContents& contents) {
  return {{"segments", contents.segments}, {"opened", contents.opened}, {"decoded", contents.decoded}};
}

ordered_json bracket_json(const Bracket& bracket) {
  return {{"first_entry", bracket.first_entry},
          {"last_entry", bracket.last_entry},
          {"not_before", or_null(bracket.not_before)},
          {"not_after", or_null(bracket.not_after)},
          {"authority_before", or_null(bracket.authority_before)},
          {"authority_after", or_null(bracket.authority_after)},
          {"time", time_proof_name(bracket.time)}};
}

ordered_json comparison_json(const ClockComparison& comparison, const std::optional<UtcTime>& clock_zero) {
  return {
      {"gen_time", format_utc(comparison.gen_time)},
      {"case_ns", comparison.case_ns},
      {"offset_ns", clock_zero ? ordered_json(offset_ns(comparison, *clock_zero)) : ordered_json(nullptr)},
      {"half_width_ns", comparison.half_width_ns}};
}

ordered_json clock_json(const AuthorityClock& clock, const std::optional<UtcTime>& clock_zero) {
  return {{"authority", clock.authority},
          {"time", time_proof_name(clock.outside ? TimeProof::kExternal : TimeProof::kSelfIssued)},
          {"comparisons", clock.comparisons},
          {"first", comparison_json(clock.first, clock_zero)},
          {"last", comparison_json(clock.last, clock_zero)},
          {"drift_ns", clock.drift_ns()},
          {"drift_half_width_ns", clock.drift_half_width_ns()}};
}

ordered_json authority_json(const StampingAuthority& authority) {
  return {{"subject", authority.subject},
          {"time", time_proof_name(authority.outside ? TimeProof::kExternal : TimeProof::kSelfIssued)},
          {"tokens", authority.tokens},
          {"names", authority.names}};
}

ordered_json evidence_json(const EvidenceReport& evidence) {
  ordered_json links = ordered_json::array();
  for (const EvidenceLink& link : evidence.links) {
    links.push_back({{"time", or_null(link.time)},
                     {"authority", or_null(link.authority)},
                     {"outside", link.outside},
                     {"hash", link.hash},
                     {"covers_data", link.covers_data}});
  }
  return {{"file", evidence.file},
          {"holds", evidence.holds},
          {"time", evidence.holds ? ordered_json(time_proof_name(evidence.outside ? TimeProof::kExternal
                                                                                  : TimeProof::kSelfIssued))
                                  : ordered_json(nullptr)},
          {"since", or_null(evidence.since)},
          {"newest", or_null(evidence.newest)},
          {"ends", or_null(evidence.ends)},
          {"time_stamps", evidence.time_stamps},
          {"links", std::move(links)},
          {"hashes", evidence.hashes},
          {"entries", evidence.entries},
          {"files", evidence.files},
          {"later_entries", evidence.later_entries},
          {"later_since", or_null(evidence.later_since)},
          {"resealed", evidence.resealed},
          {"refusal", or_null(evidence.refusal)},
          {"could_not_check", evidence.could_not_check}};
}

ordered_json witnesses_json(const WitnessReport& witnesses) {
  return {{"quorum", witnesses.is_met()},    {"holds", holds_name(witnesses.holds)},
          {"note", or_null(witnesses.note)}, {"asks_for_none", witnesses.asks_for_none},
          {"entries", witnesses.entries},    {"witnesses", cosigners_json(witnesses.witnessed)},
          {"unused", witnesses.unused}};
}

ordered_json finding_json(const Finding& finding) {
  return {{"code", finding.code},
          {"severity", severity_name(finding.severity)},
          {"file", or_null(finding.file)},
          {"of", finding.of_log ? ordered_json("log") : ordered_json(nullptr)},
          {"entry", or_null(finding.entry)},
          {"offset", or_null(finding.offset)},
          {"text", finding.text}};
}

}  // namespace

std::string severity_name(Severity severity) {
  switch (severity) {
    case Severity::kNote:
      return "note";
    case Severity::kGap:
      return "gap";
    case Severity::kUnproven:
      return "unproven";
    case Severity::kIncomplete:
      return "incomplete";
    case Severity::kTampered:
      break;
  }
  return "tampered";
}

ordered_json cosigners_json(const crypto::WitnessedNote& note) {
  using State = crypto::CosignatureCheck::State;
  ordered_json cosigners = ordered_json::array();
  for (const crypto::WitnessedNote::Cosigner& cosigner : note.cosigners) {
    const State state = cosigner.check.state;
    cosigners.push_back({{"witness", cosigner.name},
                         {"cosigned", state == State::kValid},
                         {"invalid", state == State::kInvalid}});
    if (state == State::kValid) cosigners.back()["time_s"] = cosigner.check.time_s;
  }
  return cosigners;
}

ordered_json report_json(const VerificationReport& report) {
  ordered_json out = {{"case", report.case_id},
                      {"verdict", verdict_name(report.verdict)},
                      {"time", time_proof_name(report.time)},
                      {"outside_entries", report.outside_entries},
                      {"device", report.device},
                      {"signatures", signatures_name(report.signatures)},
                      {"opened", or_null(report.opened)},
                      {"closed", or_null(report.closed)},
                      {"entries", report.entries},
                      {"files", report.files},
                      {"bytes", report.bytes},
                      {"signed_entries", report.signed_entries},
                      {"checkpoints", report.checkpoints},
                      {"tokens", report.tokens}};
  out["excerpt"] = report.excerpt ? excerpt_json(*report.excerpt) : ordered_json(nullptr);
  out["log"] = report.in_log ? ordered_json{{"opening", report.in_log->opening},
                                            {"end", report.in_log->end},
                                            {"entries", report.in_log->entries}}
                             : ordered_json(nullptr);
  out["proved_entries"] = report.proved_entries;
  out["signed_late"] = ordered_json::array();
  for (const SignedLate& late : report.signed_late)
    out["signed_late"].push_back({{"first_entry", late.first}, {"last_entry", late.last}});
  out["found_segments"] = report.found_segments;
  out["contents"] = report.contents ? contents_json(*report.contents) : ordered_json(nullptr);
  out["evidence"] = report.evidence ? evidence_json(*report.evidence) : ordered_json(nullptr);
  out["witnesses"] = report.witnesses ? witnesses_json(*report.witnesses) : ordered_json(nullptr);
  out["streams"] = ordered_json::array();
  for (const auto& stream : report.streams) out["streams"].push_back(stream_json(stream));
  out["brackets"] = ordered_json::array();
  for (const auto& bracket : report.brackets) out["brackets"].push_back(bracket_json(bracket));
  out["authorities"] = ordered_json::array();
  for (const auto& authority : report.authorities) out["authorities"].push_back(authority_json(authority));
  out["clocks"] = ordered_json::array();
  for (const auto& clock : report.clocks) out["clocks"].push_back(clock_json(clock, report.clock_zero));
  out["findings"] = ordered_json::array();
  for (const auto& finding : report.findings) out["findings"].push_back(finding_json(finding));
  return out;
}

}  // namespace kiroku::archive

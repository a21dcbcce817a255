// What was checked, each with its answer, and the chain of proof.
#include <algorithm>
#include <set>

#include "viewer/report/report_maker.h"

namespace kiroku::report {

using archive::Finding;

void ReportMaker::add_answers() {
  heading("heading.answers");
  Table table{{{"", 2.6}, {"", 1.5}, {"", 3.4}}, {}};
  for (const CheckAnswer& each : answers_) {
    const Tone tone = tone_of(each.answer);
    table.rows.push_back({{question(each.check)},
                          {answer_words(in_.language, each.answer), tone, Face::kStrong},
                          {explanation(each)}});
  }
  add(std::move(table));
}

std::string ReportMaker::question(Check check) const {
  switch (check) {
    case Check::kLedger:
      return words("check.ledger");
    case Check::kFiles:
      return in_.facts.excerpt ? words("check.files.excerpt") : words("check.files");
    case Check::kStreams:
      return in_.facts.excerpt ? words("check.streams.excerpt") : words("check.streams");
    case Check::kEnd:
      return words("check.end");
    case Check::kDevice:
      return words("check.device");
    case Check::kTime:
      return words("check.time");
    case Check::kLog:
      return words("check.log");
    case Check::kContents:
      break;
  }
  return words("check.contents");
}

std::string ReportMaker::explanation(const CheckAnswer& answered) const {
  if (answered.answer == Answer::kNotAsked) return not_asked(answered.check);
  if (answered.answer == Answer::kYes || answered.answer == Answer::kInPart ||
      answered.answer == Answer::kInsideOnly) {
    const std::string yes = yes_to(answered);
    return answered.notes == 0
               ? yes
               : words("check.notes-too", {yes, count(answered.notes, "one.note", "many.note")});
  }
  // The gravest finding of the question says why.
  const Finding* gravest = nullptr;
  std::size_t all = 0;
  for (const Finding& finding : found_.findings) {
    const bool ended = answered.answer == Answer::kUnknown && finding.code == kAlgorithmEnded;
    if (check_of(finding) != answered.check && !ended) continue;
    ++all;
    if (gravest == nullptr || finding.severity > gravest->severity) gravest = &finding;
  }
  const bool is_excused = gravest == nullptr || gravest->severity <= archive::Severity::kGap;
  if (answered.check == Check::kStreams && answered.answer == Answer::kNo && is_excused)
    return words("check.streams.nothing");
  if (gravest == nullptr && answered.check == Check::kFiles && !in_.facts.excerpt &&
      leaves_files_unasked(found_))
    return words("check.files.unasked");
  if (is_excused && is_of_later_version(found_)) return words("check.newer");
  const bool ledger_changed =
      std::ranges::find(answers_, Check::kLedger, &CheckAnswer::check)->answer == Answer::kNo;
  if (is_excused && ledger_changed && rests_on_lines(answered.check) && !in_.facts.excerpt)
    return words("check.ledger.changed");
  const bool was_read = found_.excerpt.has_value() == in_.facts.excerpt;
  if (is_excused && was_read && found_.signed_entries == 0 && is_vouched_for(answered.check))
    return words("check.unsigned");
  if (is_excused && answered.check == Check::kLog && was_read)
    return words(found_.in_log ? TextKey("check.log.unsigned") : TextKey("check.log.not-compared"));
  if (gravest == nullptr) {
    return answered.check == Check::kTime && found_.excerpt.has_value() == in_.facts.excerpt
               ? words(is_proved_by_record(found_) ? TextKey("time.none.record") : TextKey("time.none"))
               : words("check.excerpt.unread");
  }
  return words("check.see-findings", {meaning_of(in_.language, gravest->code),
                                      words(only_counted() ? TextKey("check.at-least") : TextKey("check.all"),
                                            {count(all, "one.finding", "many.finding")})});
}

bool ReportMaker::only_counted() const {
  return std::ranges::find(found_.findings, "more-findings", &Finding::code) != found_.findings.end();
}

std::string ReportMaker::not_asked(Check check) const {
  if (check == Check::kLog) return words("check.log.not-asked");
  if (check == Check::kEnd)
    return words(in_.facts.closed_at ? TextKey("check.end.excerpt.closed") : TextKey("check.end.excerpt"));
  return in_.given.identities.empty() ? words("check.contents.not-asked")
                                      : words("check.contents.none-opened");
}

std::string ReportMaker::unbroken_words() const {
  const std::string unbroken = words("check.streams.yes");
  const CaseFacts& facts = in_.facts;
  if (!facts.opening || !facts.opened_at || !facts.closed_at) return unbroken;
  const std::int64_t begins_ns = facts.opening->begins_ns > 0 ? facts.opened_at->mono_ns : 0;
  std::optional<std::int64_t> late_ns, early_ns;
  for (const archive::StreamReport& stream : found_.streams) {
    if (stream.info.timing != "arrival" || stream.info.kind == "events" || stream.segments == 0) continue;
    late_ns = std::max(late_ns.value_or(0), stream.span.start_ns - begins_ns);
    early_ns = std::max(early_ns.value_or(0), facts.closed_at->mono_ns - stream.span.end_ns);
  }
  return late_ns ? words("check.streams.ends", {unbroken, seconds_up(*late_ns), seconds_up(*early_ns)})
                 : unbroken;
}

bool ReportMaker::has_gaps() const {
  return std::ranges::any_of(found_.findings, [](const Finding& finding) {
    return finding.severity == archive::Severity::kGap && check_of(finding) == Check::kStreams;
  });
}

std::string ReportMaker::log_words(Answer answer) const {
  const bool by_proof = found_.proved_entries >= (found_.excerpt ? found_.excerpt->size : 1);
  if (by_proof && answer == Answer::kYes)
    return words("check.log.proof", {std::to_string(found_.proved_entries - 1)}) +
           (found_.excerpt ? " " + words("check.log.excerpt.rest") : "");
  if (found_.excerpt) return answer == Answer::kYes ? words("check.log.excerpt.yes") : part_known_to_log();
  if (answer == Answer::kYes) return words("check.log.yes");
  const std::uint64_t known = std::max(found_.in_log ? found_.in_log->entries : 0, found_.proved_entries);
  return known > 0 ? words("check.log.in-part", {std::to_string(known - 1)}) : words("check.log.opening");
}

std::string ReportMaker::part_known_to_log() const {
  const archive::ExcerptReport& part = *found_.excerpt;
  const std::uint64_t known = found_.in_log ? found_.in_log->entries : 0;
  const std::string last = std::to_string(part.size - 1);
  if (known <= part.first_entry)
    return words("check.log.excerpt.opening", {std::to_string(part.first_entry), last});
  return words("check.log.excerpt.in-part", {std::to_string(known - 1), std::to_string(known), last});
}

// A segment that was sealed anew has not the hash that its entry states: what has it is said instead.
std::string ReportMaker::rekeyed_words() const {
  const std::uint64_t named = archive::named_files(found_), anew = found_.rekeyed_segments;
  const std::uint64_t opened = found_.rekeyed_opened;
  return words("check.files.rekeyed",
               {count(named, "one.file", "many.file"), grouped(named - std::min(anew, named)), grouped(anew),
                opened == 0     ? words("check.files.rekeyed.not-opened")
                : opened < anew ? words("check.files.rekeyed.some", {grouped(opened)})
                                : words("check.files.rekeyed.same-key"),
                held_words(), byte_size(found_.bytes)});
}

std::string ReportMaker::yes_to(const CheckAnswer& answered) const {
  switch (answered.check) {
    case Check::kLedger:
      if (answered.answer == Answer::kInPart) {
        return words("check.ledger.in-part",
                     {entries(), count(found_.checkpoints, "one.checkpoint", "many.checkpoint"),
                      std::to_string(found_.signed_entries - 1)});
      }
      return words("check.ledger.yes",
                   {entries(), count(found_.checkpoints, "one.checkpoint", "many.checkpoint")});
    case Check::kFiles:
      if (found_.excerpt && found_.rekeyed_segments > 0) return rekeyed_words();
      if (found_.excerpt) {
        return words("check.files.excerpt.yes", {count(archive::named_files(found_), "one.file", "many.file"),
                                                 byte_size(found_.bytes), held_words()});
      }
      return words("check.files.yes",
                   {count(archive::named_files(found_), "one.file", "many.file"), byte_size(found_.bytes)});
    case Check::kStreams:
      if (answered.answer == Answer::kInPart && !found_.excerpt &&
          (!found_.close_entry || found_.signed_entries <= *found_.close_entry))
        return words("check.streams.open");
      if (answered.answer == Answer::kInPart) {
        return words(has_gaps() ? TextKey("check.streams.in-part-with-gaps")
                                : TextKey("check.streams.in-part"));
      }
      return found_.excerpt ? words("check.streams.excerpt.yes",
                                    {in_case(found_.excerpt->from_ns), in_case(found_.excerpt->to_ns)})
                            : unbroken_words();
    case Check::kEnd:
      return words("check.end.yes");
    case Check::kDevice:
      return words("check.device.yes", {device_name()});
    case Check::kTime:
      if (answered.answer == Answer::kInPart) {
        return words("check.time.in-part", {std::to_string(found_.outside_entries - 1)});
      }
      return answered.answer == Answer::kInsideOnly
                 ? words("check.time.inside", {count(found_.own_tokens, "one.token", "many.token")})
                 : words("check.time.yes", {count(found_.outside_tokens, "one.token", "many.token")});
    case Check::kLog:
      return log_words(answered.answer);
    case Check::kContents:
      break;
  }
  const archive::OpenedContents contents = found_.contents.value_or(archive::OpenedContents{});
  const std::string segments = count(contents.segments, "one.segment", "many.segment");
  if (answered.answer == Answer::kYes) return words("check.contents.yes", {segments});
  const std::uint64_t listed = archive::listed_segments(found_);
  if (listed > contents.segments)
    return words("check.contents.of-listed",
                 {grouped(listed), segments, grouped(contents.opened), grouped(contents.decoded)});
  return words("check.contents.in-part", {segments, grouped(contents.opened), grouped(contents.decoded)});
}

Chain::Link ReportMaker::link(TextKey title, const CheckAnswer& answered, std::string text,
                              std::string bond) const {
  return {{words(title), tone_of(answered.answer), Face::kStrong},
          answer_words(in_.language, answered.answer),
          std::move(text),
          std::move(bond)};
}

// What the ledger calls an authority is chosen by whoever writes the ledger.
std::string ReportMaker::authority_words() const {
  std::string out;
  for (const archive::StampingAuthority& authority : found_.authorities) {
    constexpr std::size_t kMostNames = 4;
    std::string names;
    for (std::size_t i = 0; i < authority.names.size() && i < kMostNames; ++i) {
      names += (i > 0 ? ", " : "") + plain_text(authority.names[i]);
    }
    if (authority.names.size() > kMostNames) names += ", …";
    out += (out.empty() ? "" : "; ") + plain_text(authority.subject) + " (" + names + ")" +
           (authority.outside ? "" : words("clock.own"));
  }
  return out;
}

// Whose time stamps they are decides who can make the chain anew.
std::string ReportMaker::chain_lead() const {
  if (found_.signed_entries == 0) return words("check.unsigned");
  switch (found_.time) {
    case archive::TimeProof::kExternal:
      return words("chain.lead.external");
    case archive::TimeProof::kExternalInPart:
      return words("chain.lead.external-in-part", {std::to_string(found_.outside_entries - 1)});
    case archive::TimeProof::kSelfIssued:
      return words("chain.lead.self-issued");
    case archive::TimeProof::kNone:
      break;
  }
  return words("chain.lead.none");
}

void ReportMaker::add_chain() {
  heading("heading.chain");
  if (is_of_later_version(found_)) {
    Chain unread;
    for (const auto& [name, check] : {std::pair(TextKey("chain.segments"), Check::kFiles),
                                      std::pair(TextKey("chain.ledger"), Check::kLedger),
                                      std::pair(TextKey("chain.checkpoints"), Check::kDevice),
                                      std::pair(TextKey("chain.tokens"), Check::kTime),
                                      std::pair(TextKey("chain.authorities"), Check::kTime)}) {
      unread.links.push_back(link(name, answer(check), words("check.newer"), ""));
    }
    return add(std::move(unread));
  }
  paragraph(words("chain.lead", {chain_lead()}));
  const CaseFacts& facts = in_.facts;
  Chain chain;
  std::uint64_t segments = facts.segments, segment_bytes = facts.segment_bytes;
  if (facts.excerpt) {  // its lines name more segments than it holds
    segments = segment_bytes = 0;
    for (const archive::StreamReport& held : found_.streams) {
      segments += held.segments;
      segment_bytes += held.bytes;
    }
  }
  chain.links.push_back(
      link("chain.segments", answer(Check::kFiles),
           found_.rekeyed_segments > 0
               ? words("chain.segments.rekeyed", {count(segments, "one.segment", "many.segment"),
                                                  byte_size(segment_bytes), grouped(found_.rekeyed_segments)})
               : words(facts.excerpt ? TextKey("chain.segments.excerpt") : TextKey("chain.segments.text"),
                       {count(segments, "one.segment", "many.segment"), byte_size(segment_bytes)}),
           words("chain.segments.bond")));
  chain.links.push_back(link("chain.ledger", answer(Check::kLedger), words("chain.ledger.text", {entries()}),
                             words("chain.ledger.bond")));
  CheckAnswer signatures = answer(Check::kDevice);
  const bool unsound = std::ranges::any_of(found_.findings, [](const Finding& finding) {
    return finding.severity == archive::Severity::kTampered && finding.code.starts_with("checkpoint-");
  });
  if (unsound) signatures.answer = Answer::kNo;
  chain.links.push_back(
      link("chain.checkpoints", signatures,
           facts.last_checkpoint
               ? words("chain.checkpoints.text",
                       {count(found_.checkpoints, "one.checkpoint", "many.checkpoint"), device_name(),
                        count(facts.last_checkpoint->size, "one.log-entry", "many.log-entry")})
               : words("chain.checkpoints.none"),
           words("chain.checkpoints.bond")));
  constexpr std::size_t kMostAuthorities = 8;
  std::set<std::string> authorities;
  std::string names;
  for (const StatedToken& token : facts.tokens) {
    if (!authorities.insert(token.token.authority).second) continue;
    if (authorities.size() <= kMostAuthorities)
      names += (names.empty() ? "" : ", ") + plain_text(token.token.authority);
  }
  if (authorities.size() > kMostAuthorities) names += ", …";
  chain.links.push_back(
      link("chain.tokens", answer(Check::kTime), tokens_words(), words("chain.tokens.bond")));
  chain.links.push_back(link(
      "chain.authorities", answer(Check::kTime),
      !found_.authorities.empty() ? words("chain.authorities.judged", {authority_words()})
      : names.empty()             ? words("chain.authorities.none")
      : in_.given.roots.empty() && in_.given.own_roots.empty() ? words("chain.authorities.unjudged", {names})
                                                               : words("chain.authorities.text", {names}),
      ""));
  add(std::move(chain));
}

}  // namespace kiroku::report

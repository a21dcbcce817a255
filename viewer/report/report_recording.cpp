// What was recorded: the case, its streams, its gaps.
#include "archive/verify/carried_on.h"
#include "base/printable.h"
#include "viewer/report/report_maker.h"
#include "viewer/report/time_figure.h"

namespace kiroku::report {

std::string ReportMaker::reason() const {
  const std::string& reason = in_.facts.close_reason;
  if (reason == "operator") return words("reason.operator");
  if (reason == "duration") return words("reason.duration");
  if (reason == "sources-ended") return words("reason.sources-ended");
  if (reason == "disk-full") return words("reason.disk-full");
  if (reason == "recovered") return words("reason.recovered");
  if (const auto later = archive::announced_by(reason)) return words("reason.to-be-carried-on", {*later});
  return words("reason.other", {without_quotation_marks(plain_text(reason))});
}

std::string ReportMaker::held_words() const {
  std::string out;
  for (const archive::ExcerptStream& stream : found_.excerpt->streams) {
    if (!stream.selected) continue;
    const std::string name = plain_text(stream.name);
    const std::string held = grouped(stream.held_segments);
    out += (out.empty() ? "" : ", ") +
           (stream.case_segments
                ? words("case.held.of",
                        {name, held, count(*stream.case_segments, "one.segment", "many.segment")})
                : words("case.held.of-at-least",
                        {name, held, count(stream.known_segments, "one.segment", "many.segment")}));
  }
  return out;
}

void ReportMaker::add_part(Table& table, const archive::ExcerptReport& part) const {
  add_fact(table, words("case.part"), words("case.part.text", {in_case(part.from_ns), in_case(part.to_ns)}));
  add_fact(table, words("case.held"), held_words());
  std::string left_out;
  for (const archive::ExcerptStream& stream : part.streams) {
    if (!stream.selected) left_out += (left_out.empty() ? "" : ", ") + plain_text(stream.name);
  }
  add_fact(table, words("case.left-out"),
           left_out.empty() ? words("case.left-out.text") : words("case.left-out.streams", {left_out}));
  const std::string maker = plain_text(part.stated_made_by);
  if (part.stated_made_at && !maker.empty()) {
    add_fact(table, words("case.made"), words("case.made.text", {utc_time(*part.stated_made_at), maker}));
  } else if (part.stated_made_at) {
    add_fact(table, words("case.made"), words("case.made.at", {utc_time(*part.stated_made_at)}));
  } else if (!maker.empty()) {
    add_fact(table, words("case.made"), words("case.made.by", {maker}));
  }
}

bool ReportMaker::concerns(const archive::GapEntry& gap) const {
  if (!found_.excerpt) return true;
  return archive::meets(gap.span, found_.excerpt->from_ns, found_.excerpt->to_ns) &&
         std::ranges::any_of(found_.streams,
                             [&](const auto& stream) { return stream.info.name == gap.stream; });
}

void ReportMaker::add_case() {
  heading("heading.case");
  const CaseFacts& facts = in_.facts;
  Table table = facts_table();
  add_fact(table, words("case.id"), identifier_words(in_, document_.identifier));
  if (const auto earlier = facts.opening ? archive::carried_on_by(*facts.opening) : std::nullopt) {
    add_fact(table, words("case.carries-on"), words("case.carries-on.text", {earlier->case_id}));
  }
  if (found_.excerpt) add_part(table, *found_.excerpt);
  const auto by_device = [&](UtcTime time) { return words("case.by-device", {utc_time(time)}); };
  add_fact(table, words("case.opened"),
           facts.opened_at ? by_device(facts.opened_at->utc) : words("case.unknown"));
  if (!facts.excerpt) {
    add_fact(table, words("case.closed"), facts.closed_at ? closed_words(in_) : words("case.not-closed"));
  }
  const std::int64_t begins_ns = facts.opening ? facts.opening->begins_ns : 0;
  if (!facts.excerpt) add_fact(table, words("case.duration"), case_time(facts.last_ns - begins_ns, false));
  if (facts.closed_at) {
    add_fact(table, words("case.reason"), reason());
  }
  if (begins_ns != 0 && facts.opened_at) {
    add_fact(table, words("case.recorded-before"),
             words("case.recorded-before.text", {case_time(facts.opened_at->mono_ns - begins_ns, false)}));
  }
  add_fact(table, words("case.device"), device_name().empty() ? words("case.unknown") : device_name());
  add_fact(table, words("case.size"),
           count(found_.files, "one.file", "many.file") + ", " + byte_size(found_.bytes));
  // Of an excerpt the lines tell neither how many marks the case has nor what of the patient is at hand.
  if (!facts.excerpt) add_fact(table, words("case.marks"), std::to_string(facts.marks));
  if (facts.opening && !facts.excerpt) {
    const bool sealed =
        std::ranges::find(found_.findings, "subject-not-sealed", &Finding::code) == found_.findings.end();
    add_fact(table, words("case.subject"),
             !facts.opening->subject ? words("case.subject.no")
             : sealed                ? words("case.subject.yes")
                                     : words("case.subject.not-sealed"));
  }
  add(std::move(table));
}

std::string ReportMaker::kind_words(const std::string& kind) const {
  if (kind == "video") return words("kind.video");
  if (kind == "audio") return words("kind.audio");
  if (kind == "vitals") return words("kind.vitals");
  if (kind == "events") return words("kind.events");
  return plain_text(kind);
}

std::string ReportMaker::in_case(std::int64_t ns) const {
  return case_time(ns - (in_.facts.opening ? in_.facts.opening->begins_ns : 0));
}

void ReportMaker::add_streams() {
  heading("heading.streams");
  if (found_.streams.empty()) {
    const bool read =
        std::ranges::find(found_.findings, "no-stream", &Finding::code) != found_.findings.end();
    return paragraph(words(read ? TextKey("check.streams.nothing") : TextKey("case.unknown")));
  }
  constexpr auto kRight = Alignment::kRight;
  Table table{{{words("stream.name"), 1.75},
               {words("stream.kind"), 1},
               {words("stream.from"), 1.65, kRight},
               {words("stream.to"), 1.65, kRight},
               {words("stream.segments"), 1.35, kRight},
               {words("stream.frames"), 1.1, kRight},
               {words("stream.dropped"), 1.25, kRight},
               {words("stream.gaps"), 1.65, kRight},
               {words("stream.size"), 1.2, kRight}},
              {}};
  for (const archive::StreamReport& stream : found_.streams) {
    const bool empty = stream.segments == 0;
    table.rows.push_back(
        {{plain_text(stream.info.name), Tone::kPlain, Face::kStrong},
         {kind_words(stream.info.kind)},
         {empty ? words("stream.nothing") : in_case(stream.span.start_ns)},
         {empty ? "" : in_case(stream.span.end_ns)},
         {grouped(stream.segments) + (stream.erased_segments == 0
                                          ? ""
                                          : " " + words("stream.erased", {grouped(stream.erased_segments)}))},
         {grouped(stream.frames)},
         {grouped(stream.dropped)},
         {stream.gap_ns == 0 ? words("stream.none") : case_time(stream.gap_ns)},
         {byte_size(stream.bytes)}});
  }
  add(std::move(table));
  small(words("stream.lead"));
  if (found_.excerpt) small(words("stream.lead.excerpt"));
  add(Picture{time_figure(found_, in_.facts, in_.language, kTextWidth), words("figure.time")});
  if (found_.streams.size() > kMostStreamsDrawn)
    small(words("figure.further", {std::to_string(found_.streams.size() - kMostStreamsDrawn)}));
}

std::string ReportMaker::cause_words(archive::GapCause cause) const {
  switch (cause) {
    case archive::GapCause::kSignalLost:
      return words("cause.signal-lost");
    case archive::GapCause::kOverload:
      return words("cause.overload");
    case archive::GapCause::kDiskFull:
      return words("cause.disk-full");
    case archive::GapCause::kDeviceRemoved:
      return words("cause.device-removed");
    case archive::GapCause::kFormatChange:
      return words("cause.format-change");
    case archive::GapCause::kPaused:
      return words("cause.paused");
    case archive::GapCause::kSuspended:
      return words("cause.suspended");
    case archive::GapCause::kInterrupted:
      break;
  }
  return words("cause.interrupted");
}

void ReportMaker::add_gaps() {
  heading("heading.gaps", 2);
  std::vector<archive::GapEntry> gaps;
  std::ranges::copy_if(in_.facts.gaps, std::back_inserter(gaps),
                       [this](const archive::GapEntry& gap) { return concerns(gap); });
  if (gaps.empty())
    return paragraph(words(in_.facts.excerpt ? TextKey("gap.none.excerpt") : TextKey("gap.none")));
  constexpr std::size_t kMost = 60;
  Table table{{{words("stream.name"), 1.4},
               {words("gap.from"), 1.3, Alignment::kRight},
               {words("gap.to"), 1.3, Alignment::kRight},
               {words("gap.length"), 1.3, Alignment::kRight},
               {words("gap.cause"), 3.6}},
              {}};
  for (const archive::GapEntry& gap : gaps) {
    if (table.rows.size() == kMost) break;
    const std::string stream = plain_text(gap.stream);
    table.rows.push_back({{gap.of_sound ? words("gap.sound", {stream}) : stream, Tone::kPlain, Face::kStrong},
                          {in_case(gap.span.start_ns)},
                          {in_case(gap.span.end_ns)},
                          {case_time(gap.span.end_ns - gap.span.start_ns)},
                          {cause_words(gap.cause)}});
  }
  add(std::move(table));
  if (gaps.size() > kMost) small(words("gap.further", {std::to_string(gaps.size() - kMost)}));
}

}  // namespace kiroku::report

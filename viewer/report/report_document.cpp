#include "viewer/report/report_document.h"

#include <algorithm>
#include <functional>
#include <set>
#include <utility>

#include "crypto/encoding.h"
#include "viewer/report/document_parts.h"
#include "viewer/report/figures_in_words.h"
#include "viewer/report/texts.h"
#include "viewer/report/time_figure.h"

namespace kiroku::report {
namespace {

using archive::Finding;
using archive::Severity;

/// Of long lists this many rows at each end are printed.
constexpr std::size_t kRowsAtEachEnd = 12;

class ReportMaker {
 public:
  explicit ReportMaker(const ReportInput& input)
      : in_(input),
        found_(input.verification),
        answers_(answer_checks(input.verification, input.given, input.facts.excerpt)),
        document_(empty_document(input, say(input.language, "report.title"))) {}

  Document make() {
    add(verdict_statement(in_));
    add_answers();
    add_case();
    add(PageBreak{});
    add_chain();
    add_streams();
    add_gaps();
    add_findings();
    add_time();
    add_device();
    add_hashes();
    add_repeating();
    add_about();
    add_words();
    return std::move(document_);
  }

 private:
  void add(Block block) { document_.blocks.push_back(std::move(block)); }
  void heading(TextKey key, int level = 1) { add(Heading{level, words(key)}); }
  void paragraph(std::string text) { add(Paragraph{std::move(text)}); }
  void small(std::string text) { add(Paragraph{std::move(text), ParagraphStyle::kSmall}); }
  [[nodiscard]] std::string words(TextKey key, std::initializer_list<std::string> values = {}) const {
    return say(in_.language, key, values);
  }
  [[nodiscard]] std::string count(std::uint64_t number, TextKey one, TextKey many) const {
    return say_count(in_.language, number, one, many);
  }
  [[nodiscard]] const CheckAnswer& answer(Check check) const {
    return *std::ranges::find(answers_, check, &CheckAnswer::check);
  }
  [[nodiscard]] std::string entries() const { return count(found_.entries, "one.entry", "many.entry"); }
  [[nodiscard]] std::string tokens() const { return count(found_.tokens, "one.token", "many.token"); }
  [[nodiscard]] std::string device_name() const {
    return plain_text(std::string_view(found_.device).substr(0, found_.device.find('+')));
  }

  void add_answers() {
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

  [[nodiscard]] std::string question(Check check) const {
    switch (check) {
      case Check::kLedger:
        return words("check.ledger");
      case Check::kFiles:
        return words("check.files");
      case Check::kStreams:
        return words("check.streams");
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

  [[nodiscard]] std::string explanation(const CheckAnswer& answered) const {
    if (answered.answer == Answer::kNotAsked) return not_asked(answered.check);
    if (answered.answer == Answer::kYes || answered.answer == Answer::kInsideOnly) {
      const std::string yes = yes_to(answered);
      return answered.notes == 0
                 ? yes
                 : words("check.notes-too", {yes, count(answered.notes, "one.note", "many.note")});
    }
    // The gravest finding of the question says why.
    const Finding* gravest = nullptr;
    std::size_t all = 0;
    for (const Finding& finding : found_.findings) {
      if (check_of(finding.code) != answered.check) continue;
      ++all;
      if (gravest == nullptr || finding.severity > gravest->severity) gravest = &finding;
    }
    if (gravest == nullptr) return words("time.none");
    return words("check.see-findings",
                 {meaning_of(in_.language, gravest->code), count(all, "one.finding", "many.finding")});
  }

  [[nodiscard]] std::string not_asked(Check check) const {
    if (check == Check::kLog) return words("check.log.not-asked");
    return check == Check::kEnd ? words("check.end.excerpt") : words("check.contents.not-asked");
  }

  [[nodiscard]] std::string yes_to(const CheckAnswer& answered) const {
    switch (answered.check) {
      case Check::kLedger:
        return words("check.ledger.yes",
                     {entries(), count(found_.checkpoints, "one.checkpoint", "many.checkpoint")});
      case Check::kFiles:
        return words("check.files.yes",
                     {count(found_.files, "one.file", "many.file"), byte_size(found_.bytes)});
      case Check::kStreams:
        return words("check.streams.yes");
      case Check::kEnd:
        return words("check.end.yes");
      case Check::kDevice:
        return words("check.device.yes", {device_name()});
      case Check::kTime:
        return answered.answer == Answer::kInsideOnly ? words("check.time.inside", {tokens()})
                                                      : words("check.time.yes", {tokens()});
      case Check::kLog:
        return words("check.log.yes");
      case Check::kContents:
        break;
    }
    return words("check.contents.yes");
  }

  [[nodiscard]] std::string reason() const {
    const std::string& reason = in_.facts.close_reason;
    if (reason == "operator") return words("reason.operator");
    if (reason == "duration") return words("reason.duration");
    if (reason == "sources-ended") return words("reason.sources-ended");
    if (reason == "disk-full") return words("reason.disk-full");
    if (reason == "recovered") return words("reason.recovered");
    return plain_text(reason);
  }

  void add_case() {
    heading("heading.case");
    const CaseFacts& facts = in_.facts;
    Table table = facts_table();
    add_fact(table, words("case.id"), document_.identifier);
    const auto by_device = [&](UtcTime time) { return words("case.by-device", {utc_time(time)}); };
    add_fact(table, words("case.opened"),
             facts.opened_at ? by_device(facts.opened_at->utc) : words("case.unknown"));
    if (!facts.excerpt) {
      add_fact(table, words("case.closed"),
               facts.closed_at ? by_device(facts.closed_at->utc) : words("case.not-closed"));
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
    add_fact(table, words("case.marks"), std::to_string(facts.marks));
    if (facts.opening) {
      add_fact(table, words("case.subject"),
               facts.opening->subject ? words("case.subject.yes") : words("case.subject.no"));
    }
    add(std::move(table));
  }

  [[nodiscard]] Chain::Link link(TextKey title, const CheckAnswer& answered, std::string text,
                                 std::string bond) const {
    return {{words(title), tone_of(answered.answer), Face::kStrong},
            answer_words(in_.language, answered.answer),
            std::move(text),
            std::move(bond)};
  }

  void add_chain() {
    heading("heading.chain");
    paragraph(words("chain.lead"));
    const CaseFacts& facts = in_.facts;
    Chain chain;
    chain.links.push_back(
        link("chain.segments", answer(Check::kFiles),
             words("chain.segments.text",
                   {count(facts.segments, "one.segment", "many.segment"), byte_size(facts.segment_bytes)}),
             words("chain.segments.bond")));
    chain.links.push_back(link("chain.ledger", answer(Check::kLedger),
                               words("chain.ledger.text", {entries()}), words("chain.ledger.bond")));
    CheckAnswer signatures = answer(Check::kDevice);
    const bool unsound = std::ranges::any_of(
        found_.findings, [](const Finding& finding) { return finding.code.starts_with("checkpoint-"); });
    if (unsound) signatures.answer = Answer::kNo;
    chain.links.push_back(
        link("chain.checkpoints", signatures,
             facts.last_checkpoint
                 ? words("chain.checkpoints.text",
                         {count(found_.checkpoints, "one.checkpoint", "many.checkpoint"), device_name(),
                          count(facts.last_checkpoint->size, "one.log-entry", "many.log-entry")})
                 : words("chain.checkpoints.none"),
             words("chain.checkpoints.bond")));
    std::set<std::string> authorities;
    std::string names;
    for (const StatedToken& token : facts.tokens) {
      if (authorities.insert(token.token.authority).second)
        names += (names.empty() ? "" : ", ") + token.token.authority;
    }
    chain.links.push_back(
        link("chain.tokens", answer(Check::kTime),
             facts.tokens.empty()
                 ? words("chain.tokens.none")
                 : words("chain.tokens.text", {tokens(), utc_time(facts.tokens.front().token.gen_time),
                                               utc_time(facts.tokens.back().token.gen_time)}),
             words("chain.tokens.bond")));
    chain.links.push_back(link("chain.authorities", answer(Check::kTime),
                               names.empty()             ? words("chain.authorities.none")
                               : in_.given.roots.empty() ? words("chain.authorities.unjudged", {names})
                                                         : words("chain.authorities.text", {names}),
                               ""));
    add(std::move(chain));
  }

  [[nodiscard]] std::string kind_words(const std::string& kind) const {
    if (kind == "video") return words("kind.video");
    if (kind == "audio") return words("kind.audio");
    if (kind == "vitals") return words("kind.vitals");
    if (kind == "events") return words("kind.events");
    return plain_text(kind);
  }

  /// On the case clock, counted from where the case begins.
  [[nodiscard]] std::string in_case(std::int64_t ns) const {
    return case_time(ns - (in_.facts.opening ? in_.facts.opening->begins_ns : 0));
  }

  void add_streams() {
    heading("heading.streams");
    if (found_.streams.empty()) return paragraph(words("case.unknown"));
    constexpr auto kRight = Alignment::kRight;
    Table table{{{words("stream.name"), 1.5},
                 {words("stream.kind"), 1.4},
                 {words("stream.from"), 1.55, kRight},
                 {words("stream.to"), 1.55, kRight},
                 {words("stream.segments"), 1.35, kRight},
                 {words("stream.frames"), 1.1, kRight},
                 {words("stream.dropped"), 1.25, kRight},
                 {words("stream.gaps"), 1.4, kRight},
                 {words("stream.size"), 1.2, kRight}},
                {}};
    for (const archive::StreamReport& stream : found_.streams) {
      const bool empty = stream.segments == 0;
      table.rows.push_back({{plain_text(stream.info.name), Tone::kPlain, Face::kStrong},
                            {kind_words(stream.info.kind)},
                            {empty ? words("stream.nothing") : in_case(stream.span.start_ns)},
                            {empty ? "" : in_case(stream.span.end_ns)},
                            {grouped(stream.segments)},
                            {grouped(stream.frames)},
                            {grouped(stream.dropped)},
                            {stream.gap_ns == 0 ? words("stream.none") : case_time(stream.gap_ns)},
                            {byte_size(stream.bytes)}});
    }
    add(std::move(table));
    small(words("stream.lead"));
    add(Picture{time_figure(found_, in_.facts, in_.language, kTextWidth), words("figure.time")});
  }

  [[nodiscard]] std::string cause_words(archive::GapCause cause) const {
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
      case archive::GapCause::kInterrupted:
        break;
    }
    return words("cause.interrupted");
  }

  void add_gaps() {
    heading("heading.gaps", 2);
    const auto& gaps = in_.facts.gaps;
    if (gaps.empty()) return paragraph(words("gap.none"));
    constexpr std::size_t kMost = 60;
    Table table{{{words("stream.name"), 1.4},
                 {words("gap.from"), 1.3, Alignment::kRight},
                 {words("gap.to"), 1.3, Alignment::kRight},
                 {words("gap.length"), 1.3, Alignment::kRight},
                 {words("gap.cause"), 3.6}},
                {}};
    for (const archive::GapEntry& gap : gaps) {
      if (table.rows.size() == kMost) break;
      table.rows.push_back({{plain_text(gap.stream), Tone::kPlain, Face::kStrong},
                            {in_case(gap.span.start_ns)},
                            {in_case(gap.span.end_ns)},
                            {case_time(gap.span.end_ns - gap.span.start_ns)},
                            {cause_words(gap.cause)}});
    }
    add(std::move(table));
    if (gaps.size() > kMost) small(words("gap.further", {std::to_string(gaps.size() - kMost)}));
  }

  [[nodiscard]] std::string place_of(const Finding& finding) const {
    std::vector<std::string> parts;
    if (!finding.file.empty()) parts.push_back(plain_text(finding.file));
    if (finding.entry) {
      std::string entry = words("finding.entry", {std::to_string(*finding.entry)});
      const auto written = in_.facts.written.find(*finding.entry);
      const bool of_case = !finding.file.starts_with("log/") && written != in_.facts.written.end();
      if (of_case) entry += ", " + words("finding.at", {in_case(written->second.mono_ns)});
      parts.push_back(std::move(entry));
    }
    if (finding.offset) parts.push_back(words("finding.byte", {std::to_string(*finding.offset)}));
    if (parts.empty()) return words("finding.whole");
    std::string place = parts[0];
    for (std::size_t i = 1; i < parts.size(); ++i) place += "\n" + parts[i];
    return place;
  }

  /// The code's meaning, and what the verifier says of this place where that is more.
  [[nodiscard]] std::string meaning_and_text(const Finding& finding) const {
    const std::string meaning = meaning_of(in_.language, finding.code);
    const std::string english = meaning_of(Language::kEnglish, finding.code);
    const bool same =
        english.size() == finding.text.size() + 1 && english.substr(1).starts_with(finding.text.substr(1));
    return same ? meaning : meaning + "\n" + plain_text(finding.text);
  }

  void add_findings() {
    heading("heading.findings");
    if (found_.findings.empty()) return paragraph(words("findings.none"));
    small(words("findings.lead"));
    std::vector<Finding> findings = found_.findings;
    std::ranges::stable_sort(findings, std::greater<>(), &Finding::severity);
    Table table{{{words("finding.number"), 0.55, Alignment::kRight},
                 {words("finding.what"), 2},
                 {words("finding.place"), 2.4},
                 {words("finding.meaning"), 3.6}},
                {}};
    for (const Finding& finding : findings) {
      table.rows.push_back({{std::to_string(table.rows.size() + 1)},
                            {severity_words(in_.language, finding.severity) + "\n" + plain_text(finding.code),
                             tone_of(finding.severity)},
                            {place_of(finding)},
                            {meaning_and_text(finding)}});
    }
    add(std::move(table));
  }

  /// Rows of a long list: all, or as many at each end; then what `further` says of the number left out.
  template <typename Row>
  void add_long_table(Table table, std::size_t size, const Row& row, TextKey further) {
    const bool all = size <= 2 * kRowsAtEachEnd;
    for (std::size_t i = 0; i < size; ++i) {
      if (all || i < kRowsAtEachEnd || i >= size - kRowsAtEachEnd) table.rows.push_back(row(i));
    }
    add(std::move(table));
    if (!all) small(words(further, {std::to_string(size - 2 * kRowsAtEachEnd)}));
  }

  void add_time() {
    heading("heading.time");
    paragraph(words("time.lead"));
    if (found_.time == archive::TimeProof::kSelfIssued) paragraph(words("time.lead-inside"));
    heading("heading.brackets", 2);
    if (found_.brackets.empty()) {
      paragraph(words("time.no-brackets"));
    } else {
      const auto limit = [&](const std::optional<UtcTime>& time) {
        return time ? utc_time(*time, true) : words("time.no-limit");
      };
      add_long_table(
          {{{words("bracket.entries"), 1},
            {words("time.earliest"), 2.9},
            {words("time.latest"), 2.9},
            {words("bracket.authorities"), 1.6}},
           {}},
          found_.brackets.size(),
          [&](std::size_t i) {
            const archive::Bracket& bracket = found_.brackets[i];
            std::string by = bracket.authority_before;
            if (bracket.authority_after != by && !bracket.authority_after.empty())
              by += (by.empty() ? "" : ", ") + bracket.authority_after;
            return std::vector<Cell>{
                {std::to_string(bracket.first_entry) + "–" + std::to_string(bracket.last_entry)},
                {limit(bracket.not_before)},
                {limit(bracket.not_after)},
                {plain_text(by)}};
          },
          "bracket.further");
    }
    add_tokens();
    add_clocks();
  }

  void add_tokens() {
    heading("heading.tokens", 2);
    const auto& stated = in_.facts.tokens;
    if (stated.empty()) {
      paragraph(words("chain.tokens.none"));
    } else {
      add_long_table(
          {{{words("token.authority"), 1.1},
            {words("token.time"), 3},
            {words("token.covers"), 1.1},
            {words("token.hash"), 3.3}},
           {}},
          stated.size(),
          [&](std::size_t i) {
            const archive::TokenEntry& token = stated[i].token;
            return std::vector<Cell>{
                {token.authority},
                {utc_time(token.gen_time, true)},
                {"0–" + std::to_string(token.checkpoint == 0 ? 0 : token.checkpoint - 1)},
                {crypto::to_hex(token.sha256), Tone::kPlain, Face::kMono}};
          },
          "token.further");
    }
    if (in_.facts.missed_tokens > 0) {
      paragraph(words("token.missed", {count(in_.facts.missed_tokens, "one.request", "many.request")}));
    }
  }

  void add_clocks() {
    if (found_.clocks.empty() || !found_.clock_zero) return;
    heading("heading.clocks", 2);
    Table table{{{words("clock.authority"), 1.4},
                 {words("clock.offset"), 2.6, Alignment::kRight},
                 {words("clock.drift"), 2.6, Alignment::kRight},
                 {words("clock.compared"), 1.2, Alignment::kRight}},
                {}};
    const auto within = [](std::int64_t ns, std::int64_t half_width_ns) {
      return signed_seconds(ns) + " ± " + signed_seconds(half_width_ns).substr(1);
    };
    for (const archive::AuthorityClock& clock : found_.clocks) {
      table.rows.push_back(
          {{plain_text(clock.authority), Tone::kPlain, Face::kStrong},
           {within(archive::offset_ns(clock.first, *found_.clock_zero), clock.first.half_width_ns)},
           {clock.comparisons > 1 ? within(clock.drift_ns(), clock.drift_half_width_ns()) : "–"},
           {std::to_string(clock.comparisons)}});
    }
    add(std::move(table));
  }

  void add_device() {
    heading("heading.device");
    Table table = facts_table();
    add_fact(table, words("device.name"), device_name().empty() ? words("case.unknown") : device_name());
    if (!found_.device.empty()) {
      const std::string key = plain_text(found_.device);
      const std::size_t id = key.find('+');
      add_fact(table, words("device.key"), key, Face::kMono);
      if (id != std::string::npos) add_fact(table, words("device.id"), key.substr(id + 1, 8), Face::kMono);
    }
    add_fact(table, words("device.trusted"), device_trust_words(in_));
    add(std::move(table));
    small(words("device.lead"));
  }

  void add_hashes() {
    heading("heading.hashes");
    const CaseFacts& facts = in_.facts;
    Table table = facts_table();
    const auto hash = [&](std::string name, const crypto::Sha256Digest& digest) {
      add_fact(table, std::move(name), crypto::to_hex(digest), Face::kMono);
    };
    hash(words("hash.ledger", {facts.ledger.name}), facts.ledger.sha256);
    add_fact(table, words("hash.entries"), grouped(facts.entries));
    if (facts.root) hash(words("hash.root"), *facts.root);
    if (facts.last_checkpoint) {
      add_fact(table, words("hash.checkpoint"),
               facts.last_checkpoint->file + " (" +
                   count(facts.last_checkpoint->size, "one.log-entry", "many.log-entry") + ")");
      hash(words("hash.checkpoint-root"), facts.last_checkpoint->root);
    }
    if (facts.opening) {
      if (facts.opening->subject) hash(words("hash.subject"), facts.opening->subject->sha256);
      if (facts.opening->plan) hash(words("hash.plan"), *facts.opening->plan);
      const std::uint64_t log_size = facts.opening->appliance_log_size;
      if (log_size > 0) {
        add_fact(table, words("hash.log"),
                 words("hash.log.text", {count(log_size, "one.log-entry", "many.log-entry"),
                                         crypto::to_hex(facts.opening->appliance_log_root)}),
                 Face::kMono);
      }
    }
    add(std::move(table));
    small(words("hash.lead"));
  }

  void add_repeating() {
    heading("heading.repeat");
    const CaseFacts& facts = in_.facts;
    const std::string name = document_.identifier.empty() ? "CASE" : document_.identifier;
    const Listing verify{
        {"kiroku verify " + (facts.excerpt ? "EXCERPT" : name) + " --device DEVICE.pub --trust ROOTS.pem"}};
    if (facts.excerpt) {
      paragraph(words("repeat.excerpt"));
      return add(verify);
    }
    paragraph(words("repeat.lead"));
    paragraph(words("repeat.hash"));
    add(Listing{
        {"sha256sum " + facts.ledger.name, crypto::to_hex(facts.ledger.sha256) + "  " + facts.ledger.name}});
    paragraph(words("repeat.files"));
    add(Listing{
        {R"sh(jq -r '(.subject // .) | select(.file) | "\(.sha256)  \(.file)"' ledger.jsonl | sha256sum -c --quiet)sh"}});
    if (!facts.tokens.empty()) {
      const archive::TokenEntry& last = facts.tokens.back().token;
      paragraph(words("repeat.token"));
      add(Listing{{"openssl ts -verify -data " + note_of(last.file) + " -in " + plain_text(last.file) + " \\",
                   "  -CAfile ROOTS.pem -untrusted authorities/" + last.authority + ".pem"}});
    }
    paragraph(words("repeat.all"));
    add(verify);
  }

  /// The note that a token is over: "tokens/00000042.swiss.tsr" is over "checkpoints/00000042.note".
  static std::string note_of(const std::string& token_file) {
    const std::size_t begin = token_file.rfind('/') + 1;
    return plain_text("checkpoints/" + token_file.substr(begin, token_file.find('.', begin) - begin) +
                      ".note");
  }

  void add_about() {
    heading("heading.about");
    Table table = facts_table();
    add_fact(table, words("about.by"), document_.author);
    add_fact(table, words("about.when"), utc_time(in_.made));
    add_fact(table, words("about.with"), in_.program);
    add_fact(table, words("about.given"), given_words());
    add(std::move(table));
    small(words("about.lead"));
  }

  [[nodiscard]] std::string given_words() const {
    std::string out;
    const auto list = [&](TextKey key, const std::vector<GivenFile>& files) {
      if (files.empty()) return;
      std::string names;
      for (const GivenFile& file : files) {
        names += (names.empty() ? "" : ", ") + plain_text(file.name);
        if (file.sha256) names += " (SHA-256 " + crypto::to_hex(*file.sha256) + ")";
      }
      out += (out.empty() ? "" : "\n") + words(key, {names});
    };
    list("given.devices", in_.given.devices);
    list("given.roots", in_.given.roots);
    list("given.log", in_.given.log);
    list("given.identity", in_.given.identities);
    return out.empty() ? words("about.given.nothing") : out;
  }

  void add_words() {
    heading("heading.words");
    Table table = facts_table();
    add_fact(table, words("word.segment"), words("word.segment.text"));
    add_fact(table, words("word.hash"), words("word.hash.text"));
    add_fact(table, words("word.ledger"), words("word.ledger.text"));
    add_fact(table, words("word.root"), words("word.root.text"));
    add_fact(table, words("word.checkpoint"), words("word.checkpoint.text"));
    add_fact(table, words("word.token"), words("word.token.text"));
    add_fact(table, words("word.bracket"), words("word.bracket.text"));
    add_fact(table, words("word.gap"), words("word.gap.text"));
    add(std::move(table));
  }

  const ReportInput& in_;
  const archive::VerificationReport& found_;
  std::vector<CheckAnswer> answers_;
  Document document_;
};

}  // namespace

Document make_report(const ReportInput& input) { return ReportMaker(input).make(); }

}  // namespace kiroku::report

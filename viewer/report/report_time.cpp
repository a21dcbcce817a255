// Between which times entries were written, by which tokens, and how the clocks ran.
#include <algorithm>

#include "crypto/encoding.h"
#include "viewer/report/report_maker.h"

namespace kiroku::report {

namespace {

/// Of long lists this many rows at each end are printed.
constexpr std::size_t kRowsAtEachEnd = 12;

}  // namespace

template <typename Row>
void ReportMaker::add_long_table(Table table, std::size_t size, const Row& row, TextKey further) {
  const bool all = size <= 2 * kRowsAtEachEnd;
  for (std::size_t i = 0; i < size; ++i) {
    if (all || i < kRowsAtEachEnd || i >= size - kRowsAtEachEnd) table.rows.push_back(row(i));
  }
  add(std::move(table));
  if (!all) small(words(further, {std::to_string(size - 2 * kRowsAtEachEnd)}));
}

std::string ReportMaker::time_lead() const {
  if (found_.time == archive::TimeProof::kNone) return time_sentence(in_);  // there are no brackets then
  if (found_.time == archive::TimeProof::kSelfIssued) return words("time.lead.self-issued");
  const std::vector<archive::TimeRemark> remarks = archive::time_remarks(found_);
  if (found_.time == archive::TimeProof::kExternal &&
      std::ranges::find(remarks, archive::TimeRemark::kThereByThen) != remarks.end())
    return words("time.lead", {words("time.lead.there-by-then")});
  return words("time.lead",
               {found_.time == archive::TimeProof::kExternal
                    ? words("time.lead.external")
                    : words("time.lead.external-in-part", {std::to_string(found_.outside_entries - 1)})});
}

void ReportMaker::add_time() {
  heading("heading.time");
  paragraph(time_lead());
  if (found_.outside_tokens > 0 && found_.own_tokens > 0)
    paragraph(words("time.lead.own-too", {count(found_.own_tokens, "one.token", "many.token")}));
  heading("heading.brackets", 2);
  // Where no token holds there is one bracket, without a time.
  if (found_.brackets.empty() || found_.time == archive::TimeProof::kNone) {
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
              {plain_text(by) + (bracket.time == archive::TimeProof::kSelfIssued ? words("clock.own") : "")}};
        },
        "bracket.further");
  }
  add_tokens();
  add_clocks();
}

const archive::ProvingToken* ReportMaker::proving(std::uint64_t entry) const {
  const auto& all = found_.proving_tokens;
  const auto its = std::ranges::lower_bound(all, entry, {}, &archive::ProvingToken::entry);
  return its != all.end() && its->entry == entry ? &*its : nullptr;
}

std::vector<const StatedToken*> ReportMaker::relied_on() const {
  std::vector<const StatedToken*> outside, own;
  for (const StatedToken& token : in_.facts.tokens) {
    if (const auto* const proof = proving(token.entry)) (proof->outside ? outside : own).push_back(&token);
  }
  return outside.empty() ? own : outside;
}

// What a token states counts only where the token holds: anybody can make one of any time.
std::string ReportMaker::tokens_words() const {
  const auto stated = in_.facts.tokens.size();
  if (stated == 0) return words("chain.tokens.none");
  const std::vector<const StatedToken*> relied = relied_on();
  if (relied.empty()) return words("chain.tokens.unproven", {count(stated, "one.token", "many.token")});
  const auto [first, last] =
      std::ranges::minmax(relied, {}, [](const StatedToken* token) { return token->token.gen_time; });
  std::string out =
      words("chain.tokens.text", {count(relied.size(), "one.token", "many.token"),
                                  utc_time(first->token.gen_time), utc_time(last->token.gen_time)});
  if (stated > relied.size()) out += words("chain.tokens.others", {std::to_string(stated - relied.size())});
  return out;
}

void ReportMaker::add_tokens() {
  heading("heading.tokens", 2);
  const auto& stated = in_.facts.tokens;
  if (stated.empty()) {
    paragraph(words("chain.tokens.none"));
  } else {
    add_long_table(
        {{{words("token.authority"), 1.1},
          {words("token.time"), 2.4},
          {words("token.covers"), 1},
          {words("token.holds"), 1.5},
          {words("token.hash"), 2.9}},
         {}},
        stated.size(),
        [&](std::size_t i) {
          const archive::TokenEntry& token = stated[i].token;
          const auto* const proof = proving(stated[i].entry);
          return std::vector<Cell>{{token.authority},
                                   {utc_time(token.gen_time, true)},
                                   {"0–" + std::to_string(token.checkpoint == 0 ? 0 : token.checkpoint - 1)},
                                   {words(proof == nullptr ? TextKey("token.holds.no")
                                          : proof->outside ? TextKey("token.holds.outside")
                                                           : TextKey("token.holds.own")),
                                    proof == nullptr ? Tone::kCaution : Tone::kPlain},
                                   {crypto::to_hex(token.sha256), Tone::kPlain, Face::kMono}};
        },
        "token.further");
  }
  if (in_.facts.missed_tokens > 0) {
    paragraph(words("token.missed", {count(in_.facts.missed_tokens, "one.request", "many.request")}));
  }
}

void ReportMaker::add_clocks() {
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
        {{plain_text(clock.authority) + (clock.outside ? "" : words("clock.own")), Tone::kPlain,
          Face::kStrong},
         {within(archive::offset_ns(clock.first, *found_.clock_zero), clock.first.half_width_ns)},
         {clock.comparisons > 1 ? within(clock.drift_ns(), clock.drift_half_width_ns()) : "–"},
         {std::to_string(clock.comparisons)}});
  }
  add(std::move(table));
}

}  // namespace kiroku::report

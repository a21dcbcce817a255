// Keys and hashes, how to check again, and what words mean.
#include <algorithm>

#include "archive/format/case_layout.h"
#include "archive/verify/folder_names.h"
#include "crypto/encoding.h"
#include "viewer/report/proof_files.h"
#include "viewer/report/report_maker.h"

namespace kiroku::report {

void ReportMaker::add_device() {
  heading("heading.device");
  Table table = facts_table();
  add_fact(table, words("device.name"), device_name().empty() ? words("case.unknown") : device_name());
  if (!found_.device.empty()) {
    // A name has no "+"; of the rest nothing may be cut off.
    const std::size_t id = std::min(found_.device.find('+'), found_.device.size());
    add_fact(table, words("device.key"), device_name() + plain_text(found_.device.substr(id)), Face::kMono);
    if (id < found_.device.size())
      add_fact(table, words("device.id"), plain_text(found_.device.substr(id + 1, 8)), Face::kMono);
  }
  add_fact(table, words("device.trusted"), device_trust_words(in_));
  add_fact(table, words("device.signatures"), signature_words(in_));
  add(std::move(table));
  small(words("device.lead"));
}

void ReportMaker::add_hashes() {
  heading("heading.hashes");
  const CaseFacts& facts = in_.facts;
  Table table = facts_table();
  const auto hash = [&](std::string name, const crypto::Sha256Digest& digest) {
    add_fact(table, std::move(name), crypto::to_hex(digest), Face::kMono);
  };
  hash(words("hash.ledger", {facts.ledger.name}), facts.ledger.sha256);
  if (is_of_later_version(found_)) return add(std::move(table));
  add_fact(table, words(facts.excerpt ? TextKey("hash.entries.excerpt") : TextKey("hash.entries")),
           grouped(facts.entries));
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

void ReportMaker::add_attached() {
  if (in_.attachments.empty()) return;
  heading("heading.attached");
  paragraph(words("attached.lead"));
  Table table{{{words("attached.name"), 2.2},
               {words("attached.what"), 2.2},
               {words("attached.bytes"), 0.8, Alignment::kRight},
               {words("attached.hash"), 2.9}},
              {}};
  std::size_t tokens = 0;
  for (const Attachment& file : in_.attachments) {
    if (file.media_type == "application/timestamp-reply") ++tokens;
    table.rows.push_back({{plain_text(file.name), Tone::kPlain, Face::kMono},
                          {file.description},
                          {grouped(file.bytes.size())},
                          {crypto::to_hex(crypto::sha256(file.bytes)), Tone::kPlain, Face::kMono}});
  }
  add(std::move(table));
  if (tokens > 0 && tokens < relied_on().size()) small(words("attached.further"));
  document_.attachments = in_.attachments;
}

void ReportMaker::add_repeating() {
  heading("heading.repeat");
  const CaseFacts& facts = in_.facts;
  const std::string name = document_.identifier.empty() ? "CASE" : document_.identifier;
  std::string against;
  for (std::size_t i = 0; i < in_.given.against.size(); ++i) against += " --against NOTE";
  const bool carries_log_proof =
      std::ranges::find(in_.attachments, kLogProofFile, &Attachment::name) != in_.attachments.end();
  const Listing verify{{"kiroku verify " + (facts.excerpt ? "EXCERPT" : name) + " --device DEVICE.pub " +
                        (found_.time == archive::TimeProof::kSelfIssued ? "--own-authority OWN-AUTHORITY.pem"
                                                                        : "--trust ROOTS.pem") +
                        (in_.given.log.empty() ? "" : " --log LOG") + against +
                        (in_.given.evidence.empty() ? "" : " --evidence RECORD.ers") +
                        (in_.given.policy.empty() ? "" : " --policy POLICY.toml") +
                        (carries_log_proof         ? " --proof " + std::string(kLogProofFile)
                         : in_.given.proof.empty() ? ""
                                                   : " --proof CASE.tlog-proof") +
                        (in_.given.witnesses.empty() ? "" : " --witnesses WITNESSES.txt") +
                        (in_.given.identities.empty() ? "" : " -i IDENTITY.txt")}};
  if (is_of_later_version(found_)) {
    paragraph(words("repeat.newer"));
    return add(verify);
  }
  if (facts.excerpt) {
    paragraph(words("repeat.excerpt"));
    return add(verify);
  }
  paragraph(words("repeat.lead"));
  paragraph(words("repeat.hash"));
  add(Listing{
      {"sha256sum " + facts.ledger.name, crypto::to_hex(facts.ledger.sha256) + "  " + facts.ledger.name}});
  std::uint64_t erased = 0;
  for (const archive::StreamReport& stream : found_.streams) erased += stream.erased_segments;
  paragraph(erased == 0 ? words("repeat.files")
                        : words("repeat.files.erased", {count(erased, "one.segment", "many.segment")}));
  add(Listing{
      {R"sh(jq -r '(.subject // .) | select(.file) | "\(.sha256)  \(.file)"' ledger.jsonl | sha256sum -c --quiet)sh"}});
  if (!facts.tokens.empty()) {
    // By what the format calls the files: an entry may name any text, which a shell would obey.
    std::vector<const StatedToken*> relied = relied_on();
    if (relied.empty()) relied.push_back(&facts.tokens.back());
    // openssl alone cannot follow the way to a token that others share: the page has a script for it.
    std::erase_if(relied, [](const StatedToken* each) {
      const auto called = archive::token_of_path(each->token.file);
      return called && called->form == archive::TokenForm::kShared;
    });
    if (!relied.empty()) {
      const archive::TokenEntry& last = relied.back()->token;
      paragraph(words("repeat.token"));
      add(Listing{{"openssl ts -verify -data " + archive::note_path(last.checkpoint) + " -in " +
                       archive::token_path(last.checkpoint, last.authority, archive::TokenForm::kResponse) +
                       " \\",
                   "  -CAfile ROOTS.pem -untrusted authorities/" + last.authority + ".pem"}});
    }
  }
  paragraph(words("repeat.all"));
  add(verify);
}

void ReportMaker::add_about() {
  heading("heading.about");
  Table table = facts_table();
  add_fact(table, words("about.by"), document_.author);
  add_fact(table, words("about.when"), utc_time(in_.made));
  add_fact(table, words("about.with"), in_.program);
  add_fact(table, words("about.given"), given_words());
  add(std::move(table));
  small(words("about.lead"));
}

std::string ReportMaker::given_words() const {
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
  list("given.own-roots", in_.given.own_roots);
  list("given.log", in_.given.log);
  list("given.against", in_.given.against);
  list("given.evidence", in_.given.evidence);
  list("given.policy", in_.given.policy);
  list("given.proof", in_.given.proof);
  list("given.witnesses", in_.given.witnesses);
  list("given.identity", in_.given.identities);
  return out.empty() ? words("about.given.nothing") : out;
}

void ReportMaker::add_words() {
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

}  // namespace kiroku::report

#include "viewer/report/case_facts.h"

#include <algorithm>
#include <utility>

#include "archive/format/case_folder.h"
#include "archive/format/case_layout.h"
#include "archive/format/excerpt_document.h"
#include "archive/format/limits.h"
#include "archive/format/line_reader.h"
#include "archive/verify/excerpt_verifier.h"
#include "base/error.h"
#include "crypto/hash.h"
#include "crypto/hashed_source.h"
#include "crypto/merkle_tree.h"

namespace kiroku::report {
namespace {

using archive::CaseFolder;

archive::ReadableFile open_or_throw(const CaseFolder& folder, std::string_view name) {
  archive::FileOpening opening = folder.open_file(name);
  if (!opening.file) {
    throw UsageError("cannot report on " + folder.path().string() + ": there is no readable " +
                     std::string(name) + " in it; give the folder of a case or of an excerpt");
  }
  return std::move(*opening.file);
}

struct Taking {
  CaseFacts* facts;
  archive::Moment at;
  std::uint64_t entry;

  void operator()(const archive::OpenEntry& open) const {
    if (facts->opening) return;
    facts->opening = open;
    facts->opened_at = at;
  }
  void operator()(const archive::SegmentEntry& segment) const {
    ++facts->segments;
    facts->segment_bytes += segment.file.bytes;
    facts->last_ns = std::max(facts->last_ns, segment.span.end_ns);
  }
  // A gap says what is not there: it makes no case longer.
  void operator()(const archive::GapEntry& gap) const { facts->gaps.push_back(gap); }
  void operator()(const archive::TokenEntry& token) const { facts->tokens.push_back({entry, token}); }
  void operator()(const archive::TokenMissedEntry& /*missed*/) const { ++facts->missed_tokens; }
  void operator()(const archive::MarkEntry& /*mark*/) const { ++facts->marks; }
  void operator()(const archive::CloseEntry& close) const {
    facts->closed_at = at;
    facts->closed_by = entry;
    facts->close_reason = close.reason;
  }
  void operator()(const archive::ClockEntry& clock) const {
    if (clock.step_ns == 0 || facts->closed_at) return;
    facts->clock_set = true;
    // Whoever writes a ledger can state what no clock counts.
    constexpr std::int64_t kMost = INT64_MAX / 2;
    facts->clock_set_ns =
        std::clamp(std::clamp(clock.step_ns, -kMost, kMost) + facts->clock_set_ns, -kMost, kMost);
  }
  void operator()(const archive::RecoveredEntry& /*recovered*/) const {}
  void operator()(const archive::ErasedEntry& /*erased*/) const {}
};

void take_line(CaseFacts& facts, std::string_view line) {
  const archive::EntryParse parse = archive::parse_case_entry(line);
  if (!parse.entry) return;
  facts.written.try_emplace(parse.entry->seq, parse.entry->at);
  facts.last_ns = std::max(facts.last_ns, parse.entry->at.mono_ns);
  std::visit(Taking{&facts, parse.entry->at, parse.entry->seq}, parse.entry->body);
}

/// Takes in whole lines, `most` of them.
void take_lines(CaseFacts& facts, const crypto::ByteSource& lines, std::uint64_t most,
                crypto::MerkleFrontier& tree) {
  archive::LineReader reader(lines);
  archive::LedgerLine line;
  for (facts.entries = 0; facts.entries < most && reader.next(line) && !line.torn; ++facts.entries) {
    tree.append(crypto::merkle_leaf_hash(bytes_of(line.text)));
    if (!line.too_long) take_line(facts, line.text);
  }
}

/// The checkpoint that was judged. Whoever can write to the folder can put another one there at any time,
/// under its name or beside it: no other one is taken.
StoredNote read_judged(const CaseFolder& folder, const archive::JudgedNote& judged) {
  const std::string path = archive::note_path(judged.size);
  const archive::FileOpening opening = folder.open_file(path);
  auto text = opening.file ? archive::read_small(*opening.file, archive::kMaximumNoteBytes) : std::nullopt;
  if (!text || crypto::sha256(bytes_of(*text)) != judged.sha256) {
    throw Error("cannot report on " + folder.path().string() + ": its " + path +
                " changed after it was verified; find out what writes to it, and try again");
  }
  return {path, std::move(*text), judged.size, judged.root};
}

CaseFacts read_facts(const std::filesystem::path& path, const archive::VerificationReport* verification) {
  const CaseFolder folder = CaseFolder::open(path);
  CaseFacts facts;
  crypto::MerkleFrontier tree;
  facts.excerpt = archive::is_excerpt(folder);
  const std::string name(facts.excerpt ? archive::kExcerptLinesFile : archive::kLedgerFile);
  if (facts.excerpt) take_lines(facts, open_or_throw(folder, archive::kExcerptOpenFile), 1, tree);
  // The hash that a document states and the lines that it tells of are of the same bytes.
  const archive::ReadableFile file = open_or_throw(folder, name);
  if (file.hole_bytes() > archive::kMostBytesOfLine) {
    throw Error("cannot report on " + path.string() + ": " + name +
                " has a hole, which can be as long as one likes; see what `kiroku verify` says of the case");
  }
  const auto trail = std::make_shared<const crypto::HashTrail>(crypto::HashTrail::of(file));
  const crypto::HashedSource hashed(file, trail, (path / name).string());
  const bool is_judged = verification != nullptr && verification->lines_root;
  take_lines(facts, hashed, is_judged ? verification->entries : UINT64_MAX, tree);
  if (is_judged && (facts.entries != verification->entries || tree.root() != *verification->lines_root)) {
    throw Error("cannot report on " + path.string() +
                ": its ledger changed after it was verified; find out what writes to it, and try again");
  }
  facts.ledger = {name, trail->digest()};
  if (!facts.excerpt) facts.root = tree.root();
  if (is_judged && verification->newest_note)
    facts.last_checkpoint = read_judged(folder, *verification->newest_note);
  return facts;
}

}  // namespace

CaseFacts read_case_facts(const std::filesystem::path& folder) { return read_facts(folder, nullptr); }

CaseFacts read_case_facts(const std::filesystem::path& folder,
                          const archive::VerificationReport& verification) {
  return read_facts(folder, &verification);
}

}  // namespace kiroku::report

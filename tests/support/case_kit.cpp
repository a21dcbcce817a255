#include "tests/support/case_kit.h"

#include <fstream>
#include <iterator>
#include <stdexcept>
#include <utility>

#include "archive/format/case_layout.h"
#include "crypto/merkle_tree.h"

namespace kiroku::test {

namespace fs = std::filesystem;
using namespace archive;

namespace {

std::vector<std::string> whole_lines(const fs::path& file) {
  const std::string text = contents(file);
  std::vector<std::string> lines;
  std::size_t at = 0;
  for (std::size_t end = text.find('\n'); end != std::string::npos; end = text.find('\n', at)) {
    lines.push_back(text.substr(at, end - at));
    at = end + 1;
  }
  return lines;
}

void check_file(const fs::path& folder, const FileReference& reference, std::vector<std::string>& lies) {
  if (!fs::is_regular_file(folder / reference.file)) {
    lies.push_back(reference.file + " is named and not there");
    return;
  }
  const std::string bytes = contents(folder / reference.file);
  if (bytes.size() != reference.bytes || crypto::sha256(bytes_of(bytes)) != reference.sha256) {
    lies.push_back(reference.file + " is not what its entry says");
  }
}

}  // namespace

Moment moment(std::int64_t mono_ns) { return {*parse_utc("2026-08-05T09:15:02Z"), mono_ns}; }

CaseKit::CaseKit(fs::path archive) : archive_(std::move(archive)) {}

CaseWriter::Options CaseKit::options() const {
  CaseWriter::Options options;
  options.archive = archive_;
  options.key = &key_;
  options.device_name = "theatre-1";
  StreamInfo room;
  room.name = "room";
  room.kind = "video";
  room.media = "video/mp2t";
  room.source = "synthetic:room";
  room.profile = "mpeg2";
  room.purpose = "room";
  StreamInfo vitals = room;
  vitals.name = "vitals";
  vitals.kind = "vitals";
  vitals.media = "application/jsonl";
  vitals.profile = "jsonl";
  options.streams = {room, vitals};
  options.stream_recipients = {recipients_, recipients_};
  options.subject = to_bytes(R"({"patient":"A"})");
  options.subject_recipients = recipients_;
  options.boot_id = "b1";
  return options;
}

SegmentEntry commit_segment(CaseWriter& writer, std::size_t stream, const std::string& name,
                            std::uint64_t index, const std::string& plaintext) {
  const auto segment = writer.begin_segment(stream, index);
  segment->write(bytes_of(plaintext));
  segment->seal();
  SegmentEntry entry;
  entry.file = segment->commit();
  entry.stream = name;
  entry.index = index;
  entry.span = {static_cast<std::int64_t>(index) * 2'000'000'000,
                static_cast<std::int64_t>(index + 1) * 2'000'000'000};
  const bool has_lines = name != "endoscope" && name != "room";
  entry.time_base = has_lines ? "1/1000000000" : "1/90000";
  entry.first_pts = has_lines ? entry.span.start_ns : static_cast<std::int64_t>(index) * 180'000;
  entry.frames = 50;
  entry.dropped = index;
  return entry;
}

std::vector<CaseEntry> entries_of(const fs::path& folder) {
  std::vector<CaseEntry> entries;
  for (const std::string& line : whole_lines(folder / kLedgerFile)) {
    EntryParse parsed = parse_case_entry(line);
    if (!parsed.entry) {
      throw std::runtime_error(parsed.problem);
    }
    entries.push_back(std::move(*parsed.entry));
  }
  return entries;
}

std::vector<std::string> lies_of(const fs::path& folder, const CaseKit& kit) {
  std::vector<std::string> lies;
  std::vector<crypto::Sha256Digest> roots;
  crypto::MerkleFrontier tree;
  for (const std::string& line : whole_lines(folder / kLedgerFile)) {
    const EntryParse parsed = parse_case_entry(line);
    if (!parsed.entry || parsed.entry->seq != tree.size()) {
      lies.push_back("line " + std::to_string(tree.size()) + " is no entry of its place");
      return lies;
    }
    const CaseEntryBody& body = parsed.entry->body;
    if (const auto* open = std::get_if<OpenEntry>(&body); open != nullptr && open->subject) {
      check_file(folder, *open->subject, lies);
    } else if (const auto* segment = std::get_if<SegmentEntry>(&body)) {
      check_file(folder, segment->file, lies);
    } else if (const auto* token = std::get_if<TokenEntry>(&body)) {
      check_file(folder, {token->file, contents(folder / token->file).size(), token->sha256}, lies);
    }
    tree.append(crypto::merkle_leaf_hash(bytes_of(line)));
    roots.push_back(tree.root());
  }
  if (roots.empty()) {
    lies.emplace_back("the ledger is empty");
  }
  for (const fs::directory_entry& file : fs::directory_iterator(folder / kCheckpointsFolder)) {
    const auto size = size_of_note_name(file.path().filename().string());
    if (!size) {
      continue;  // a part
    }
    const auto note =
        crypto::open_note(contents(file.path()), {crypto::VerifierKey("theatre-1", kit.key().public_key())});
    const auto checkpoint = crypto::Checkpoint::parse(note.text);
    const bool holds = !note.failure && checkpoint && checkpoint->size == *size && *size <= roots.size() &&
                       checkpoint->root == roots[*size - 1];
    if (!holds) {
      lies.push_back(file.path().filename().string() + " is not signed over this ledger");
    }
  }
  return lies;
}

std::string contents(const fs::path& file) {
  std::ifstream input(file, std::ios::binary);
  return {std::istreambuf_iterator<char>(input), {}};
}

}  // namespace kiroku::test

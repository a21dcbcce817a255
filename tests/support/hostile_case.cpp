#include "tests/support/hostile_case.h"

#include <algorithm>
#include <sys/stat.h>
#include <utility>

#include "archive/format/case_layout.h"
#include "archive/verify/case_data.h"
#include "crypto/encoding.h"
#include "evidence/record.h"
#include "tests/support/nanoseconds.h"
#include "tests/support/token_maker.h"

namespace kiroku::test {

namespace fs = std::filesystem;
using archive::Span;

namespace {

constexpr std::size_t kLongText = archive::kMaximumLineBytes - 1'000;
constexpr std::uint64_t kSharedFileBytes = 64U << 20U;

UtcTime opened_at() { return *parse_utc("2026-08-05T09:15:02.000000Z"); }

archive::Moment at(std::int64_t mono_ns) {
  return {
      opened_at() + std::chrono::duration_cast<std::chrono::microseconds>(std::chrono::nanoseconds(mono_ns)),
      mono_ns};
}

std::string stream_name(std::size_t number) { return "s" + std::to_string(number); }

bool room_for_more(const HostileCase& of, std::uint64_t until) { return of.bytes() < until; }

// -- one function a kind of lines

/// Touching gaps of stream s0, the latest first: each goes on from the next.
Span descending_gaps_alone(HostileCase& of, std::uint64_t bytes) {
  constexpr std::int64_t kLength = 20'000'000;
  constexpr std::int64_t kLast = 1'000'000;
  const std::uint64_t until = of.bytes() + bytes;
  Span gap{kLast * kLength, (kLast + 1) * kLength};
  for (; room_for_more(of, until); gap = {gap.start_ns - kLength, gap.start_ns}) {
    of.add(archive::GapEntry{"s0", gap, archive::GapCause::kOverload});
  }
  return {gap.end_ns, (kLast + 1) * kLength};
}

/// The same in a hole between two segments.
void descending_gaps(HostileCase& of, std::uint64_t bytes) {
  const Span hole = descending_gaps_alone(of, bytes);
  archive::SegmentEntry before = of.next_segment(false);
  before.span = {0, hole.start_ns};
  of.add(before);
  archive::SegmentEntry after = of.next_segment(false);
  after.span = {hole.end_ns, hole.end_ns + kSecond};
  of.add(after);
}

/// Holes all over, and gaps with a little time between.
void gaps_beside_holes(HostileCase& of, std::uint64_t bytes) {
  const std::uint64_t until = of.bytes() + bytes;
  for (std::int64_t i = 0; room_for_more(of, until); ++i) {
    of.add(archive::GapEntry{"s0", {i * kSecond, i * kSecond + 1'000}, archive::GapCause::kPaused});
    archive::SegmentEntry segment = of.next_segment(false);
    segment.span = {i * kSecond + 100'000'000, i * kSecond + 200'000'000};
    of.add(segment);
  }
}

void long_texts(HostileCase& of, std::uint64_t bytes,
                const std::function<archive::CaseEntryBody(int)>& body) {
  const std::uint64_t until = of.bytes() + bytes;
  for (int i = 0; room_for_more(of, until); ++i) {
    of.add(body(i));
  }
}

void long_causes(HostileCase& of, std::uint64_t bytes) {
  long_texts(of, bytes, [](int) { return archive::TokenMissedEntry{1, "a", std::string(kLongText, 'c')}; });
}

void long_policies(HostileCase& of, std::uint64_t bytes) {
  long_texts(of, bytes, [](int i) {
    const auto index = static_cast<std::uint64_t>(i);
    return archive::ErasedEntry{"s0", index, index, std::string(kLongText, 'p')};
  });
}

void long_truncations(HostileCase& of, std::uint64_t bytes) {
  long_texts(of, bytes, [](int) {
    return archive::RecoveredEntry{"b", "crash", std::string(kLongText, 't')};
  });
}

void long_token_names(HostileCase& of, std::uint64_t bytes) {
  long_texts(of, bytes, [](int i) {
    archive::TokenEntry token;
    token.checkpoint = 1;
    token.authority = "a" + std::to_string(i);
    token.file = std::string(kLongText, 'f') + std::to_string(i);
    token.serial = "1";
    return token;
  });
}

void long_segment_names(HostileCase& of, std::uint64_t bytes) {
  long_texts(of, bytes, [&](int) {
    archive::SegmentEntry segment = of.next_segment(false);
    segment.file.file = std::string(kLongText, 'f');
    segment.complete = false;
    return segment;
  });
}

void long_time_bases(HostileCase& of, std::uint64_t bytes) {
  long_texts(of, bytes, [&](int) {
    archive::SegmentEntry segment = of.next_segment(false);
    segment.time_base = "1/" + std::string(kLongText, '9');
    return segment;
  });
}

void missing_segments(HostileCase& of, std::uint64_t bytes) {
  long_texts(of, bytes, [&](int) { return of.next_segment(false); });
}

/// One file of which every entry states the right size.
void one_file_over_and_over(HostileCase& of, std::uint64_t bytes) {
  archive::SegmentEntry segment = of.next_segment(true);
  std::ofstream file(of.folder() / segment.file.file, std::ios::binary);  // a hole would not be read at all
  const std::string piece(1U << 20U, 'x');
  for (std::uint64_t at = 0; at < kSharedFileBytes; at += piece.size()) file << piece;
  segment.file.bytes = kSharedFileBytes;
  long_texts(of, bytes, [&](int) { return segment; });
}

void files_and_ranges(HostileCase& of, std::uint64_t bytes) {
  const std::uint64_t until = of.bytes() + bytes;
  for (std::uint64_t i = 0; room_for_more(of, until); ++i) {
    of.add(of.next_segment(true));
    of.add(archive::ErasedEntry{"s0", 2 * i + 1'000'000'000, 2 * i + 1'000'000'000, "p"});
  }
}

void files_that_nothing_names(HostileCase& of, std::uint64_t bytes) {
  descending_gaps_alone(of, bytes / 2);
  for (std::uint64_t i = 0; i < bytes / 500; ++i) {
    of.file(archive::segment_path("s0", i + 1'000'000, "ts") + ".part", "");
  }
}

void recoveries(HostileCase& of, std::uint64_t bytes) {
  long_texts(of, bytes, [](int) { return archive::RecoveredEntry{"", "crash", ""}; });
}

void tokens(HostileCase& of, std::uint64_t bytes, bool present) {
  const std::uint64_t until = of.bytes() + bytes;
  of.note();
  const std::uint64_t checkpoint = of.size();
  for (std::uint64_t i = 0; room_for_more(of, until); ++i) {
    archive::TokenEntry token;
    token.checkpoint = checkpoint;
    token.authority = present ? "a" + std::to_string(i) : "a";
    token.file = archive::token_path(checkpoint, token.authority);
    token.sha256 = crypto::sha256(bytes_of("0"));
    token.gen_time = opened_at();
    token.serial = "1";
    if (present) {
      of.file(token.file, "0");
    }
    of.add(token);
  }
}

void tokens_of_many_authorities(HostileCase& of, std::uint64_t bytes) { tokens(of, bytes, true); }

/// Tokens that hold, of a stranger with this key.
void tokens_signed_by(HostileCase& of, std::uint64_t bytes, const TestAuthority& stranger,
                      const timestamp::Credential& signer) {
  of.note();
  const std::uint64_t checkpoint = of.size();
  TokenRecipe recipe;
  recipe.imprint = to_bytes(crypto::sha256(bytes_of(of.signed_note())));
  recipe.signer = &signer;
  recipe.enclosed = {signer.certificate.get(), stranger.ca.certificate.get()};
  const Bytes response = make_response(make_token(recipe));
  archive::TokenEntry token;
  token.checkpoint = checkpoint;
  token.sha256 = crypto::sha256(response);
  token.gen_time = *parse_utc("2026-08-05T09:15:02.250000Z");
  token.serial = "07";
  for (std::uint64_t written = 0, i = 0; written < bytes; written += response.size() + 400, ++i) {
    token.authority = "a" + std::to_string(i);
    token.file = archive::token_path(checkpoint, token.authority);
    of.file(token.file, text_of(response));
    of.add(token);
  }
}

void tokens_of_a_stranger(HostileCase& of, std::uint64_t bytes) {
  static const TestAuthority stranger = make_test_authority();
  static const timestamp::Credential signer = make_signer(stranger, crypto::PrivateKey(EVP_EC_gen("P-384")));
  tokens_signed_by(of, bytes, stranger, signer);
}

void tokens_by_a_dear_key(HostileCase& of, std::uint64_t bytes) {
  static const TestAuthority stranger = make_test_authority();
  static const timestamp::Credential signer = make_signer(stranger, make_dear_key());
  tokens_signed_by(of, bytes, stranger, signer);
}

/// Tokens that each enclose a certificate that no other one does.
void tokens_with_a_certificate_each(HostileCase& of, std::uint64_t bytes) {
  static const TestAuthority stranger = make_test_authority();
  of.note();
  archive::TokenEntry token;
  token.checkpoint = of.size();
  token.gen_time = *parse_utc("2026-08-05T09:15:02.250000Z");
  token.serial = "07";
  TokenRecipe recipe;
  recipe.imprint = to_bytes(crypto::sha256(bytes_of(of.signed_note())));
  for (std::uint64_t written = 0, i = 0; written < bytes; ++i) {
    const timestamp::Credential signer = make_signer(stranger, crypto::PrivateKey(EVP_EC_gen("P-256")));
    recipe.signer = &signer;
    recipe.enclosed = {signer.certificate.get()};
    const Bytes response = make_response(make_token(recipe));
    token.sha256 = crypto::sha256(response);
    token.authority = "a" + std::to_string(i);
    token.file = archive::token_path(token.checkpoint, token.authority);
    of.file(token.file, text_of(response));
    of.add(token);
    written += response.size() + 400;
  }
}

/// Tokens whose clock contradicts the case clock, and steps that do not explain it.
void tokens_and_steps(HostileCase& of, std::uint64_t bytes) {
  const std::uint64_t until = of.bytes() + bytes;
  for (std::int64_t i = 0; room_for_more(of, until); ++i) {
    of.note();
    archive::TokenEntry token;
    token.checkpoint = of.size();
    token.authority = "a";
    token.file = archive::token_path(token.checkpoint, token.authority);
    token.sha256 = crypto::sha256(bytes_of("0"));
    token.gen_time = opened_at() + std::chrono::hours(i);
    token.serial = "1";
    of.file(token.file, "0");
    of.add(token);
    for (int step = 0; step < 4; ++step) {
      of.add(archive::ClockEntry{true, 0, 0, 1, {}});
    }
  }
}

void note_a_line(HostileCase& of, std::uint64_t bytes) {
  const std::uint64_t until = of.bytes() + bytes;
  while (room_for_more(of, until)) {
    of.add(archive::MarkEntry{});
    of.note();
  }
}

void notes_of_many_signatures(HostileCase& of, std::uint64_t bytes) {
  constexpr std::size_t kSignatures = 100;
  for (std::uint64_t written = 0; written < bytes; written += kSignatures * 110) {
    of.add(archive::MarkEntry{});
    of.note_signed(kSignatures);
  }
}

void raw_lines(HostileCase& of, std::uint64_t bytes, const std::string& line) {
  const std::uint64_t until = of.bytes() + bytes;
  while (room_for_more(of, until)) {
    of.raw(line);
  }
}

void empty_lines(HostileCase& of, std::uint64_t bytes) { raw_lines(of, bytes, ""); }
void braces(HostileCase& of, std::uint64_t bytes) { raw_lines(of, bytes, "{}"); }

void entries_wrong_in_many_ways(HostileCase& of, std::uint64_t bytes) {
  of.add(archive::CloseEntry{"operator", {}});
  const std::uint64_t until = of.bytes() + bytes;
  for (std::uint64_t i = 0; room_for_more(of, until); ++i) {
    archive::CaseEntry entry{7, at(kSecond - static_cast<std::int64_t>(i) * 1'000),
                             archive::RecoveredEntry{"", "crash", ""}};
    entry.at.mono_ns = 0;
    of.raw(archive::to_line(entry));
  }
}

std::string list_of(std::string_view item) {
  std::string list = "[";
  while (list.size() + item.size() + 2 < kLongText - 500) {
    list.append(list.size() > 1 ? "," : "").append(item);
  }
  return list + "]";
}

std::string opening_with(const std::string& streams) {
  return R"({"type":"open","seq":1,"utc":"2026-08-05T09:15:02.000000Z","mono_ns":0,"format":"kiroku-case/1",)"
         R"("case":"20260805T091502Z-3f9c21ab","device":"d","boot_id":"b","streams":)" +
         streams + "}";
}

void openings_of_nothing(HostileCase& of, std::uint64_t bytes) {
  raw_lines(of, bytes, opening_with(list_of("{}")));
}

void openings_of_many_streams(HostileCase& of, std::uint64_t bytes) {
  std::string streams = "[";
  for (int i = 0; streams.size() < kLongText - 1'000; ++i) {
    streams +=
        (i > 0 ? std::string(",") : std::string()) + R"({"name":"s)" + std::to_string(i) +
        R"(","kind":"video","media":"video/mp2t","source":"","profile":"","purpose":"","recipients":[],)"
        R"("timing":"arrival"})";
  }
  raw_lines(of, bytes, opening_with(streams + "]"));
}

void many_keys(HostileCase& of, std::uint64_t bytes) {
  std::string line = "{";
  for (int i = 0; line.size() < kLongText; ++i) {
    line += (i > 0 ? ",\"" : "\"") + std::to_string(i) + "\":1";
  }
  raw_lines(of, bytes, line + "}");
}

void many_values(HostileCase& of, std::uint64_t bytes) {
  raw_lines(of, bytes, "{\"a\":" + list_of("1") + "}");
}
void many_lists(HostileCase& of, std::uint64_t bytes) {
  raw_lines(of, bytes, "{\"a\":" + list_of("[]") + "}");
}
void many_digits(HostileCase& of, std::uint64_t bytes) {
  raw_lines(of, bytes, "{\"a\":" + std::string(kLongText, '9') + "}");
}
void many_escapes(HostileCase& of, std::uint64_t bytes) {
  std::string text;
  while (text.size() < kLongText - 10) {
    text += "\\u00e9";
  }
  raw_lines(of, bytes, "{\"a\":\"" + text + "\"}");
}
void many_unknown_totals(HostileCase& of, std::uint64_t bytes) {
  archive::CloseEntry close{"operator", {}};
  for (std::uint64_t written = 0; written < std::min<std::uint64_t>(bytes, kLongText - 10'000);
       written += 66) {
    close.totals["t" + std::to_string(written)] = {};
  }
  of.add(close);
}

// -- whole folders

void write_case(const fs::path& parent, std::uint64_t bytes, std::size_t streams, const std::string& source,
                const std::function<void(HostileCase&, std::uint64_t)>& append) {
  HostileCase of(parent, streams, source);
  append(of, bytes);
  of.finish();
}

void write_excerpt(const fs::path& parent, const std::function<void(HostileCase&)>& before,
                   const std::function<void(HostileCase&)>& append) {
  HostileCase of(parent, 1);
  before(of);
  of.begin_excerpt();
  append(of);
  of.finish();
}

void excerpt_of_streams(const fs::path& parent, std::uint64_t bytes, bool repeated) {
  write_excerpt(
      parent, [](HostileCase& of) { of.add(archive::MarkEntry{}); },
      [&](HostileCase& of) {
        descending_gaps_alone(of, bytes / 2);
        missing_segments(of, bytes / 2);
        of.change_document = [&](archive::ExcerptDocument& document) {
          document.streams.clear();
          for (std::uint64_t i = 0; i < std::min<std::uint64_t>(bytes, 4U << 20U) / 10; ++i) {
            document.streams.push_back(repeated ? "s0" : "z" + std::to_string(i));
          }
        };
      });
}

/// excerpt.json of 4 MiB with a list of `item` under `key`, all else as it must be.
void excerpt_of_list(const fs::path& parent, const std::string& key, std::string_view item) {
  write_excerpt(
      parent, [](HostileCase& of) { of.add(archive::MarkEntry{}); },
      [](HostileCase& of) { of.add(archive::MarkEntry{}); });
  const fs::path file = parent / HostileCase::kCaseId / archive::kExcerptFile;
  std::string text;
  std::getline(std::ifstream(file), text);
  std::string list;
  while (text.size() + list.size() + item.size() + 2 < archive::kMaximumExcerptBytes) {
    list.append(list.empty() ? "" : ",").append(item);
  }
  const std::size_t begin = text.find('[', text.find("\"" + key + "\":")) + 1;
  text.replace(begin, text.find(']', begin) - begin, list);
  std::ofstream(file) << text << '\n';
}

void write_record(const HostileCase& of, const evidence::EvidenceRecord& record) {
  const fs::path file = archive::evidence_file(of.folder(), HostileCase::kCaseId);
  fs::create_directory(file.parent_path());
  std::ofstream(file, std::ios::binary) << text_of(evidence::encode_record(record));
}

/// A record beside the case that covers the ledger's first lines and is not made by anybody: `chains` chains,
/// each with a list of so many values.
void write_record(const HostileCase& of, std::uint64_t lines, std::size_t chains, std::size_t values) {
  using crypto::HashAlgorithm;
  const archive::CaseFolder folder = archive::CaseFolder::open(of.folder());
  evidence::HashList list{archive::hash_ledger_at(folder, {lines}, HashAlgorithm::kSha256).at(lines)};
  for (std::size_t i = 0; i < values; ++i) {
    list.push_back(crypto::digest(HashAlgorithm::kSha256, bytes_of(std::to_string(i))));
  }
  evidence::ArchiveTimeStamp time_stamp;
  time_stamp.digest_algorithm = evidence::named_hash(HashAlgorithm::kSha256);
  time_stamp.reduced_tree = {list};
  time_stamp.token = {std::byte{0x30}, std::byte{0x02}, std::byte{0x05}, std::byte{0x00}};
  evidence::EvidenceRecord record;
  record.digest_algorithms = {evidence::named_hash(HashAlgorithm::kSha256)};
  record.chains.assign(chains, {time_stamp});
  write_record(of, record);
}

void record_of_values(const fs::path& parent, std::uint64_t bytes, std::size_t chains) {
  constexpr std::size_t kBytesOfValue = 34;
  HostileCase of(parent, 1);
  of.add(archive::MarkEntry{});
  of.finish();
  const std::uint64_t most = std::min<std::uint64_t>(bytes, evidence::kMaximumRecordBytes * 9 / 10);
  write_record(of, of.size(), chains, static_cast<std::size_t>(most) / kBytesOfValue / chains);
}

/// Time-stamps that a stranger signed with a slow curve, one over the other.
void record_of_strangers(const fs::path& parent, std::uint64_t bytes) {
  static const TestAuthority stranger = make_test_authority();
  static const timestamp::Credential signer = make_signer(stranger, crypto::PrivateKey(EVP_EC_gen("P-384")));
  HostileCase of(parent, 1);
  of.add(archive::MarkEntry{});
  of.finish();
  TokenRecipe recipe;
  recipe.signer = &signer;
  recipe.enclosed = {signer.certificate.get(), stranger.ca.certificate.get()};
  evidence::EvidenceRecord record;
  record.digest_algorithms = {evidence::named_hash(crypto::HashAlgorithm::kSha256)};
  record.chains.emplace_back();
  const archive::CaseFolder folder = archive::CaseFolder::open(of.folder());
  const crypto::HashAlgorithm algorithm = crypto::HashAlgorithm::kSha256;
  recipe.imprint = archive::hash_ledger_at(folder, {of.size()}, algorithm).at(of.size());
  for (std::uint64_t written = 0; written < bytes && record.chains[0].size() < evidence::kMostTimeStamps;) {
    evidence::ArchiveTimeStamp made;
    made.digest_algorithm = evidence::named_hash(algorithm);
    made.token = make_token(recipe);
    written += made.token.size();
    recipe.imprint = crypto::digest(algorithm, made.token);
    record.chains[0].push_back(std::move(made));
  }
  write_record(of, record);
}

/// Each of its chains is asked for each file.
void record_beside_many_files(const fs::path& parent, std::uint64_t bytes) {
  HostileCase of(parent, 1);
  while (of.bytes() < bytes) {
    of.add(of.next_segment(true));
  }
  of.finish();
  write_record(of, of.size(), evidence::kMostChains, 1);
}

void log_of_cases(const fs::path& parent, std::uint64_t bytes) {
  HostileLog log(parent);
  for (std::uint64_t i = 0; log.bytes() < bytes; ++i) {
    std::string id = HostileCase::kCaseId;
    std::string number = std::to_string(i % 100'000'000);
    id.replace(id.size() - number.size(), number.size(), number);
    log.add(archive::CaseOpenedEntry{id, {}});
  }
}

void log_of_devices(const fs::path& parent, std::uint64_t bytes) {
  HostileLog log(parent);
  const std::vector<std::string> devices{HostileLog::new_device(), HostileLog::new_device()};
  for (std::size_t i = 0; log.bytes() < bytes; ++i) {
    log.add(archive::BootEntry{"b", devices[i % 2]});
  }
}

void log_of_shutdowns(const fs::path& parent, std::uint64_t bytes) {
  HostileLog log(parent);
  while (log.bytes() < bytes) {
    log.add(archive::ShutdownEntry{});
  }
}

/// A log that states a root for every size of a case.
void case_with_roots(const fs::path& parent, std::uint64_t bytes) {
  HostileCase of(parent, 1);
  HostileLog log(parent);
  log.add(archive::CaseOpenedEntry{HostileCase::kCaseId, {}});
  while (of.bytes() < bytes) {
    of.add(archive::MarkEntry{});
    log.add(archive::CaseCheckpointEntry{HostileCase::kCaseId, of.size(), of.root()});
  }
  of.finish();
}

void many_folders(const fs::path& parent, std::uint64_t bytes) {
  HostileCase of(parent, 1);
  for (std::uint64_t i = 0; i < bytes / 1'000; ++i) {
    fs::create_directories(of.folder() / "segments" / ("d" + std::to_string(i)));
    of.file("tokens/00000001.a" + std::to_string(i) + ".tsr", "0");
    of.file("checkpoints/" + archive::format_index(i + 10) + ".note", "0");
  }
  fs::path deep = of.folder();
  for (int i = 0; i < 100; ++i) {
    deep /= "deep";
    fs::create_directory(deep);
  }
  of.finish();
}

std::vector<HostileForm> all_forms() {
  constexpr std::size_t kMostStreams = 256;
  std::vector<HostileForm> forms;
  for (const HostileLines& lines : hostile_lines()) {
    forms.push_back({lines.name, [&lines](const fs::path& parent, std::uint64_t bytes) {
                       write_case(parent, bytes, 1, "x", lines.append);
                     }});
  }
  const auto add = [&](std::string name, std::function<void(const fs::path&, std::uint64_t)> write) {
    forms.push_back({std::move(name), std::move(write)});
  };
  add("missing segments of a stream with a long source", [](const fs::path& parent, std::uint64_t bytes) {
    write_case(parent, bytes, 1, std::string(kLongText - 10'000, 's'), missing_segments);
  });
  add("recoveries of many streams", [](const fs::path& parent, std::uint64_t bytes) {
    write_case(parent, bytes, kMostStreams, "x", recoveries);
  });
  add("files that nothing names beside many streams", [](const fs::path& parent, std::uint64_t bytes) {
    write_case(parent, bytes, kMostStreams, "x", files_that_nothing_names);
  });
  add("many files and folders", many_folders);
  add("record of many values",
      [](const fs::path& parent, std::uint64_t bytes) { record_of_values(parent, bytes, 1); });
  add("record of many chains", [](const fs::path& parent, std::uint64_t bytes) {
    // As many as may be of this size, and of a smaller one nearly so.
    record_of_values(parent, bytes, 2 * evidence::kMostTimesHashedAgain + 1);
  });
  add("record of strangers' time-stamps", record_of_strangers);
  add("record of many chains beside many files", record_beside_many_files);
  add("excerpt: note a line", [](const fs::path& parent, std::uint64_t bytes) {
    write_excerpt(
        parent, [](HostileCase& of) { of.add(archive::MarkEntry{}); },
        [&](HostileCase& of) { note_a_line(of, bytes); });
  });
  add("excerpt: notes before it", [](const fs::path& parent, std::uint64_t bytes) {
    write_excerpt(
        parent, [&](HostileCase& of) { note_a_line(of, std::min<std::uint64_t>(bytes, 500'000)); },
        [&](HostileCase& of) { of.add(archive::MarkEntry{}); });
  });
  add("excerpt: streams that the case does not have",
      [](const fs::path& parent, std::uint64_t bytes) { excerpt_of_streams(parent, bytes, false); });
  add("excerpt: one stream named often",
      [](const fs::path& parent, std::uint64_t bytes) { excerpt_of_streams(parent, bytes, true); });
  add("excerpt: list of empty streams",
      [](const fs::path& parent, std::uint64_t) { excerpt_of_list(parent, "streams", "\"\""); });
  add("excerpt: list of empty objects",
      [](const fs::path& parent, std::uint64_t) { excerpt_of_list(parent, "earlier", "{}"); });
  add("excerpt: list of proofs without hashes", [](const fs::path& parent, std::uint64_t) {
    excerpt_of_list(parent, "earlier", R"({"size":1,"proof":[]})");
  });
  add("log: many cases", log_of_cases);
  add("log: many devices", log_of_devices);
  add("log: shutdowns", log_of_shutdowns);
  add("case with a log: a root a line", case_with_roots);
  return forms;
}

}  // namespace

HostileCase::HostileCase(const fs::path& parent, std::size_t streams, const std::string& source)
    : folder_(parent / kCaseId) {
  for (const auto folder : {archive::kCheckpointsFolder, archive::kTokensFolder, archive::kSegmentsFolder}) {
    fs::create_directories(folder_ / folder);
  }
  archive::OpenEntry open;
  open.case_id = kCaseId;
  open.device = crypto::VerifierKey(kDeviceName, key_.public_key()).to_string();
  open.appliance_log_root = crypto::sha256({});
  for (std::size_t i = 0; i < streams; ++i) {
    open.streams.push_back({stream_name(i), "video", "video/mp2t", source, "mpeg2", "", {}, "arrival", ""});
    fs::create_directory(folder_ / archive::kSegmentsFolder / stream_name(i));
  }
  lines_.open(folder_ / archive::kLedgerFile, std::ios::binary);
  file(std::string(archive::kDeviceFile), open.device + "\n");
  first_line_ = archive::to_line({0, at(0), open});
  raw(first_line_);
}

archive::Moment HostileCase::now() {
  mono_ns_ += 1'000;
  return at(mono_ns_);
}

std::uint64_t HostileCase::add(archive::CaseEntryBody body) {
  const std::uint64_t number = tree_.size();
  raw(archive::to_line({number, now(), std::move(body)}));
  return number;
}

void HostileCase::raw(std::string_view line) {
  tree_.append(crypto::merkle_leaf_hash(bytes_of(line)));
  lines_ << line << '\n';
  bytes_ += line.size() + 1;
}

std::string HostileCase::signed_note() {
  const crypto::Checkpoint checkpoint{archive::case_origin(kDeviceName, kCaseId), tree_.size(), root()};
  return crypto::sign_note(checkpoint.to_text(), kDeviceName, key_);
}

void HostileCase::note() {
  const bool there = !notes_.empty() && notes_.back() == tree_.size();
  if (!there && notes_.size() < most_notes) {
    notes_.push_back(tree_.size());
    file(archive::note_path(tree_.size()), signed_note());
  }
}

void HostileCase::note_signed(std::size_t signatures) {
  std::string note = signed_note();
  const std::string line = note.substr(note.rfind('\n', note.size() - 2) + 1);
  const std::string key_and_name = line.substr(0, line.rfind(' ') + 1);
  Bytes signature =
      *crypto::from_base64(line.substr(key_and_name.size(), line.size() - key_and_name.size() - 1),
                           crypto::Base64Padding::kPadded);
  for (std::size_t i = 1; i < signatures; ++i) {
    signature.back() = static_cast<std::byte>(i);
    note += key_and_name + crypto::to_base64(signature, crypto::Base64Padding::kPadded) + "\n";
  }
  file(archive::note_path(tree_.size()), note);
}

void HostileCase::file(const std::string& path, std::string_view bytes) {
  std::ofstream(folder_ / path, std::ios::binary) << bytes;
}

archive::SegmentEntry HostileCase::next_segment(bool present) {
  archive::SegmentEntry segment;
  segment.stream = "s0";
  segment.index = segments_++;
  segment.file.file = archive::segment_path("s0", segment.index, "ts");
  segment.span = {static_cast<std::int64_t>(segment.index) * kSecond,
                  static_cast<std::int64_t>(segment.index + 1) * kSecond};
  segment.time_base = "1/90000";
  segment.first_pts = static_cast<std::int64_t>(segment.index) * 90'000;
  if (present) {
    file(segment.file.file, "");
    segment.file.sha256 = crypto::sha256({});
  }
  return segment;
}

void HostileCase::begin_excerpt() {
  first_entry_ = tree_.size();
  lines_.close();
  lines_.open(folder_ / archive::kExcerptLinesFile, std::ios::binary);
}

void HostileCase::finish() {
  file(archive::note_path(tree_.size()), signed_note());
  lines_.close();
  if (first_entry_ == 0) {
    return;
  }
  fs::remove(folder_ / archive::kLedgerFile);
  file(std::string(archive::kExcerptOpenFile), first_line_ + "\n");
  archive::ExcerptDocument document;
  document.case_id = kCaseId;
  document.to_ns = kSecond;
  document.streams = {"s0"};
  document.first_entry = first_entry_;
  document.size = tree_.size();
  document.open_proof = tree_.inclusion_proof(0, document.size);
  document.left = tree_.range_proof(first_entry_, document.size, document.size);
  for (const std::uint64_t size : notes_) {
    if (size <= first_entry_) {
      document.earlier.push_back({size, tree_.consistency_proof(size, document.size)});
    }
  }
  if (change_document) {
    change_document(document);
  }
  file(std::string(archive::kExcerptFile), archive::to_text(document));
}

HostileLog::HostileLog(const fs::path& parent) {
  fs::create_directories(parent / "log" / archive::kCheckpointsFolder);
  lines_.open(parent / "log" / archive::kLedgerFile, std::ios::binary);
  add(archive::BootEntry{"b", new_device()});
}

std::string HostileLog::new_device() {
  return crypto::VerifierKey(HostileCase::kDeviceName, crypto::SigningKey::generate().public_key())
      .to_string();
}

std::uint64_t HostileLog::add(archive::LogEntryBody body) {
  const std::string line =
      archive::to_line({size_, at(static_cast<std::int64_t>(size_) * 1'000), std::move(body)});
  lines_ << line << '\n';
  bytes_ += line.size() + 1;
  return size_++;
}

const std::vector<HostileLines>& hostile_lines() {
  static const std::vector<HostileLines> kLines{
      {"descending gaps", descending_gaps},
      {"gaps beside holes", gaps_beside_holes},
      {"causes of 1 MiB", long_causes},
      {"policies of 1 MiB", long_policies},
      {"recoveries of 1 MiB", long_truncations},
      {"token names of 1 MiB", long_token_names},
      {"segment names of 1 MiB", long_segment_names},
      {"time bases of 1 MiB", long_time_bases},
      {"missing segments", missing_segments},
      {"one file of 64 MiB over and over", one_file_over_and_over},
      {"files and erased ranges", files_and_ranges},
      {"files that nothing names", files_that_nothing_names},
      {"recoveries", recoveries},
      {"tokens of many authorities", tokens_of_many_authorities},
      {"tokens and steps of the clock", tokens_and_steps},
      {"note a line", note_a_line},
      {"notes of a hundred signatures", notes_of_many_signatures},
      {"empty lines", empty_lines},
      {"empty objects", braces},
      {"entries wrong in many ways", entries_wrong_in_many_ways},
      {"openings of empty streams", openings_of_nothing},
      {"openings of many streams", openings_of_many_streams},
      {"many keys", many_keys},
      {"many values", many_values},
      {"many lists", many_lists},
      {"many digits", many_digits},
      {"many escapes", many_escapes},
      {"totals of unknown streams", many_unknown_totals},
      {"tokens of a stranger", tokens_of_a_stranger},
      {"tokens by a dear key", tokens_by_a_dear_key},
      {"tokens with a certificate each", tokens_with_a_certificate_each},
  };
  return kLines;
}

const std::vector<HostileForm>& hostile_forms() {
  static const std::vector<HostileForm> kForms = all_forms();
  return kForms;
}

archive::VerificationReport verify_hostile(const fs::path& parent, unsigned threads) {
  archive::VerifyOptions options;
  options.threads = threads;
  const bool with_log = fs::exists(parent / "log");
  if (!fs::exists(parent / HostileCase::kCaseId)) {
    return archive::verify_log(parent / "log", options);
  }
  if (with_log) {
    options.log = parent / "log";
  }
  return archive::verify_case(parent / HostileCase::kCaseId, options);
}

Contents contents_below(const fs::path& parent) {
  constexpr std::uint64_t kBlock = 512;
  Contents contents;
  for (const auto& each : fs::recursive_directory_iterator(parent)) {
    ++contents.names;
    struct stat status {};
    if (each.is_regular_file() && ::stat(each.path().c_str(), &status) == 0) {
      contents.bytes += std::min<std::uint64_t>(static_cast<std::uint64_t>(status.st_size),
                                                static_cast<std::uint64_t>(status.st_blocks) * kBlock);
    }
  }
  return contents;
}

}  // namespace kiroku::test

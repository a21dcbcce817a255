#include "archive/format/ledger_entry.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/error.h"
#include "crypto/hash.h"

namespace kiroku::archive {
namespace {

using ::testing::HasSubstr;

const Moment kMoment{*parse_utc("2026-08-05T09:15:02.000123Z"), 1'500};
const crypto::Sha256Digest kDigest = crypto::sha256(bytes_of("abc"));
const std::string kDigestHex = "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad";
const std::string kHead = R"("seq":3,"utc":"2026-08-05T09:15:02.000123Z","mono_ns":1500)";

std::string line_of(CaseEntryBody body) { return to_line({3, kMoment, std::move(body)}); }

OpenEntry opening() {
  OpenEntry open;
  open.case_id = "20260805T091502Z-3f9c21ab";
  open.device = "or3+00000000+AQ==";
  open.boot_id = "boot";
  open.streams = {{"endoscope",
                   "video",
                   "video/mp2t",
                   "/dev/video0",
                   "mpeg2",
                   "endoscope",
                   {"age1a", "age1b"},
                   "arrival",
                   "ts"}};
  open.appliance_log_size = 5;
  open.appliance_log_root = kDigest;
  return open;
}

SegmentEntry segment() {
  SegmentEntry entry;
  entry.stream = "endoscope";
  entry.index = 2;
  entry.file = {"segments/endoscope/00000002.ts.age", 1234, kDigest};
  entry.span = {4'000, 6'000};
  entry.first_pts = -90;
  entry.time_base = "1/90000";
  entry.frames = 50;
  entry.dropped = 1;
  return entry;
}

// The lines are the format: they may never change.
TEST(LedgerEntry, WritesOpen) {
  EXPECT_EQ(
      line_of(opening()),
      "{\"type\":\"open\"," + kHead +
          R"(,"format":"kiroku-case/1","case":"20260805T091502Z-3f9c21ab","device":"or3+00000000+AQ==","boot_id":"boot",)"
          R"("streams":[{"name":"endoscope","kind":"video","media":"video/mp2t","source":"/dev/video0","profile":"mpeg2",)"
          R"("purpose":"endoscope","recipients":["age1a","age1b"],"timing":"arrival"}],"appliance_log":{"size":5,"root":")" +
          kDigestHex + "\"}}");
}

TEST(LedgerEntry, WritesSegment) {
  EXPECT_EQ(
      line_of(segment()),
      "{\"type\":\"segment\"," + kHead +
          R"(,"stream":"endoscope","index":2,"file":"segments/endoscope/00000002.ts.age","bytes":1234,"sha256":")" +
          kDigestHex +
          R"(","start_ns":4000,"end_ns":6000,"first_pts":-90,"time_base":"1/90000","frames":50,"dropped":1,"complete":true})");
}

TEST(LedgerEntry, WritesNothingOfASegmentThatNobodyCounted) {
  SegmentEntry found = segment();
  found.counted = false;
  found.complete = false;
  const std::string line =
      "{\"type\":\"segment\"," + kHead +
      R"(,"stream":"endoscope","index":2,"file":"segments/endoscope/00000002.ts.age","bytes":1234,"sha256":")" +
      kDigestHex + R"(","start_ns":4000,"end_ns":6000,"complete":false})";
  EXPECT_EQ(line_of(found), line);
  // Half of what only the recorder knew is no statement.
  std::string half = line;
  half.insert(half.find(R"("complete")"), R"("frames":50,)");
  EXPECT_FALSE(parse_case_entry(half).entry);
}

TEST(LedgerEntry, WritesTheOthers) {
  EXPECT_EQ(
      line_of(GapEntry{"room", {1, 2}, GapCause::kDeviceRemoved}),
      "{\"type\":\"gap\"," + kHead + R"(,"stream":"room","start_ns":1,"end_ns":2,"cause":"device-removed"})");
  const std::string of_sound = line_of(GapEntry{"room", {1, 2}, GapCause::kOverload, true});
  EXPECT_EQ(of_sound, "{\"type\":\"gap\"," + kHead +
                          R"(,"stream":"room","start_ns":1,"end_ns":2,"cause":"overload","of":"sound"})");
  std::string of_another = of_sound;
  of_another.replace(of_another.find(R"("sound")"), 7, R"("light")");
  EXPECT_FALSE(parse_case_entry(of_another).entry);
  EXPECT_EQ(
      line_of(ClockEntry{true, -5, 6, 0}),
      "{\"type\":\"clock\"," + kHead + R"(,"synchronised":true,"offset_ns":-5,"error_ns":6,"step_ns":0})");
  EXPECT_EQ(line_of(ClockEntry{true, -5, 6, 0, -20'000}),
            "{\"type\":\"clock\"," + kHead +
                R"(,"synchronised":true,"offset_ns":-5,"error_ns":6,"step_ns":0,"rate_ppb":-20000})");
  TokenEntry exchanged{2, "swiss", "f", kDigest, kMoment.utc, 0, "ff"};
  exchanged.exchange = {700, 900};
  EXPECT_THAT(line_of(exchanged), ::testing::EndsWith(R"("serial":"ff","asked_ns":700,"answered_ns":900})"));
  EXPECT_EQ(
      line_of(TokenEntry{2, "swiss", "tokens/00000002.swiss.tsr", kDigest, kMoment.utc, 1'000'000, "0a1b"}),
      "{\"type\":\"token\"," + kHead +
          R"(,"checkpoint":2,"authority":"swiss","file":"tokens/00000002.swiss.tsr","sha256":")" +
          kDigestHex +
          R"(","gen_time":"2026-08-05T09:15:02.000123Z","accuracy_ns":1000000,"serial":"0a1b"})");
  EXPECT_EQ(
      line_of(TokenMissedEntry{2, "swiss", "no answer"}),
      "{\"type\":\"token-missed\"," + kHead + R"(,"checkpoint":2,"authority":"swiss","cause":"no answer"})");
  EXPECT_EQ(line_of(MarkEntry{kDigest}),
            "{\"type\":\"mark\"," + kHead + R"(,"commitment":")" + kDigestHex + "\"}");
  EXPECT_EQ(line_of(RecoveredEntry{"b2", "crash", "12 bytes of a ledger line"}),
            "{\"type\":\"recovered\"," + kHead +
                R"(,"boot_id":"b2","after":"crash","truncated":"12 bytes of a ledger line"})");
  EXPECT_EQ(line_of(CloseEntry{"operator", {{"room", {1, 2, 3, 4}}}}),
            "{\"type\":\"close\"," + kHead +
                R"(,"reason":"operator","totals":{"room":{"segments":1,"frames":2,"dropped":3,"bytes":4}}})");
  EXPECT_EQ(line_of(ErasedEntry{"room", 1, 2, "30 days"}),
            "{\"type\":\"erased\"," + kHead +
                R"(,"stream":"room","first_index":1,"last_index":2,"policy":"30 days"})");
}

TEST(LedgerEntry, OpenSaysWhereACaseWithPreRollBegins) {
  OpenEntry open = opening();
  open.begins_ns = 3;
  const std::string line = to_line({0, {UtcTime{}, 5}, open});
  EXPECT_NE(line.find(R"("begins_ns":3,)"), std::string::npos) << line;
  const EntryParse parsed = parse_case_entry(line);
  ASSERT_TRUE(parsed.entry) << parsed.problem;
  EXPECT_EQ(std::get<OpenEntry>(parsed.entry->body).begins_ns, 3);
  EXPECT_FALSE(parse_case_entry(to_line({0, {UtcTime{}, 2}, open})).entry) << "begins after it was opened";
}

TEST(LedgerEntry, EveryEntryComesBackAsItWas) {
  OpenEntry full = opening();
  full.subject = FileReference{"subject.json.age", 9, kDigest};
  full.plan = kDigest;
  SegmentEntry samples = segment();
  samples.counts_samples = true;
  samples.complete = false;
  SegmentEntry found;
  found.stream = "room";
  found.index = 7;
  found.file = {"segments/room/00000007.ts.age.part", 12, kDigest};
  found.span = {1, 2};
  found.complete = false;
  found.counted = false;
  TokenEntry exchanged{2, "swiss", "f", kDigest, kMoment.utc, 0, "ff"};
  exchanged.exchange = {700, 900};
  const std::vector<CaseEntryBody> bodies{full,
                                          samples,
                                          segment(),
                                          found,
                                          GapEntry{"room", {1, 2}, GapCause::kPaused},
                                          GapEntry{"room", {1, 2}, GapCause::kPaused, true},
                                          ClockEntry{false, 1, 2, -3},
                                          ClockEntry{false, 1, 2, -3, 4},
                                          exchanged,
                                          TokenEntry{2, "swiss", "f", kDigest, kMoment.utc, 0, "ff"},
                                          TokenMissedEntry{2, "swiss", "größer \"x\" \\ \n"},
                                          MarkEntry{kDigest},
                                          RecoveredEntry{"b", "power-loss", ""},
                                          CloseEntry{"operator", {{"a", {1, 2, 3, 4}}, {"b", {}}}},
                                          ErasedEntry{"room", 0, 0, "p"}};
  for (const CaseEntryBody& body : bodies) {
    const std::string line = line_of(body);
    const EntryParse parse = parse_case_entry(line);
    ASSERT_TRUE(parse.entry.has_value()) << line << parse.problem;
    EXPECT_EQ(parse.entry->seq, 3U);
    EXPECT_EQ(parse.entry->at.mono_ns, 1'500);
    EXPECT_EQ(parse.entry->body.index(), body.index());
    EXPECT_EQ(to_line(*parse.entry), line);
  }
}

TEST(LedgerEntry, GivesTheExtensionOfAStream) {
  const EntryParse parse = parse_case_entry(line_of(opening()));
  ASSERT_TRUE(parse.entry.has_value()) << parse.problem;
  EXPECT_EQ(std::get<OpenEntry>(parse.entry->body).streams.at(0).extension, "ts");
}

TEST(LedgerEntry, WritesTextThatIsNoUtf8WithReplacementCharacters) {
  const std::string line = line_of(TokenMissedEntry{2, "swiss", std::string("a\0\xFF", 3) + "b"});
  const EntryParse parse = parse_case_entry(line);
  ASSERT_TRUE(parse.entry.has_value()) << parse.problem;
  EXPECT_EQ(std::get<TokenMissedEntry>(parse.entry->body).cause,
            "a\xEF\xBF\xBD\xEF\xBF\xBD"
            "b");
}

TEST(LedgerEntry, DoesNotWriteWhatItWouldNotRead) {
  SegmentEntry large = segment();
  large.first_pts = std::int64_t{1} << 53;
  EXPECT_THROW(line_of(large), Error);
  EXPECT_THROW(line_of(TokenMissedEntry{2, "swiss", std::string(kMaximumLineBytes, 'x')}), Error);
}

struct Edit {
  std::string name, from, to, problem;
};
class LedgerEntryRefuses : public ::testing::TestWithParam<Edit> {};

TEST_P(LedgerEntryRefuses, AnEditedSegmentLine) {
  std::string line = line_of(segment());
  const std::size_t at = line.find(GetParam().from);
  ASSERT_NE(at, std::string::npos);
  line.replace(at, GetParam().from.size(), GetParam().to);
  const EntryParse parse = parse_case_entry(line);
  EXPECT_FALSE(parse.entry.has_value());
  EXPECT_THAT(parse.problem, HasSubstr(GetParam().problem));
}

INSTANTIATE_TEST_SUITE_P(
    Edits, LedgerEntryRefuses,
    ::testing::Values(
        Edit{"UnknownType", "\"segment\"", "\"sediment\"",
             "\"type\" has a value that format 1 does not know"},
        Edit{"UnknownKey", "\"complete\"", "\"completed\"", "\"complete\" is missing"},
        Edit{"ExtraKey", "{\"type\"", "{\"x\":1,\"type\"", "\"x\" is not known here"},
        Edit{"MissingKey", "\"index\":2,", "", "\"index\" is missing"},
        Edit{"DuplicateKey", "\"index\":2", "\"index\":2,\"index\":2", "stands twice"},
        Edit{"TextForNumber", "\"index\":2", "\"index\":\"2\"", "\"index\" is not an integer"},
        Edit{"NegativeIndex", "\"index\":2", "\"index\":-2", "\"index\" is negative"},
        Edit{"NegativeClock", "\"mono_ns\":1500", "\"mono_ns\":-1", "\"mono_ns\" is negative"},
        Edit{"TooLargeNumber", "\"bytes\":1234", "\"bytes\":9007199254740992", "not below 2^53"},
        Edit{"EndBeforeStart", "\"end_ns\":6000", "\"end_ns\":3999", "\"end_ns\" is before start_ns"},
        Edit{"BothCounts", "\"frames\":50", "\"frames\":50,\"samples\":50", "\"frames\" is not known here"},
        Edit{"TimeBase", "1/90000", "1/0", "\"time_base\" is not a fraction"},
        Edit{"LongTimeBase", "1/90000", "1/10000000000", "\"time_base\" is not a fraction"},
        Edit{"UpperCaseHash", "ba78", "BA78", "64 lower-case hex digits"},
        Edit{"StreamWithSlash", "\"stream\":\"endoscope\"", "\"stream\":\"../x\"", "not a short name"},
        Edit{"LocalTime", "02.000123Z", "02.000123+02:00", "is not a UTC time"},
        Edit{"Milliseconds", "02.000123Z", "02.000Z", "is not a UTC time"},
        Edit{"CarriageReturn", "\"complete\":true}", "\"complete\":true}\r", "control character"}),
    [](const auto& tested) { return tested.param.name; });

TEST(LedgerEntry, RefusesWhatOpenMayNotSay) {
  const auto refused = [](const auto& change) {
    OpenEntry open = opening();
    change(open);
    return parse_case_entry(line_of(open)).problem;
  };
  EXPECT_THAT(refused([](OpenEntry& o) { o.case_id = "../x"; }),
              HasSubstr("\"case\" is not a case identifier"));
  EXPECT_THAT(refused([](OpenEntry& o) { o.streams.push_back(o.streams[0]); }),
              HasSubstr("names a stream twice"));
  EXPECT_THAT(refused([](OpenEntry& o) { o.streams[0].kind = "x"; }), HasSubstr("streams[0]: \"kind\""));
  EXPECT_THAT(refused([](OpenEntry& o) { o.streams[0].media = "x"; }), HasSubstr("streams[0]: \"media\""));
  EXPECT_THAT(refused([](OpenEntry& o) { o.streams[0].timing = "x"; }), HasSubstr("streams[0]: \"timing\""));
  EXPECT_THAT(refused([](OpenEntry& o) {
                o.subject = FileReference{"../s", 1, {}};
              }),
              HasSubstr("\"subject\" does not name subject.json.age"));
}

TEST(LedgerEntry, RefusesMoreStreamsThanAllowed) {
  OpenEntry open = opening();
  open.streams.resize(kMaximumStreams, open.streams[0]);
  for (std::size_t i = 0; i < open.streams.size(); ++i) {
    open.streams[i].name = "s" + std::to_string(i);
  }
  const std::string most = line_of(open);
  EXPECT_EQ(parse_case_entry(most).problem, "");
  open.streams.push_back(open.streams[0]);
  open.streams.back().name = "more";
  EXPECT_THROW(line_of(open), Error);
  std::string line = most;
  line.insert(line.find(R"({"name":"s0")"),
              R"({"name":"more","kind":"video","media":"video/mp2t","source":"",)"
              R"("profile":"","purpose":"","recipients":[],"timing":"arrival"},)");
  EXPECT_THAT(parse_case_entry(line).problem, HasSubstr("\"streams\" names more than 256 streams"));
}

TEST(LedgerEntry, RefusesHalfAnExchangeAndOneThatRunsBackwards) {
  TokenEntry token{2, "swiss", "f", kDigest, kMoment.utc, 0, "ff"};
  token.exchange = {700, 900};
  const auto problem = [&](const std::string& from, const std::string& to) {
    std::string line = line_of(token);
    line.replace(line.find(from), from.size(), to);
    return parse_case_entry(line).problem;
  };
  EXPECT_THAT(problem(",\"answered_ns\":900", ""), HasSubstr("\"answered_ns\" is missing"));
  EXPECT_THAT(problem("\"asked_ns\":700,", ""), HasSubstr("\"asked_ns\" is missing"));
  EXPECT_THAT(problem("900", "699"), HasSubstr("\"answered_ns\" is before asked_ns"));
  EXPECT_THAT(problem("700", "-1"), HasSubstr("\"asked_ns\" is negative"));
}

TEST(LedgerEntry, TellsWhereALineStopsBeingJson) {
  const EntryParse parse = parse_case_entry("{\"type\":\"open\",\"type\":1}");
  EXPECT_EQ(parse.position, 20U);
}

}  // namespace
}  // namespace kiroku::archive

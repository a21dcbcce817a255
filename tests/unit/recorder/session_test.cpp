#include "recorder/session.h"

#include <atomic>
#include <cstdlib>
#include <fstream>
#include <thread>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "archive/format/case_layout.h"
#include "base/error.h"
#include "crypto/encoding.h"
#include "tests/support/decoded_video.h"
#include "tests/support/nanoseconds.h"
#include "tests/support/recording.h"
#include "tests/support/signal_files.h"
#include "tests/support/switched_authority.h"

namespace kiroku::recorder {
namespace {

using namespace std::chrono_literals;
using archive::GapCause;
using test::decode_video;
using test::RecordedCase;
using test::RecorderBench;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::Not;
using testing::SizeIs;

std::uint64_t frames(const std::vector<archive::SegmentEntry>& segments) {
  std::uint64_t sum = 0;
  for (const auto& segment : segments) sum += segment.frames;
  return sum;
}

class SessionOfEachProfile : public testing::TestWithParam<Profile> {};

TEST_P(SessionOfEachProfile, CutsSegmentsThatDecodeAloneToTheStatedFrames) {
  const RecorderBench bench;
  SessionOptions options = bench.options();
  options.video = {bench.stream("endoscope", "synthetic:pattern?size=64x48&rate=20&speed=max", GetParam())};
  options.duration = 2s;
  const RecordedCase recorded = bench.record(options);
  const auto segments = recorded.segments("endoscope");
  ASSERT_THAT(segments, SizeIs(10));
  for (const archive::SegmentEntry& segment : segments) {
    EXPECT_EQ(segment.frames, 4U);
    EXPECT_EQ(segment.span.start_ns, static_cast<std::int64_t>(segment.index) * kSecond / 5);
    EXPECT_EQ(segment.span.end_ns, static_cast<std::int64_t>(segment.index + 1) * kSecond / 5);
    const auto video = decode_video(recorded.plaintext(segment));
    ASSERT_THAT(video.frames, SizeIs(segment.frames));
    EXPECT_TRUE(video.frames.front().key);
    EXPECT_EQ(video.frames.front().pts, segment.first_pts);
    EXPECT_THAT(video.complaints, IsEmpty());
  }
  EXPECT_THAT(recorded.broken_rules(), IsEmpty());
  EXPECT_THAT(recorded.gaps("endoscope"), IsEmpty());
}

INSTANTIATE_TEST_SUITE_P(Profiles, SessionOfEachProfile,
                         testing::Values(Profile::kMpeg2, Profile::kUncompressed, Profile::kLossless),
                         [](const auto& tested) { return std::string(profile_name(tested.param)); });

// Whoever can write to the disk knows the names of tokens that are to come.
TEST(Session, AFileUnderATokensNameCostsThatTokenAlone) {
  const RecorderBench bench;
  SessionOptions options = bench.options();
  options.video = {bench.stream("endoscope", "synthetic:pattern?size=64x48&rate=20&speed=max")};
  options.duration = 2s;
  const std::string authority = options.authorities.front().name;
  Session session(std::move(options));
  for (std::uint64_t size = 1; size < 200; ++size) {
    std::ofstream(session.folder() / archive::token_path(size, authority)) << "planted";
  }
  const SessionResult result = session.run({});
  EXPECT_EQ(result.close_reason, "duration");
  const RecordedCase recorded = bench.read(session.folder());
  EXPECT_THAT(recorded.all<archive::CloseEntry>(), SizeIs(1));
  EXPECT_THAT(recorded.segments("endoscope"), SizeIs(10));
  const auto missed = recorded.all<archive::TokenMissedEntry>();
  ASSERT_THAT(missed, Not(IsEmpty()));
  EXPECT_THAT(missed.front().cause, HasSubstr("something else lay in tokens/"));
}

TEST(Session, MakesOneCleanTransportStreamOfItsSegments) {
  const RecorderBench bench;
  SessionOptions options = bench.options();
  options.video = {bench.stream("endoscope", "synthetic:pattern?size=64x48&rate=20&speed=max")};
  options.duration = 3s;
  const RecordedCase recorded = bench.record(options);
  const auto video = decode_video(recorded.joined("endoscope"));
  ASSERT_THAT(video.frames, SizeIs(60));
  EXPECT_THAT(video.complaints, IsEmpty());
  for (std::size_t i = 1; i < video.frames.size(); ++i) {
    EXPECT_EQ(video.frames[i].pts - video.frames[i - 1].pts, 4500) << "frame " << i;
  }
}

TEST(Session, KeepsThePicturesBitForBitWhereTheProfileIsLossless) {
  const RecorderBench bench;
  std::vector<std::vector<std::string>> pictures;
  for (const Profile profile : {Profile::kUncompressed, Profile::kLossless}) {
    SessionOptions options = bench.options();
    options.video = {bench.stream("endoscope", "synthetic:endoscope?size=64x48&rate=10&speed=max", profile)};
    options.duration = 1s;
    const RecordedCase recorded = bench.record(options);
    pictures.emplace_back();
    for (const auto& segment : recorded.segments("endoscope")) {
      for (const auto& frame : decode_video(recorded.plaintext(segment)).frames)
        pictures.back().push_back(frame.sha256);
    }
  }
  EXPECT_THAT(pictures[0], SizeIs(10));
  EXPECT_EQ(pictures[0], pictures[1]);
}

// Real time: how many pictures a second brings shows whether the session keeps up with the machine's clock.
TEST(SessionRealTime, KeepsPaceWithTheClockAndEndsAtTheDuration) {
  const RecorderBench bench;
  SessionOptions options = bench.options();
  options.video = {bench.stream("room", "synthetic:room?size=64x48&rate=20")};
  options.duration = 1s;
  Session session(options);
  const SessionResult result = session.run();
  EXPECT_EQ(result.close_reason, "duration");
  const RecordedCase recorded = bench.read(result.folder);
  EXPECT_EQ(frames(recorded.segments("room")), 20U);
  // No segment is claimed before its time is over.
  for (const archive::CaseEntry& entry : recorded.entries()) {
    if (const auto* segment = std::get_if<archive::SegmentEntry>(&entry.body)) {
      EXPECT_GE(entry.at.mono_ns, segment->span.end_ns);
    }
  }
  EXPECT_THAT(recorded.broken_rules(), IsEmpty());
}

/// A machine that sleeps when a test says so.
class SleepyClock final : public Clock {
 public:
  [[nodiscard]] Time now() const override { return system().now(); }
  [[nodiscard]] Duration since_boot() const override { return system().since_boot() + slept_.load(); }
  [[nodiscard]] UtcTime utc() const override {
    return system().utc() + std::chrono::floor<UtcTime::duration>(slept_.load());
  }
  using Clock::wait_until;
  void wait_until(std::condition_variable& changed, std::unique_lock<std::mutex>& lock,
                  Time deadline) const override {
    system().wait_until(changed, lock, deadline);
  }
  void sleep(Duration by) { slept_ = slept_.load() + by; }

 private:
  std::atomic<Duration> slept_{Duration(0)};
};

TEST(Session, StatesTheTimeInWhichTheMachineSlept) {
  const RecorderBench bench;
  SleepyClock clock;
  SessionOptions options = bench.options();
  options.video = {bench.stream("endoscope", "synthetic:pattern?size=64x48&rate=20")};
  options.time = &clock;
  std::filesystem::path folder;
  {
    Session session(options);
    bool slept = false;
    std::uint64_t frames_then = 0;
    folder = session
                 .run([&](const SessionStatus& status) {
                   const std::uint64_t frames = status.streams.front().frames;
                   if (!slept && frames >= 10) {
                     clock.sleep(60s);
                     slept = true;
                     frames_then = frames;
                   } else if (slept && frames >= frames_then + 10) {
                     session.stop();
                   }
                 })
                 .folder;
  }
  const RecordedCase recorded = bench.read(folder);
  const auto gaps = recorded.gaps("endoscope");
  ASSERT_THAT(gaps, SizeIs(1));
  EXPECT_EQ(gaps[0].cause, GapCause::kSuspended);
  EXPECT_GE(gaps[0].span.end_ns - gaps[0].span.start_ns, 59 * kSecond);
  EXPECT_THAT(recorded.broken_rules(), IsEmpty());
  for (const auto& each : recorded.all<archive::ClockEntry>()) {
    EXPECT_LT(std::abs(each.rate_ppb.value_or(0)), 1'000'000) << "the sleep passes for a slew";
  }
}

TEST(Session, ClosesProperlyWhenStopped) {
  const RecorderBench bench;
  SessionOptions options = bench.options();
  options.video = {bench.stream("room", "synthetic:pattern?size=64x48&rate=20")};
  options.vitals = {bench.stream("vitals", "synthetic:patient?waves=0")};
  Session session(options);
  const SessionResult result = session.run([&](const SessionStatus& status) {
    if (status.streams.at(0).frames >= 10 && status.streams.at(1).frames > 0) session.stop();
  });
  EXPECT_EQ(result.close_reason, "operator");
  const RecordedCase recorded = bench.read(result.folder);
  EXPECT_THAT(recorded.all<archive::CloseEntry>(), SizeIs(1));
  EXPECT_THAT(recorded.broken_rules(), IsEmpty());
  // The last, partial segment is there, too.
  const auto segments = recorded.segments("room");
  ASSERT_GE(segments.size(), 2U);
  EXPECT_EQ(frames(segments), result.last.streams[0].frames);
  EXPECT_GE(frames(segments), 10U);
}

TEST(Session, TellsWhereVitalSignsOfSeveralBedsComeInOneStream) {
  const RecorderBench bench;
  std::ofstream file(bench / "gateway.hl7", std::ios::binary);
  for (const auto& [id, place] : {std::pair("1", "SURG^OR1"), std::pair("2", "ICU^BED9")}) {
    file << "MSH|^~\\&|GATEWAY||||2026010112000" << id << "+0000||ORU^R01|" << id << "|P|2.6\rPID|||4711"
         << id << "\rPV1||I|" << place << "\rOBX|1|NM|147842^MDC_ECG_HEART_RATE^MDC|1|72\r";
  }
  file.close();
  const auto record = [&](const std::string& more) {
    SessionOptions options = bench.options();
    options.vitals = {bench.stream("vitals", (bench / "gateway.hl7").string() + "?speed=max" + more)};
    Session session(std::move(options));
    return session.run({});
  };
  const SessionResult mixed = record("");
  EXPECT_THAT(mixed.last.last_problem, HasSubstr("'vitals': vital signs of several "));
  EXPECT_THAT(mixed.last.last_problem, Not(HasSubstr("4711")));
  EXPECT_EQ(mixed.last.streams.at(0).elsewhere, 0U);
  const SessionResult alone = record("&locations=OR1");
  EXPECT_EQ(alone.last.last_problem, "");
  EXPECT_EQ(alone.last.streams.at(0).elsewhere, 1U);
}

// The cable of the room's monitor, or the case, is of somebody else.
TEST(Session, SaysWhereMonitorsNameAnotherPatientThanTheCase) {
  const RecorderBench bench;
  std::ofstream file(bench / "monitor.hl7", std::ios::binary);
  for (const char* second : {"1", "2", "3"})
    file << "MSH|^~\\&|MON|W|||2026010112000" << second << "+0000||ORU^R01|" << second
         << "|P|2.6\rPID|||A1^^^H^MR~V5^^^H^VN\rPV1||I|OR1\rOBX|1|NM|147842^MDC_ECG_HEART_RATE^MDC|1|72\r";
  file.close();
  const auto record = [&](const std::string& subject, std::vector<PatientNumber> more = {}) {
    SessionOptions options = bench.options();
    options.vitals = {bench.stream("vitals", (bench / "monitor.hl7").string() + "?speed=max")};
    if (!subject.empty()) options.subject = to_bytes(subject);
    options.identity.patient_numbers = std::move(more);
    Session session(std::move(options));
    return session.run({});
  };
  const SessionResult other = record(R"({"patient":{"id":"B2","id_issuer":"H","name":"BRAVO^BERTA"}})");
  EXPECT_THAT(other.last.last_problem, HasSubstr("a monitor's messages name another patient (PID-3)"));
  EXPECT_THAT(other.last.last_problem, Not(HasSubstr("A1")));
  const RecordedCase recorded = bench.read(other.folder);
  EXPECT_THAT(recorded.all<archive::MarkEntry>(), SizeIs(1)) << "the ledger commits to it";
  ASSERT_THAT(recorded.lines("events"), SizeIs(1));
  EXPECT_THAT(recorded.lines("events")[0], HasSubstr(R"(\"kind\":\"patient-differs\",\"text\":)"));
  EXPECT_THAT(recorded.broken_rules(), IsEmpty());
  for (const char* same : {R"({"patient":{"id":"A1","id_issuer":"H"}})", R"({"patient":{"id":"A1"}})",
                           R"({"patient":{"visit":"V5"}})", R"({"patient":{"name":"nobody knows"}})",
                           R"({"patient":"typed"})", ""}) {
    const SessionResult result = record(same);
    EXPECT_EQ(result.last.last_problem, "") << same;
    EXPECT_THAT(bench.read(result.folder).all<archive::MarkEntry>(), IsEmpty()) << same;
  }
  // As messages name the patient besides.
  EXPECT_EQ(
      record(R"({"patient":{"id":"99","id_issuer":"X"}})", {{"A1", "H", "", "MR", false}}).last.last_problem,
      "");
}

TEST(Session, SaysAtOnceWhereItsPlanWasMadeOnAnotherPatientsCt) {
  const RecorderBench bench;
  const auto record = [&](const std::string& subject, const std::vector<std::string>& of_plan,
                          const std::string& late = "", bool ahead = false) {
    SessionOptions options = bench.options();
    options.video = {bench.stream("room", "synthetic:pattern?size=64x48&rate=10")};
    CaseIdentity identity;
    identity.plan_patients = of_plan;
    if (ahead) {
      options.pre_roll = 1s;
    } else {
      options.identity = identity;
      if (!subject.empty()) options.subject = to_bytes(subject);
    }
    Session session(std::move(options));
    if (!ahead) {
      EXPECT_EQ(session.status().last_problem.empty(), !session.has_plan_of_another());
    }
    bool is_said = false;
    const SessionResult result = session.run([&](const SessionStatus& status) {
      if (!status.begun) {
        session.begin(subject.empty() ? std::nullopt : std::optional(to_bytes(subject)), {}, identity);
        return;
      }
      if (!std::exchange(is_said, true) && !late.empty()) session.late_subject(to_bytes(late));
      if (status.streams.at(0).frames > 1) session.stop();
    });
    const auto recorded = bench.read(result.folder);
    EXPECT_THAT(recorded.broken_rules(), IsEmpty());
    const bool is_told = result.last.last_problem == kPlanOfAnother;
    EXPECT_EQ(is_told, session.has_plan_of_another());
    std::string events;
    if (!recorded.all<archive::MarkEntry>().empty()) {
      for (const std::string& line : recorded.lines("events")) events += line;
    }
    EXPECT_EQ(events.find(R"(\"kind\":\"patient-differs\",\"text\":\"the CT of the sealed plan)") !=
                  std::string::npos,
              is_told);
    return is_told;
  };
  const std::string bravo = R"({"patient":{"id":"B2","visit":"A1"}})";
  for (const bool ahead : {false, true}) {
    EXPECT_TRUE(record(bravo, {"A1"}, "", ahead)) << "a visit's number is no patient's";
    EXPECT_FALSE(record(bravo, {"b2"}, "", ahead));
    EXPECT_TRUE(record("", {"A1"}, bravo, ahead)) << "it became known while the case ran";
  }
  EXPECT_TRUE(record(bravo, {"A1", "C3"}));
  EXPECT_FALSE(record(bravo, {"A1", "B2"})) << "nobody said which of them is meant";
  EXPECT_FALSE(record(bravo, {})) << "of a plan without a DICOM CT nothing is known";
  EXPECT_FALSE(record("", {"A1"}));
  EXPECT_FALSE(record(R"({"patient":{"visit":"V5"}})", {"A1"}));
}

TEST(Session, ComparesThePatientOfAnEdfFile) {
  const RecorderBench bench;
  const auto record = [&](const std::string& code, const std::string& format) {
    std::string file = test::edf_header({{"Resp", "", "-1", "1", "-32768", "32767", 2}}, "2", "1", format) +
                       test::little_endian_16({0, 1, 2, 3});
    file.replace(8, 80, test::edf_field(code + " F 02-AUG-1951 Bravo_Berta", 80));
    std::ofstream(bench / "a.edf", std::ios::binary) << file;
    SessionOptions options = bench.options();
    options.vitals = {bench.stream("vitals", (bench / "a.edf").string() + "?speed=max&zone=UTC")};
    options.subject = to_bytes(R"({"patient":{"id":"A1"}})");
    Session session(std::move(options));
    return session.run({}).last.last_problem;
  };
  EXPECT_THAT(record("B2", "EDF+C"), HasSubstr("name another patient"));
  EXPECT_EQ(record("A1", "EDF+C"), "");
  EXPECT_EQ(record("X", "EDF+C"), "") << "it does not say";
  EXPECT_EQ(record("B2", ""), "") << "EDF has no code there";
}

TEST(Session, StampsAtOpenEachIntervalAndAfterClose) {
  const RecorderBench bench;
  SessionOptions options = bench.options();
  options.video = {bench.stream("room", "synthetic:pattern?size=64x48&rate=10")};
  options.duration = 1500ms;
  const RecordedCase recorded = bench.record(options);
  const auto& entries = recorded.entries();
  const auto tokens = recorded.all<archive::TokenEntry>();
  ASSERT_THAT(tokens, SizeIs(3));
  EXPECT_EQ(tokens[0].checkpoint, 2U);  // open and clock
  const auto closed = std::find_if(entries.begin(), entries.end(), [](const auto& entry) {
    return std::holds_alternative<archive::CloseEntry>(entry.body);
  });
  ASSERT_NE(closed, entries.end());
  EXPECT_EQ(tokens[2].checkpoint, closed->seq + 1);
  EXPECT_EQ(recorded.all<archive::ClockEntry>().size(), 1U);
}

class SilentAuthority : public timestamp::StampSource {
 public:
  Bytes ask(ByteView) override { throw timestamp::AuthorityError("the authority is not there"); }
};
class ChattingAuthority : public timestamp::StampSource {
 public:
  Bytes ask(ByteView) override { return to_bytes("<html>welcome to the hospital's network</html>"); }
};

TEST(Session, GoesOnWithoutATokenAndSaysWhy) {
  const RecorderBench bench;
  SessionOptions options = bench.options();
  options.video = {bench.stream("room", "synthetic:pattern?size=64x48&rate=10&speed=max")};
  options.duration = 1s;
  options.authorities = {{"silent", std::make_shared<SilentAuthority>()},
                         {"portal", std::make_shared<ChattingAuthority>()}};
  const RecordedCase recorded = bench.record(options);
  EXPECT_THAT(recorded.all<archive::TokenEntry>(), IsEmpty());
  std::map<std::string, std::string> causes;
  for (const auto& missed : recorded.all<archive::TokenMissedEntry>())
    causes[missed.authority] = missed.cause;
  EXPECT_THAT(causes["silent"], HasSubstr("the authority is not there; left alone for "));
  EXPECT_FALSE(causes["portal"].empty());
  EXPECT_EQ(frames(recorded.segments("room")), 10U);
}

TEST(Session, AnOutageCostsAFewEntriesAndOneTokenCatchesUp) {
  // As hours: a checkpoint each minute (10 ms), pauses from half a minute to ten.
  const RecorderBench bench;
  SessionOptions options = bench.options();
  options.video = {bench.stream("room", "synthetic:pattern?size=64x48&rate=10")};
  options.duration = 2500ms;
  options.stamp_interval = 10ms;
  const auto authority = std::make_shared<test::SwitchedAuthority>(options.authorities.at(0).source);
  options.authorities = {{"embedded", authority, {.first = 5ms, .longest = 100ms}}};
  authority->up = false;
  Session session(options);
  const SessionResult result = session.run([&](const SessionStatus& status) {
    if (status.missed >= 3 && status.now_ns > kSecond) authority->up = true;
  });
  const RecordedCase recorded = bench.read(result.folder);
  const auto tokens = recorded.all<archive::TokenEntry>();
  const auto missed = recorded.all<archive::TokenMissedEntry>();
  ASSERT_THAT(tokens, Not(IsEmpty()));
  EXPECT_GE(missed.size(), 3U);
  EXPECT_LE(missed.size(), 30U) << "not one for each of the checkpoints that were signed";
  // Checkpoints were signed all the time; the first token is over one of the newest.
  const auto& entries = recorded.entries();
  const auto first_token = std::find_if(entries.begin(), entries.end(), [](const auto& entry) {
    return std::holds_alternative<archive::TokenEntry>(entry.body);
  });
  EXPECT_GE(entries.at(tokens.front().checkpoint - 1).at.mono_ns, first_token->at.mono_ns - kSecond);
  EXPECT_GT(tokens.front().checkpoint, missed.back().checkpoint - 1);
  ASSERT_TRUE(tokens.front().exchange);
  EXPECT_LE(tokens.front().exchange->asked_ns, tokens.front().exchange->answered_ns);
  EXPECT_LE(tokens.front().exchange->answered_ns, first_token->at.mono_ns);
  EXPECT_EQ(result.last.missed, missed.size());
  EXPECT_EQ(result.last.authorities.at(0).failures, 0U);
}

TEST(Session, RefusesATokenOfAnAuthorityThatIsNotTrusted) {
  const RecorderBench bench;
  const RecorderBench stranger;
  SessionOptions options = bench.options();
  options.video = {bench.stream("room", "synthetic:pattern?size=64x48&rate=10&speed=max")};
  options.duration = 1s;
  options.authorities = stranger.options().authorities;
  const RecordedCase recorded = bench.record(options);
  EXPECT_THAT(recorded.all<archive::TokenEntry>(), IsEmpty());
  EXPECT_FALSE(recorded.all<archive::TokenMissedEntry>().empty());
}

TEST(Session, FlashAndVitalSignMarkAreTheSameInstantToAFrame) {
  const RecorderBench bench;
  SessionOptions options = bench.options();
  options.video = {bench.stream("endoscope", "synthetic:endoscope?size=64x48&rate=25&flash=1")};
  options.vitals = {bench.stream("vitals", "synthetic:patient?waves=0&flash=1")};
  options.duration = 2500ms;
  const RecordedCase recorded = bench.record(options);
  std::vector<double> flashes_s;
  const std::int64_t first_pts = recorded.segments("endoscope").front().first_pts;
  const std::int64_t first_ns = recorded.segments("endoscope").front().span.start_ns;
  for (const auto& frame : decode_video(recorded.joined("endoscope")).frames) {
    if (frame.brightness > 200) {
      flashes_s.push_back(static_cast<double>(first_ns) / 1e9 +
                          static_cast<double>(frame.pts - first_pts) / 90'000);
    }
  }
  std::vector<double> marks_s;
  for (const std::string& line : recorded.lines("vitals")) {
    const auto sample = nlohmann::json::parse(line);
    if (sample["code"] == "KIROKU_FLASH") marks_s.push_back(sample["time_ns"].get<double>() / 1e9);
  }
  ASSERT_THAT(marks_s, ElementsAre(0, 1, 2));
  ASSERT_THAT(flashes_s, SizeIs(3));
  for (std::size_t i = 0; i < 3; ++i) EXPECT_LT(std::abs(flashes_s[i] - marks_s[i]), 1.0 / 25);
}

TEST(Session, StartsAFreshEncoderWhenThePicturesChange) {
  const RecorderBench bench;
  for (const Profile profile : {Profile::kMpeg2, Profile::kLossless}) {
    SessionOptions options = bench.options();
    options.video = {
        bench.stream("endoscope", "synthetic:pattern?size=128x96&rate=10&change=1&speed=max", profile)};
    options.duration = 2s;
    const RecordedCase recorded = bench.record(options);
    const auto gaps = recorded.gaps("endoscope");
    ASSERT_THAT(gaps, SizeIs(1));
    EXPECT_EQ(gaps[0].cause, GapCause::kFormatChange);
    EXPECT_EQ(gaps[0].span.start_ns, kSecond);
    EXPECT_THAT(recorded.broken_rules(), IsEmpty());
    EXPECT_EQ(frames(recorded.segments("endoscope")), 20U);
    for (const auto& segment : recorded.segments("endoscope")) {
      const auto video = decode_video(recorded.plaintext(segment));
      ASSERT_THAT(video.frames, SizeIs(segment.frames));
      EXPECT_EQ(video.frames.front().width, segment.span.start_ns < kSecond ? 128 : 64);
      EXPECT_EQ(video.frames.back().width, video.frames.front().width);
    }
  }
}

TEST(Session, SealsMarksAndCommitsToThem) {
  const RecorderBench bench;
  SessionOptions options = bench.options();
  options.video = {bench.stream("room", "synthetic:pattern?size=64x48&rate=10")};
  options.duration = 1s;
  Session session(options);
  session.mark("clip placed: \"Läsion\"");
  bool marked = false;
  const SessionResult result = session.run([&](const SessionStatus& status) {
    if (status.streams.at(0).frames >= 5 && !std::exchange(marked, true)) session.mark("second");
  });
  EXPECT_THROW(session.mark("too late"), Error);
  const RecordedCase recorded = bench.read(result.folder);
  const auto lines = recorded.lines("events");
  const auto marks = recorded.all<archive::MarkEntry>();
  ASSERT_THAT(lines, SizeIs(2));
  ASSERT_THAT(marks, SizeIs(2));
  for (std::size_t i = 0; i < 2; ++i) {
    const auto line = nlohmann::json::parse(lines[i]);
    const auto event = line["event"].get<std::string>();
    Bytes committed = crypto::from_hex(line["salt"].get<std::string>()).value();
    ASSERT_EQ(committed.size(), 32U);
    append(committed, bytes_of(event));
    EXPECT_EQ(crypto::sha256(committed), marks[i].commitment);
    EXPECT_EQ(nlohmann::json::parse(event)["text"], i == 0 ? "clip placed: \"Läsion\"" : "second");
  }
  EXPECT_EQ(frames(recorded.segments("events")), 2U);
  EXPECT_THAT(recorded.broken_rules(), IsEmpty());
}

TEST(Session, IsClosedProperlyAlsoWhenItNeverRan) {
  const RecorderBench bench;
  SessionOptions options = bench.options();
  options.video = {bench.stream("room", "synthetic:pattern?size=64x48&rate=10")};
  std::filesystem::path folder;
  {
    const Session session(options);
    folder = session.folder();
  }
  const RecordedCase recorded = bench.read(folder);
  ASSERT_THAT(recorded.all<archive::CloseEntry>(), SizeIs(1));
  EXPECT_THAT(recorded.all<archive::CloseEntry>()[0].reason, HasSubstr("abandoned"));
}

// What cannot be recorded is refused in one sentence and leaves no case.
struct Refusal {
  std::string name, source, sentence;
  Profile profile = Profile::kMpeg2;
};
class SessionRefuses : public testing::TestWithParam<Refusal> {};

TEST_P(SessionRefuses, AndLeavesNothing) {
  const RecorderBench bench;
  std::ofstream(bench / "empty.mp4").flush();
  std::ofstream(bench / "text.mp4") << "this is no film\n";
  SessionOptions options = bench.options();
  std::string source = GetParam().source;
  if (source.starts_with("@")) source = (bench / source.substr(1)).string();
  options.video = {bench.stream("room", source, GetParam().profile)};
  try {
    const Session session(options);
    FAIL() << "recorded " << source;
  } catch (const Error& error) {
    EXPECT_THAT(error.what(), HasSubstr(GetParam().sentence));
  }
  EXPECT_EQ(bench.cases(), 0U);
}

INSTANTIATE_TEST_SUITE_P(
    Sources, SessionRefuses,
    testing::Values(Refusal{"absent", "/nowhere/film.mp4", "does not exist"},
                    Refusal{"empty", "@empty.mp4", "is an empty file"},
                    Refusal{"no_film", "@text.mp4", "cannot be opened"},
                    Refusal{"too_wide", "synthetic:pattern?size=5000x48", "larger than MPEG-2 can hold"},
                    Refusal{"endless", "synthetic:pattern?speed=max", "never ends"},
                    Refusal{"unknown_option", "synthetic:pattern?colour=red", "has no option 'colour'"},
                    Refusal{"unknown_picture", "synthetic:kitchen", "there is no source"},
                    Refusal{"nameless_format", "synthetic:pattern?size=64x48&pixel_format=yuv422p10le",
                            "Matroska has no name for uncompressed yuv422p10le", Profile::kUncompressed}),
    [](const auto& tested) { return tested.param.name; });

}  // namespace
}  // namespace kiroku::recorder

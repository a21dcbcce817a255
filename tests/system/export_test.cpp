// What leaves a case lies on one time line, whichever form: looked at with ffprobe, as a recipient would.
#include <cmath>
#include <set>
#include <sstream>

#include "media/vital_sample.h"
#include "tests/support/media_maker.h"
#include "tests/support/nanoseconds.h"
#include "tests/support/recorded_case.h"
#include "tests/system/program_test.h"

namespace kiroku::test {
namespace {

using testing::HasSubstr;

constexpr double kFrame = 0.04;

/// An endoscope from the start, a room camera from 3 s on with gaps of a second, and a heart rate at 5 s.
class Exporting : public ProgramTest {
 protected:
  void SetUp() override {
    if (!has_tool("ffprobe")) GTEST_SKIP() << "ffprobe is not installed";
    RecordedStream endoscope = film("endoscope", {.segments = 8});
    for (std::int64_t i = 0; i < 8; ++i) endoscope.first_pts.push_back(45'000 + i * 90'000);
    RecordedStream room = film("room", {.gap_frames = 25, .sound = true});
    room.starts_ns = {3 * kSecond, 5 * kSecond, 7 * kSecond};
    room.first_pts = {45'000, 225'000, 405'000};
    media::VitalSample sample;
    sample.time_ns = 5 * kSecond;
    sample.code = "HR";
    sample.value = 72;
    sample.unit = "/min";
    sample.source = "bed 4";
    RecordedStream vitals{
        "vitals", "vitals", "application/jsonl", {to_bytes(media::to_json_line(sample) + "\n")}, {1}};
    vitals.starts_ns = {5 * kSecond};
    const Reader reader = make_reader();
    case_ = record_case(folder() / "archive", {endoscope, room, vitals}, reader.recipients).string();
    write_text(folder() / "identity.txt", reader.identity_text + "\n");
  }
  static RecordedStream film(const std::string& name, const FilmOptions& options) {
    RecordedStream stream{name, "video", "video/mp2t", make_transport_stream(options), {}};
    stream.units.assign(stream.segments.size(), 25);
    return stream;
  }
  [[nodiscard]] ProcessResult take(const Arguments& more) const {
    Arguments all{"export", case_, "-i", path("identity.txt")};
    all.insert(all.end(), more.begin(), more.end());
    return kiroku(all);
  }
  /// When ffprobe shows each picture.
  [[nodiscard]] std::vector<double> pictures(const std::string& file) const {
    std::istringstream lines(tool({"ffprobe", "-v", "error", "-select_streams", "v:0", "-show_entries",
                                   "packet=pts_time", "-of", "csv=p=0", file})
                                 .out);
    std::vector<double> times;
    for (std::string line; std::getline(lines, line);) {
      if (!line.empty() && line[0] != ',') times.push_back(std::stod(line));
    }
    return times;
  }
  std::string case_;
};

TEST_F(Exporting, ShowsOneInstantAtOneTimeInEveryFormAndStream) {
  for (const bool whole : {true, false}) {
    const double zero = whole ? 0 : 3;
    const Arguments stretch = whole ? Arguments{"--force"} : Arguments{"--force", "--from", "0:03.5"};
    const auto with = [&](Arguments more) {
      more.insert(more.end(), stretch.begin(), stretch.end());
      const ProcessResult result = take(more);
      EXPECT_EQ(result.status, 0) << result.err;
    };
    for (const std::string ending : {".ts", ".mkv", ".mp4"}) {
      with({"--stream", "endoscope", "-o", "endoscope" + ending});
      with({"--stream", "room", "-o", "room" + ending});
      const auto endoscope = pictures("endoscope" + ending), room = pictures("room" + ending);
      ASSERT_EQ(room.size(), 75U) << ending;
      EXPECT_NEAR(endoscope.front(), 0, kFrame) << ending;
      EXPECT_NEAR(room[0], 3 - zero, kFrame) << ending;
      EXPECT_NEAR(room[25], 5 - zero, kFrame) << ending << " after the gap";
      EXPECT_NEAR(room[74], 7.96 - zero, kFrame) << ending;
      EXPECT_NEAR(endoscope[std::size_t(25 * (5 - zero))], room[25], kFrame) << ending << " at 5 s";
    }
    with({"--stream", "vitals", "-o", "vitals.csv"});
    EXPECT_THAT(read_text(folder() / "vitals.csv"),
                HasSubstr("\n5,HR,72,/min,good,bed 4," + std::to_string(int(5 - zero)) + ",\n"));
  }
}

TEST_F(Exporting, TakesEverythingIntoAFolderThatSaysWhatItIs) {
  const ProcessResult made = take({"--all", "-o", "all", "--json"});
  ASSERT_EQ(made.status, 0) << made.err;
  const auto manifest = nlohmann::json::parse(read_text(folder() / "all/manifest.json"));
  EXPECT_EQ(manifest, nlohmann::json::parse(made.out));
  EXPECT_EQ(manifest["format"], "kiroku-export/1");
  EXPECT_EQ(manifest["zero"]["case_ns"], 0);
  EXPECT_EQ(manifest["verification"]["verdict"], "unproven") << "nobody's device is trusted here";
  EXPECT_EQ(manifest["streams"][1]["gaps"].size(), 3U);
  EXPECT_EQ(manifest["streams"][1]["gaps"][1]["start_ns"], 4 * kSecond);
  ASSERT_EQ(manifest["files"].size(), 4U);
  for (const auto& file : manifest["files"]) {
    const std::string name = file["file"];
    const std::string sum = tool({"sha256sum", path("all/" + name)}).out;
    EXPECT_EQ(sum.substr(0, 64), file["sha256"]) << name;
  }
  EXPECT_EQ(manifest["files"][1]["file"], "room.mkv");
  EXPECT_EQ(manifest["files"][1]["start_ns"], 3 * kSecond);
  EXPECT_EQ(manifest["files"][1]["start_utc"], "2026-08-05T09:15:05.000000Z");
  const std::vector<double> shown = pictures("all/room.mkv");
  std::istringstream index(read_text(folder() / "all/room.frames.csv"));
  std::string line;
  std::getline(index, line);
  EXPECT_EQ(line, "frame,time,case_time");
  for (const double time : shown) {
    ASSERT_TRUE(std::getline(index, line));
    EXPECT_NEAR(std::stod(line.substr(line.find(',') + 1)), time, 0.001) << line;
  }
  EXPECT_FALSE(std::getline(index, line));
}

TEST_F(Exporting, NamesWhatIsMissingOfIt) {
  const ProcessResult room = take({"--stream", "room", "-o", "room.mkv"});
  ASSERT_EQ(room.status, 0) << room.err;
  EXPECT_THAT(room.out, HasSubstr("Not in it, since it was not recorded: 3 stated gaps, "));
  EXPECT_THAT(room.out, HasSubstr("at 00:00:04 for 1.0 s ("));
  EXPECT_EQ(kiroku_json({"export", case_, "-i", path("identity.txt"), "--stream", "room", "--json", "-o",
                         "again.mkv"})["gaps"]
                .size(),
            3U);
  const ProcessResult all = take({"--all", "-o", "all"});
  EXPECT_THAT(all.out, HasSubstr("Of room was not recorded: 3 stated gaps, "));
  EXPECT_THAT(take({"--stream", "endoscope", "-o", "endoscope.mkv"}).out,
              testing::Not(HasSubstr("was not recorded")));
}

TEST_F(Exporting, OfACaseThatWasTamperedWithDoesNotLeaveAsIfItHeld) {
  const std::filesystem::path last = std::filesystem::path(case_) / "segments/endoscope/00000007.ts.age";
  ASSERT_TRUE(std::filesystem::exists(last));
  write_text(last, "another's");
  const ProcessResult made = take({"--all", "-o", "all", "--to", "0:02"});
  EXPECT_EQ(made.status, 1);
  EXPECT_THAT(made.err, HasSubstr("the case does not hold"));
  EXPECT_THAT(made.out, HasSubstr("whose verdict is tampered"));
  const auto manifest = nlohmann::json::parse(read_text(folder() / "all/manifest.json"));
  EXPECT_EQ(manifest["verification"]["verdict"], "tampered");
}

// Whoever opens the files reads what is in them: what the same key finds is said.
TEST_F(Exporting, IsJudgedWithTheKeyThatWasGiven) {
  const auto event = [](const std::string& text) {
    return R"({"salt":")" + std::string(64, 'a') + R"(","event":"{\"time_ns\":500000000,\"text\":\")" + text +
           "\\\"}\"}\n";
  };
  RecordedStream endoscope = film("endoscope", {.segments = 2});
  endoscope.first_pts = {45'000, 135'000};
  RecordedStream events{
      "events", "events", "application/jsonl", {to_bytes(event("clip") + event("cut"))}, {2}};
  events.not_entered = {event("cut")};
  const Reader reader = make_reader();
  write_text(folder() / "identity.txt", reader.identity_text + "\n");
  case_ = record_case(folder() / "marked", {endoscope, events}, reader.recipients).string();
  const auto exported = [&](const std::string& name) {
    const ProcessResult made = take({"--all", "-o", name});
    return std::pair(made, nlohmann::json::parse(read_text(folder() / name / "manifest.json")));
  };
  const auto codes_of = [](const nlohmann::json& manifest) {
    std::set<std::string> codes;
    for (const auto& finding : manifest["verification"]["findings"]) codes.insert(finding["code"]);
    return codes;
  };
  const auto [marked, manifest] = exported("marked-out");
  EXPECT_TRUE(codes_of(manifest).contains("event-not-committed")) << manifest["verification"];
  EXPECT_EQ(manifest["verification"]["contents"]["opened"], 3);
  EXPECT_EQ(read_text(folder() / "marked-out/events.jsonl"), event("clip"));
  EXPECT_EQ(manifest["files"][1]["left_out"], 1);
  EXPECT_THAT(marked.out, HasSubstr("Of events.jsonl: 1 line(s) were left out"));
  EXPECT_THAT(take({"--stream", "events", "-o", "events.jsonl"}).out, HasSubstr("1 line(s) were left out"));

  endoscope.units[1] = 50;
  case_ = record_case(folder() / "short", {endoscope}, reader.recipients).string();
  const auto [shortened, of_half] = exported("short-out");
  EXPECT_EQ(shortened.status, 1);
  EXPECT_THAT(shortened.out, HasSubstr("whose verdict is tampered"));
  EXPECT_TRUE(codes_of(of_half).contains("segment-undecodable")) << of_half["verification"];
}

TEST_F(Exporting, ReplacesOnlyWhereForcedAndOnlyWhatItMade) {
  ASSERT_EQ(take({"--stream", "room", "-o", "room.ts"}).status, 0);
  EXPECT_REFUSED(take({"--stream", "room", "-o", "room.ts"}), "--force");
  EXPECT_EQ(take({"--stream", "room", "-o", "room.ts", "--force"}).status, 0);
  ASSERT_EQ(take({"--all", "-o", "all"}).status, 0);
  EXPECT_REFUSED(take({"--all", "-o", "all"}), "--force");
  EXPECT_EQ(take({"--all", "-o", "all", "--force", "--to", "0:02"}).status, 0);
  EXPECT_FALSE(std::filesystem::exists(folder() / "all/room.mkv"));
  write_text(folder() / "all/thesis.tex", "mine");
  EXPECT_REFUSED(take({"--all", "-o", "all", "--force"}), "'thesis.tex' in it is not of the earlier export");
  EXPECT_EQ(read_text(folder() / "all/thesis.tex"), "mine");
  std::filesystem::create_directory(folder() / "photos");
  EXPECT_REFUSED(take({"--all", "-o", "photos", "--force"}), "it is no earlier export");
  for (const auto& entry : std::filesystem::directory_iterator(folder())) {
    EXPECT_NE(entry.path().extension(), ".part");
  }
}

TEST_F(Exporting, SaysWhatIsWrongWithTimesAndNames) {
  const auto expect = [&](Arguments more, const std::string& part) {
    more.insert(more.end(), {"-o", "x.ts"});
    EXPECT_REFUSED(take(more), part);
  };
  expect({"--stream", "endoscop"}, "did you mean 'endoscope'?");
  expect({"--stream", "room", "--from", "5s", "--to", "0:03"}, "--from (5s) is after --to (0:03)");
  expect({"--stream", "room", "--from", "1h2m"}, "beyond the end of the case, which is 00:00:08 long");
  expect({"--stream", "room", "--to", "9"}, "beyond the end of the case, which is 00:00:08 long");
  expect({"--stream", "room", "--from", "noon"}, "write 5s, 0:05, 1:02:03.5, 1h2m or 90 (seconds)");
  expect({}, "--stream, or take every stream with --all");
}

}  // namespace
}  // namespace kiroku::test
